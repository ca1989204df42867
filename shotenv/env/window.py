"""A window that shows pictures and tells which keys were pressed; needs pygame-ce."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

CAPTION = "shotenv"


class Window:
    """A window as large as the pictures that it shows.

    Parameters
    ----------
    fps
        Most pictures shown in a second; 0 shows them as they come.

    Raises
    ------
    ImportError
        pygame-ce is not installed; the message says how to get it.
    """

    def __init__(self, fps: float) -> None:
        # Before the import, which greets whoever imports it.
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame
        except ImportError:
            raise ImportError(
                "a window needs pygame-ce, which is not installed: pip install 'shotenv[play]'"
            ) from None
        self._pygame = pygame
        self._fps = fps
        pygame.display.init()
        pygame.display.set_caption(CAPTION)
        self._clock = pygame.time.Clock()
        self._surface: Any = None

    def show(self, picture: np.ndarray) -> None:
        """Show a picture uint8 [h, w, 3], at most `fps` of them in a second."""
        pygame = self._pygame
        size = picture.shape[1], picture.shape[0]
        if self._surface is None or self._surface.get_size() != size:
            self._surface = pygame.display.set_mode(size)
        # pygame counts columns first.
        pygame.surfarray.blit_array(self._surface, picture.swapaxes(0, 1))
        # Without looking at its events a window counts as hung.
        pygame.event.pump()
        pygame.display.flip()
        if self._fps:
            self._clock.tick(self._fps)

    def keys(self) -> list[str]:
        """Names of the keys pressed since the last call; "quit" where the window was closed."""
        pygame = self._pygame
        pressed = []
        for event in pygame.event.get((pygame.KEYDOWN, pygame.QUIT)):
            quits = event.type == pygame.QUIT
            pressed.append("quit" if quits else pygame.key.name(event.key))
        return pressed

    def pixels(self) -> np.ndarray:
        """What the window shows, uint8 [h, w, 3]."""
        return self._pygame.surfarray.array3d(self._surface).swapaxes(0, 1)

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()
        self._surface = None
