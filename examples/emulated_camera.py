"""A camera on the loopback that speaks the epc660's wire format: frames that were made up before.

What the maker's open toolkit (epc-tofcam-toolkit) tells of commands and images is marked [src];
what is marked [assumed] has no source. Nothing here is shared with the client.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

FRAMED = struct.Struct("!II")  # [src] mark of the start, bytes of what follows
START, END = 0xFFFFAA55, struct.pack("!I", 0xFFFF55AA)  # [src]
IMAGE = struct.Struct("!BHHHHHHHHHHhH")  # [src] 25 bytes before an image
SET_TIMES, GET_GRAY, GET_SAMPLES, SET_FREQUENCY, GET_TEMPERATURE = 1, 5, 7, 23, 74  # [src]
DONE, TEMPERATURE = 0, 4  # [src] kinds of answers
GRAY, SAMPLES = 3, 4  # [assumed] types of images
F1_CODE = 1  # [src] 24 MHz; other codes are taken for the second frequency
MID_SCALE, FULL = 2048, 64003  # [src]
SAMPLES_PER_FREQUENCY = 4


@dataclass(frozen=True)
class ServedFrame:
    """One frame that the camera has in store.

    Attributes
    ----------
    gray : uint16 [H, W]
    exposure_us : int
        Of the gray image.
    words : uint16 [8, H, W]
        Four samples at each of two frequencies; 64003 where a pixel is full.
    """

    gray: np.ndarray
    exposure_us: int
    words: np.ndarray


def wire_words(dcs_lsb: np.ndarray, full: np.ndarray) -> np.ndarray:
    """Words uint16 [n, H, W] of samples in LSB, and of full pixels, bool [n, H, W]."""
    return np.where(full, FULL, np.rint(dcs_lsb) + MID_SCALE).astype(np.uint16)


class EmulatedCamera:
    """Serves frames one after the other: each request for a gray image begins the next.

    Parameters
    ----------
    frames : sequence of ServedFrame
        After the last the connection is closed.
    centi_celsius : int
        Temperature of the imager, hundredths of a degree.
    period_s : float
        Seconds from frame to frame; 0 serves at once.
    sample_s : float
        Seconds that each sample takes.

    Attributes
    ----------
    port : int
        Where it listens on the loopback.
    requests : list of (str, int)
        "gray" with the frame's number, "samples" with how many, "frequency" with its code.
    """

    def __init__(
        self,
        frames: Sequence[ServedFrame],
        *,
        centi_celsius: int = 3000,
        period_s: float = 0.0,
        sample_s: float = 0.0,
    ) -> None:
        self._frames, self._celsius = frames, centi_celsius
        self._period_s, self._sample_s = period_s, sample_s
        self.requests: list[tuple[str, int]] = []
        self._number, self._began_s = -1, 0.0
        self._integration_us, self._code = 0, F1_CODE
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._connection: socket.socket | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> EmulatedCamera:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        for each in (self._connection, self._listener):
            if each is not None:
                # Wakes a thread that waits for it, which closing alone would not.
                with suppress(OSError):  # Already gone.
                    each.shutdown(socket.SHUT_RDWR)
                each.close()
        self._thread.join()

    def _serve(self) -> None:
        """One client after the other, each until it leaves."""
        while True:
            try:
                self._connection, _ = self._listener.accept()
            except OSError:
                return  # Closed.
            with self._connection as connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                with suppress(OSError):  # The client left.
                    self._converse(connection)

    def _converse(self, connection: socket.socket) -> None:
        while head := _exactly(connection, FRAMED.size):
            start, length = FRAMED.unpack(head)
            payload = _exactly(connection, length + len(END))
            if start != START or payload[-4:] != END:
                return
            (command,) = struct.unpack_from("!H", payload)
            reply = self.reply(command, payload[2:-4])
            if reply is None:
                return
            connection.sendall(reply)

    def reply(self, command: int, data: bytes) -> bytes | None:
        """Bytes that answer a command; None hangs up."""
        if command == SET_TIMES:
            self._integration_us = struct.unpack_from("!H", data)[0]
            return answer(DONE)
        if command == SET_FREQUENCY:
            self._code = data[0]
            self.requests.append(("frequency", self._code))
            return answer(DONE)
        if command == GET_TEMPERATURE:
            return answer(TEMPERATURE, struct.pack("!h", self._celsius))
        if command == GET_GRAY:
            if not self._begin_frame():
                return None
            frame = self._frames[self._number]
            self.requests.append(("gray", self._number))
            return answer(DONE) + self.image(GRAY, frame.gray[None], frame.exposure_us)
        if command == GET_SAMPLES:
            count = data[1]  # [assumed] after the mode, which is [src] 0
            self.requests.append(("samples", count))
            time.sleep(count * self._sample_s)
            first = 0 if self._code == F1_CODE else SAMPLES_PER_FREQUENCY
            words = self._frames[self._number].words[first : first + count]
            return answer(DONE) + self.image(SAMPLES, words, self._integration_us)
        return answer(1, b"\x00\x00")  # [src] kind of an error

    def image(self, kind: int, planes: np.ndarray, time_us: int) -> bytes:
        """Header and little-endian words of the planes [n, H, W]."""
        _, height, width = planes.shape
        head = (1, kind, width, height, 0, 0, width, height, time_us, 0, 0, self._celsius)
        return IMAGE.pack(*head, IMAGE.size) + planes.astype("<u2").tobytes()

    def _begin_frame(self) -> bool:
        """Wait for the next frame; False after the last."""
        now = time.monotonic()
        if self._number < 0:
            self._began_s = now
        elif self._period_s:
            # As a camera that runs on: what is asked for too late is of the next tick.
            passed = (now - self._began_s) / self._period_s
            time.sleep((1.0 - passed % 1.0) * self._period_s)
        self._number += 1
        return self._number < len(self._frames)


def answer(kind: int, data: bytes = b"") -> bytes:
    """An answer of a kind, with its data."""
    return FRAMED.pack(START, 1 + len(data)) + bytes((kind,)) + data + END


def _exactly(connection: socket.socket, count: int) -> bytes:
    """So many bytes, or none where the client has left."""
    content = b""
    while len(content) < count:
        new = connection.recv(count - len(content))
        if not new:
            return b""
        content += new
    return content
