"""Cameras that fail: each failure has a name and a sentence, and the connection is closed."""

from __future__ import annotations

import select
import struct
import time
from contextlib import closing

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from served_drives import client_of, example_module

from shotenv.live import (
    CameraDisconnectedError,
    CameraTimeoutError,
    DamagedFrameError,
    LiveShotScheduleEnv,
    StaleFrameError,
    TruncatedFrameError,
)
from unwrap.signal import Shots

GRAY, SAMPLES = 5, 7
HEIGHT, WIDTH = 24, 32
TIMEOUT_S, PATIENT_S = 0.3, 60.0
"""Of cameras that are too slow, and of those that fail otherwise, on however busy a machine."""
ANSWER_BYTES = 13


def frames(count=4):
    emulated = example_module("emulated_camera")
    even = np.full((HEIGHT, WIDTH), 900, np.uint16)
    words = np.full((8, HEIGHT, WIDTH), 2100, np.uint16)
    return [emulated.ServedFrame(even, 1000, words)] * count


def bad_camera(command, spoil, *, count=4):
    """A camera whose replies to one command are spoilt; None hangs up."""

    class BadCamera(example_module("emulated_camera").EmulatedCamera):
        def reply(self, number, data):
            reply = super().reply(number, data)
            return spoil(reply) if number == command else reply

    return BadCamera(frames(count))


def silent(reply):
    time.sleep(2 * TIMEOUT_S)
    return b""


def changed(place, kind, value):
    """Bytes of a reply with another value at a place after the answer."""

    def spoil(reply):
        spoilt = bytearray(reply)
        struct.pack_into(kind, spoilt, ANSWER_BYTES + place, value)
        return bytes(spoilt)

    return spoil


