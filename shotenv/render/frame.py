"""One frame of the sensor, noise-free: eight samples and the gray image at their own instants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shotenv.config import CameraConfig, SensorConfig
from shotenv.render.backend import start_mitsuba
from shotenv.render.instants import frame_instants
from shotenv.render.lens import through_lens
from unwrap.signal import harmonic_weights

if TYPE_CHECKING:  # Worker processes start without loading how worlds are drawn.
    from shotenv.world.geometry import World


@dataclass(frozen=True)
class RenderedFrame:
    """Noise-free light of one frame: the arrays of `shotenv.sensor.Exposure` without a batch.

    Attributes
    ----------
    correlation : float32 [8, H, W]
        Active light times the demodulation signal, of each sample at its own instant,
        W m-2 sr-1 per watt of laser: `Traced.correlation`.
    active : float32 [H, W]
        Active radiance, mean over the samples, W m-2 sr-1 per watt of laser.
    ambient : float32 [H, W]
        Ambient radiance in band, mean over the gray exposure, W m-2 sr-1.
    distance_m : float32 [H, W]
        Distance through the pixel's centre at the start of the frame, metres; infinite for sky.
    """

    correlation: np.ndarray
    active: np.ndarray
    ambient: np.ndarray
    distance_m: np.ndarray


class FrameRenderer:
    """Renders frames of one world; what stands still is built once.

    Raises
    ------
    RendererError
        Mitsuba or a usable LLVM library is missing.
    """

    def __init__(self, world: World, sensor: SensorConfig) -> None:
        start_mitsuba()
        # Not at the top: what only plans or reads banks starts without Mitsuba.
        from shotenv.render.surfaces import Surroundings

        self._world, self._sensor, self._surroundings = world, sensor, Surroundings(world)
        self._harmonics = harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic)

    def frame(
        self,
        time_s: float,
        camera: CameraConfig,
        *,
        seed: int,
        gray_exposure_s: float | None = None,
    ) -> RenderedFrame:
        """The frame whose first sample starts at `time_s`.

        What moves is blurred in the ambient light over `gray_exposure_s` seconds, by default the
        longest gray exposure.
        """
        from shotenv.render.integrator import trace

        instants = frame_instants(time_s, camera, self._sensor, gray_exposure_s=gray_exposure_s)
        traced = trace(
            self._world,
            instants,
            camera,
            harmonics=self._harmonics,
            seed=seed,
            surroundings=self._surroundings,
        )
        laser, passive = np.array(instants.laser), np.array(instants.passive)
        # The lens is linear: means over instants pass through it as each instant would.
        return RenderedFrame(
            correlation=through_lens(traced.correlation[laser], self._sensor),
            active=through_lens(traced.active[laser].mean(axis=0), self._sensor),
            ambient=through_lens(traced.ambient[passive].mean(axis=0), self._sensor),
            # Of the first sample, the instant that the frame is asked for.
            distance_m=traced.distance_m[0],
        )


def render_frame(
    world: World, time_s: float, camera: CameraConfig, sensor: SensorConfig, **options: Any
) -> RenderedFrame:
    """One frame of `world`; `options` are those of `FrameRenderer.frame`.

    Raises
    ------
    RendererError
        Mitsuba or a usable LLVM library is missing.
    """
    return FrameRenderer(world, sensor).frame(time_s, camera, **options)
