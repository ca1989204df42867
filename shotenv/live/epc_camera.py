"""An epc660 camera (TOFcam660) on the network: frames in its wire format, on demand.

Where a line is marked [src], the maker's open toolkit (epc-tofcam-toolkit) does it that way; what
is marked [assumed] has no source here and was never tried on a camera. A command is

    0xffffaa55, length, payload of 34 bytes, 0xffff55aa                       [src]

with the number of the command in the payload's first two bytes. The answer has the same frame, its
first byte 0 for done and 4 for a temperature [src]. All numbers are big-endian, but for the words
of images. Where an image was asked for, it follows the answer on the same connection [assumed;
older cameras send it by UDP].
"""

from __future__ import annotations

import math
import select
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np
import torch

from shotenv.live.live_camera import (
    CameraDisconnectedError,
    CameraTimeoutError,
    DamagedFrameError,
    GrayFrame,
    Samples,
    StaleFrameError,
    TruncatedFrameError,
)
from unwrap.cameras import gray_of, samples_of, turned
from unwrap.cameras.files import CELSIUS_K, WIRE_HEADER, CameraDescription
from unwrap.signal import GRAY_FULL_SCALE, SAMPLES_PER_FREQUENCY, Shots

PORT: Final = 50660  # [src]
START, END = 0xFFFFAA55, 0xFFFF55AA  # [src]
PAYLOAD_BYTES = 34  # [src]
SET_TIMES, GET_GRAY, GET_SAMPLES, SET_FREQUENCY, GET_TEMPERATURE = 1, 5, 7, 23, 74  # [src]
DONE, TEMPERATURE = 0, 4  # [src]
AUTOMATIC_US = 0  # [assumed] The camera sets the exposure of gray images itself.
FREQUENCY_CODES: Final = {
    **{12e6: 0, 24e6: 1, 6e6: 2, 3e6: 3, 1.5e6: 4, 0.75e6: 5},  # [src]
    10e6: 6,  # [assumed] By an external clock.
}
LARGEST_ANSWER_BYTES = 64