WORD = 25 + 2 * (3 * WIDTH + 5)
BAD = {
    "no answer": (GRAY, silent, CameraTimeoutError, "no answer to command 5 within 0.3 s"),
    "no image": (
        *(GRAY, lambda reply: reply[:ANSWER_BYTES]),
        *(CameraTimeoutError, "no gray image within 0.3 s"),
    ),
    "hung up": (GRAY, lambda reply: None, CameraDisconnectedError, "closed the connection where"),
    "hung up later": (
        *(SAMPLES, lambda reply: None),
        *(CameraDisconnectedError, "closed the connection where the answer to command 7 should"),
    ),
    "cut off": (
        *(SAMPLES, lambda reply: reply[:2000]),
        *(TruncatedFrameError, "1962 of 6144 bytes of the frame of 4 samples within 0.3 s"),
    ),
    "cut off in the header": (
        *(GRAY, lambda reply: reply[: ANSWER_BYTES + 11]),
        *(TruncatedFrameError, "11 of 25 bytes of the gray image within 0.3 s"),
    ),
    "no answer as described": (
        *(GRAY, lambda reply: b"HTTP/1.1 400 Bad Request"),
        *(DamagedFrameError, "begins with 0x48545450 and a length of 791752241; expected 0xffff"),
    ),
    "an error": (
        *(GRAY, lambda reply: example_module("emulated_camera").answer(1, b"\x00\x07")),
        *(DamagedFrameError, "answer to command 5 is of kind 1 and ends with 0xffff55aa"),
    ),
    "samples for gray": (
        *(GRAY, changed(1, "!H", 4)),
        *(DamagedFrameError, "gray image has type 4 and 24 x 32 pixels; expected type 3"),
    ),
    "swapped bytes": (
        *(SAMPLES, changed(3, "<H", WIDTH)),
        *(DamagedFrameError, "has type 4 and 24 x 8192 pixels; .* were bytes lost or swapped"),
    ),
    "another size": (
        *(SAMPLES, changed(5, "!H", 12)),
        *(DamagedFrameError, "12 x 32 pixels; expected type 4 and 24 x 32"),
    ),
    "another integration time": (
        *(SAMPLES, changed(15, "!H", 401)),
        *(DamagedFrameError, "of the frame of 4 samples is 401 us; expected 400 us, as was set"),
    ),
    "no exposure": (
        *(GRAY, changed(15, "!H", 0)),
        *(DamagedFrameError, "exposure of the gray image is 0; expected more"),
    ),
    "a gray word too large": (
        *(GRAY, changed(WORD, "<H", 5000)),
        *(DamagedFrameError, r"holds 5000 in plane 0 at row 3, column 5.*expected gray values"),
    ),
    "a word outside": (
        *(SAMPLES, changed(WORD, "<H", 4096)),
        *(DamagedFrameError, r"frame now holds 4096 in plane 0 at row 3, column 5"),
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_each_failure_has_its_name(kind):
    command, spoil, error, told = BAD[kind]
    with bad_camera(command, spoil) as server:
        slow = error in (CameraTimeoutError, TruncatedFrameError)
        with closing(client_of(server, timeout_s=TIMEOUT_S if slow else PATIENT_S)) as camera:
            camera.start()
            with pytest.raises(error, match=told) as raised:
                camera.next_frame()
                camera.acquire(Shots.FOUR)
        assert str(raised.value).startswith(f"camera 127.0.0.1:{server.port}: ")


def wait_for_bytes(camera):
    """Until something lies there that nobody has read."""
    assert select.select([camera._socket], [], [], 60.0)[0]


def test_what_is_left_of_an_earlier_answer_is_not_taken_for_the_next():
    with bad_camera(GRAY, lambda reply: reply + reply[-100:]) as server:
        camera = client_of(server, timeout_s=PATIENT_S)
        camera.start()
        camera.next_frame()
        wait_for_bytes(camera)
        with pytest.raises(StaleFrameError, match="100 bytes or more of an earlier answer"):
            camera.acquire(Shots.TWO)
        camera.close()


def test_a_camera_that_drips_is_not_waited_for():
    class Dripping(example_module("emulated_camera").EmulatedCamera):
        def reply(self, number, data):
            reply = super().reply(number, data)
            if number != GRAY:
                return reply
            for byte in reply:
                self._connection.sendall(bytes((byte,)))
                time.sleep(TIMEOUT_S / 10)
            return None

    with Dripping(frames()) as server, closing(client_of(server, timeout_s=TIMEOUT_S)) as camera:
        camera.start()
        began_s = time.monotonic()
        with pytest.raises(TruncatedFrameError, match=r"bytes of the .* within"):
            camera.next_frame()
        # The whole image would take minutes.
        assert time.monotonic() - began_s < 30


def test_a_temperature_of_another_length_is_none():
    def longer(reply):
        return example_module("emulated_camera").answer(4, b"\x00\x01\x02")

    with bad_camera(74, longer) as server, closing(client_of(server)) as camera:
        camera.start()
        with pytest.raises(DamagedFrameError, match="temperature has 3 bytes; expected 2"):
            camera.temperature_k()


def test_an_answer_that_comes_too_late_does_not_become_that_of_the_next_frame():
    def late(reply):
        time.sleep(1.5 * TIMEOUT_S)
        return reply

    with bad_camera(GRAY, late) as server:
        camera = client_of(server, timeout_s=TIMEOUT_S)
        camera.start()
        with pytest.raises(CameraTimeoutError):
            camera.next_frame()
        wait_for_bytes(camera)
        with pytest.raises(StaleFrameError):
            camera.next_frame()
        camera.close()


def test_nobody_at_the_address():
    with bad_camera(GRAY, silent) as server:
        camera = client_of(server)
    with pytest.raises(CameraDisconnectedError, match=r"cannot connect .*; is it on"):
        camera.start()
    with pytest.raises(CameraDisconnectedError, match="not connected; call start"):
        camera.next_frame()


def test_a_camera_that_was_closed_starts_anew():
    with bad_camera(GRAY, lambda reply: reply) as server:
        camera = client_of(server)
        for _ in range(2):
            camera.start()
            camera.start()  # It runs.
            camera.next_frame()
            camera.close()
            camera.close()


class Closed:
    """A camera that counts how often it was closed."""

    def __init__(self, camera):
        self._camera, self.closed = camera, 0

    def __getattr__(self, name):
        return getattr(self._camera, name)

    def close(self):
        self.closed += 1
        self._camera.close()


@pytest.mark.parametrize("failing", [GRAY, SAMPLES])
def test_the_environment_closes_a_camera_that_fails(tiny_unwrapper, failing):
    with bad_camera(failing, lambda reply: None) as server:
        camera = Closed(client_of(server))
        live = LiveShotScheduleEnv(camera, unwrapper=tiny_unwrapper, stale_s=60.0)
        with pytest.raises(CameraDisconnectedError):
            live.reset()
            live.step(2)
        assert camera.closed == 1


def test_a_drive_that_ends_in_the_middle_is_not_stepped_on(tiny_unwrapper):
    with bad_camera(GRAY, lambda reply: reply, count=2) as server:
        live = LiveShotScheduleEnv(client_of(server), unwrapper=tiny_unwrapper, stale_s=60.0)
        live.reset()
        live.step(0)
        with pytest.raises(CameraDisconnectedError, match="closed the connection"):
            live.step(0)
        with pytest.raises(ResetNeeded):
            live.step(0)


def test_leaving_the_block_closes_the_camera(tiny_unwrapper):
    with bad_camera(GRAY, lambda reply: reply) as server:
        camera = Closed(client_of(server))
        with (
            pytest.raises(KeyboardInterrupt),
            LiveShotScheduleEnv(camera, unwrapper=tiny_unwrapper, stale_s=60.0) as live,
        ):
            live.reset()
            raise KeyboardInterrupt
        assert camera.closed == 1