class EpcCamera:
    """A camera at a network address, asked for one image at a time.

    Parameters
    ----------
    host, port
        Where it listens.
    description : CameraDescription
        Of its words and samples: `configs/camera/epc660_wire.yaml`, or a copy.
    frequencies_hz : (float, float)
        Modulation frequencies of the first four samples and of the others.
    laser_power_w : float
        Optical power while on, which the camera does not tell.
    integration_s : float
        Time of one sample, whole microseconds.
    size : (int, int), optional
        Rows and columns; those of the description without.
    timeout_s : float
        Longest time from a command to its whole answer, and from there to a whole image.

    Raises
    ------
    ValueError
        A frequency that the camera has no code for, an integration time that its commands cannot
        tell, no laser power, or a description of another kind of camera.
    """

    def __init__(
        self,
        host: str,
        port: int = PORT,
        *,
        description: CameraDescription,
        frequencies_hz: tuple[float, float],
        laser_power_w: float,
        integration_s: float,
        size: tuple[int, int] | None = None,
        timeout_s: float = 1.0,
    ) -> None:
        self.name = f"camera {host}:{port}"
        self.laser_power_w, self.integration_s = laser_power_w, integration_s
        self._address, self._timeout_s = (host, port), timeout_s
        self._camera = _checked(description)
        self._codes = tuple(_code_of(hz) for hz in frequencies_hz)
        self._integration_us = _microseconds(integration_s)
        if not 0 < laser_power_w < math.inf:
            raise ValueError(f"laser_power_w is {laser_power_w!r}; expected watts above 0")
        layout = description.layout
        self._stored_size = size or (layout.height or 0, layout.width or 0)
        self._socket: socket.socket | None = None
        self._code_set: int | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of its images, as they lie in the view."""
        height, width = self._stored_size
        return (width, height) if self._camera.axes.transpose else (height, width)

    def start(self) -> None:
        """Connect, and set the integration time."""
        if self._socket is not None:
            return
        try:
            self._socket = socket.create_connection(self._address, self._timeout_s)
        except OSError as error:
            raise CameraDisconnectedError(
                f"{self.name}: cannot connect ({error}); is it on, and the address right?"
            ) from None
        # Commands are small and awaited: they must not be held back to be sent together.
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._code_set = None
        self._command(SET_TIMES, struct.pack("!HHHH", self._integration_us, 0, 0, AUTOMATIC_US))

    def next_frame(self) -> GrayFrame:
        """Wait for the next frame and take its gray image.

        Its exposure is the header's first integration time [assumed].
        """
        self._command(GET_GRAY, b"\x00")  # A single image [src].
        exposure_us, planes = self._image("gray image", self._camera.layout.gray_type, 1)
        if exposure_us == 0:
            raise DamagedFrameError(
                f"{self.name}: exposure of the gray image is 0; expected more, in microseconds"
            )
        with self._as_damaged():
            gray = gray_of(planes, self._camera, self.name, ("now",))
        words = np.rint(turned(gray, self._camera.axes)[0] * GRAY_FULL_SCALE).astype(np.uint16)
        return GrayFrame(torch.from_numpy(words), exposure_us * 1e-6)

    def acquire(self, shots: Shots) -> Samples:
        """Take 2, 4 or 8 samples, those of each frequency by a request of their own."""
        parts = []
        for code in self._codes[: 1 + shots // (SAMPLES_PER_FREQUENCY + 1)]:
            self._set_frequency(code)
            parts.append(self._samples(min(shots, SAMPLES_PER_FREQUENCY)))
        dcs_lsb, saturated = (np.concatenate(each) for each in zip(*parts, strict=True))
        return Samples(torch.from_numpy(dcs_lsb), torch.from_numpy(saturated))

    def temperature_k(self) -> float:
        """Temperature of the imager, kelvin."""
        told = self._command(GET_TEMPERATURE, answer=TEMPERATURE)
        if len(told) != 2:
            raise DamagedFrameError(f"{self.name}: temperature has {len(told)} bytes; expected 2")
        return struct.unpack("!h", told)[0] / 100 + CELSIUS_K

    def close(self) -> None:
        """Close the connection, if there is one."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _set_frequency(self, code: int) -> None:
        if code != self._code_set:
            self._command(SET_FREQUENCY, bytes((code, 0, 0)))  # Code, channel, 0 [src].
            self._code_set = code

    def _samples(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Samples of one frequency [n, H, W], and where each is none."""
        camera, what = self._camera, f"frame of {count} samples"
        # A single image [src] of so many samples [assumed].
        self._command(GET_SAMPLES, bytes((0, count)))
        integration_us, planes = self._image(what, camera.layout.dcs_type, count)
        if integration_us != self._integration_us:
            raise DamagedFrameError(
                f"{self.name}: integration time of the {what} is {integration_us} us; expected "
                f"{self._integration_us} us, as was set"
            )
        with self._as_damaged():
            samples, saturated = samples_of(planes[None], camera, self.name, ("now",))
        order = np.argsort(camera.samples.phases_deg[:count])
        return turned(samples[0, order], camera.axes), turned(saturated[0, order], camera.axes)

    @contextmanager
    def _as_damaged(self) -> Iterator[None]:
        try:
            yield
        except ValueError as error:
            raise DamagedFrameError(str(error)) from None

    def _image(self, what: str, kind: int | None, count: int) -> tuple[int, np.ndarray]:
        """The header's first integration time, microseconds, and `count` planes of an image."""
        height, width = self._stored_size
        head = WIRE_HEADER.unpack(self._received(WIRE_HEADER.size, what))
        found_kind, (columns, rows) = head[1], head[2:4]
        if found_kind != kind or (rows, columns) != (height, width):
            raise DamagedFrameError(
                f"{self.name}: {what} has type {found_kind} and {rows} x {columns} pixels; "
                f"expected type {kind} and {height} x {width}; were bytes lost or swapped?"
            )
        content = self._received(2 * count * height * width, what)
        return head[8], np.frombuffer(content, "<u2").reshape(count, height, width)

    def _command(self, number: int, data: bytes = b"", *, answer: int = DONE) -> bytes:
        """Send a command, and give the data of its answer."""
        self._refuse_leftovers()
        payload = (struct.pack("!H", number) + data).ljust(PAYLOAD_BYTES, b"\x00")
        self._connected().settimeout(self._timeout_s)
        try:
            self._connected().sendall(
                struct.pack("!II", START, len(payload)) + payload + struct.pack("!I", END)
            )
        except OSError as error:
            raise CameraDisconnectedError(f"{self.name}: connection was lost ({error})") from None
        what = f"answer to command {number}"
        start, length = struct.unpack("!II", self._received(8, what))
        if start != START or not 1 <= length <= LARGEST_ANSWER_BYTES:
            raise DamagedFrameError(
                f"{self.name}: {what} begins with {start:#010x} and a length of {length}; expected "
                f"{START:#010x} and 1 to {LARGEST_ANSWER_BYTES}"
            )
        content = self._received(length + 4, what)
        end = struct.unpack("!I", content[-4:])[0]
        if content[0] != answer or end != END:
            raise DamagedFrameError(
                f"{self.name}: {what} is of kind {content[0]} and ends with {end:#010x}; expected "
                f"kind {answer} and {END:#010x}"
            )
        return content[1:-4]

    def _refuse_leftovers(self) -> None:
        """Refuse bytes that nobody waits for: the next answer would be taken from them."""
        waiting, _, _ = select.select([self._connected()], [], [], 0)
        if not waiting:
            return
        try:
            found = len(self._connected().recv(1 << 16, socket.MSG_PEEK))
        except OSError:
            found = 0
        if not found:
            raise CameraDisconnectedError(f"{self.name}: the camera closed the connection")
        raise StaleFrameError(
            f"{self.name}: {found} bytes or more of an earlier answer are waiting; expected none"
        )

    def _received(self, count: int, what: str) -> bytes:
        """Exactly `count` bytes of `what`."""
        content, received = bytearray(count), 0
        latest_s = time.monotonic() + self._timeout_s
        while received < count:
            # Of all together: a camera that goes on to send a byte now and then is none that works.
            self._connected().settimeout(max(latest_s - time.monotonic(), 1e-3))
            try:
                new = self._connected().recv_into(memoryview(content)[received:])
            except TimeoutError:
                if received:
                    raise TruncatedFrameError(
                        f"{self.name}: {received} of {count} bytes of the {what} within "
                        f"{self._timeout_s:g} s"
                    ) from None
                raise CameraTimeoutError(
                    f"{self.name}: no {what} within {self._timeout_s:g} s"
                ) from None
            except OSError as error:
                raise CameraDisconnectedError(
                    f"{self.name}: connection was lost ({error})"
                ) from None
            if not new:
                self._raise_ended(what, received, count)
            received += new
        return bytes(content)

    def _raise_ended(self, what: str, received: int, count: int) -> None:
        if received:
            raise TruncatedFrameError(
                f"{self.name}: {what} ended after {received} of {count} bytes"
            )
        raise CameraDisconnectedError(
            f"{self.name}: the camera closed the connection where the {what} should come"
        )

    def _connected(self) -> socket.socket:
        if self._socket is None:
            raise CameraDisconnectedError(f"{self.name}: not connected; call start() first")
        return self._socket


def _code_of(frequency_hz: float) -> int:
    if frequency_hz not in FREQUENCY_CODES:
        known = ", ".join(f"{hz / 1e6:g}" for hz in FREQUENCY_CODES)
        raise ValueError(
            f"frequencies_hz has {frequency_hz:g}; expected one of {known} MHz, which the camera "
            "has codes for"
        )
    return FREQUENCY_CODES[frequency_hz]


def _microseconds(integration_s: float) -> int:
    """As the camera is told."""
    found = round(integration_s * 1e6)
    if not 1 <= found <= 0xFFFF or not math.isclose(found * 1e-6, integration_s, rel_tol=1e-9):
        raise ValueError(
            f"integration_s is {integration_s!r}; expected whole microseconds, 1 to 65535"
        )
    return found


def _checked(description: CameraDescription) -> CameraDescription:
    """The description where its camera can be asked for two and for four samples."""
    phases = description.samples.phases_deg
    if description.container != "espros_wire":
        raise ValueError(
            f"{description.name} has container {description.container}; expected espros_wire"
        )
    if sorted(phases) != [0, 90, 180, 270] or sorted(phases[:2]) != [0, 90]:
        raise ValueError(
            f"{description.name} has samples at {phases} degrees; expected 0, 90, 180 and 270, "
            "those at 0 and 90 first: two samples are the first two"
        )
    return description
