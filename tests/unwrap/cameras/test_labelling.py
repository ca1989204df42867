"""Orders of samples that fit a known distance: the right one always, others where they must."""

import numpy as np
import pytest
from camera_files import planes, small_camera, whole

from agents.cli.cameras.camera_commands import labelling_lines
from shotenv.config.reader import find_config, read_config
from unwrap.cameras import fitting, labellings, open_camera_recording
from unwrap.cameras.files import CameraDescription
from unwrap.signal.frequencies import unambiguous_range_m

SIZE, AT = (12, 16), (5, 9)


def described(name):
    return read_config(CameraDescription, find_config("camera", str(name)))


def recorded(tmp_path, name, hz, distance_m, camera=None, **noise):
    wall = np.full(SIZE, distance_m)
    stored = whole(planes(name, [wall] * 4, hz, **noise)).reshape(4, -1, *SIZE)
    np.save(tmp_path / "a.npy", stored.astype(np.int16))
    camera = described(camera or name)
    return open_camera_recording(tmp_path / "a.npy", camera), camera


def fits(found):
    return {way.phase_deg for way in found if way.fits}


@pytest.mark.parametrize("name", ["mlx75027", "mlx75027_reversed"])
def test_the_right_order_fits_whichever_is_described(tmp_path, name):
    # 0.30 of the range: no multiple of an eighth, at which mirrored orders meet.
    known_m = 2.30 * unambiguous_range_m(60e6)
    for told in ("mlx75027", "mlx75027_reversed"):
        recording, camera = recorded(
            tmp_path, name, [60e6], known_m, camera=told, offset=25, noise=4
        )
        found = fitting(recording.pieces(), camera, known_m, AT)
        assert fits(found) == {described(name).samples.phases_deg}
        (described_way,) = [way for way in found if way.described]
        assert described_way.fits == (told == name)
        (right,) = [way for way in found if way.fits]
        assert abs(right.off_m) < 4 * right.noise_m + 1e-4
        # Of 24 orders only those in which opposite planes are opposite can be.
        assert sum(way.consistent for way in found) == 8
        lines = labelling_lines(found, known_m, AT)
        assert lines[-1] == "one order fits"
        assert sum("as described" in line for line in lines) == 1


def test_several_orders_fit_where_the_phase_is_a_multiple_of_45_degrees(tmp_path):
    known_m = 0.125 * unambiguous_range_m(60e6)
    recording, camera = recorded(tmp_path, "mlx75027", [60e6], known_m, noise=4)
    found = fitting(recording.pieces(), camera, known_m, AT)
    # 45 degrees: cosine and sine are equal, so that each may be the other, and so may their
    # opposites.
    orders = {(0, 180, 90, 270), (90, 270, 0, 180), (0, 270, 90, 180), (90, 180, 0, 270)}
    assert fits(found) == orders
    told = labelling_lines(found, known_m, AT)[-1]
    assert "4 orders fit; one distance does not tell them apart" in told


def test_a_second_frequency_tells_orders_apart(tmp_path):
    known_m = 0.125 * unambiguous_range_m(60e6)
    path = small_camera(tmp_path, "mlx75027", frequencies_hz=[60e6, 25e6])
    recording, camera = recorded(tmp_path, "mlx75027", [60e6, 25e6], known_m, camera=path, noise=4)
    assert fits(fitting(recording.pieces(), camera, known_m, AT)) == {(0, 180, 90, 270)}


def test_none_fits_a_wrong_distance(tmp_path):
    range_m = unambiguous_range_m(60e6)
    recording, camera = recorded(tmp_path, "mlx75027", [60e6], 0.30 * range_m, noise=4)
    found = fitting(recording.pieces(), camera, 0.35 * range_m, AT)
    assert fits(found) == set()
    assert "none fits" in labelling_lines(found, 0.35 * range_m, AT)[-1]
    # Modulo the unambiguous range distances are the same.
    assert fits(fitting(recording.pieces(), camera, 3.30 * range_m, AT))


def test_three_phases_and_phasors_have_their_own_orders(tmp_path):
    assert len(labellings(described("kinect_v2_dump"))) == 12
    assert len(labellings(described("phasor_video"))) == 8
    known_m = 0.30 * unambiguous_range_m(30e6)
    stored = planes("phasor_video", [np.full(SIZE, known_m)] * 3, [30e6], amplitude=2.0, noise=0.02)
    np.save(tmp_path / "a.npy", np.moveaxis(-stored[:, 0], 1, -1))
    camera = described("phasor_video")
    found = fitting(open_camera_recording(tmp_path / "a.npy", camera).pieces(), camera, known_m, AT)
    assert fits(found) == {(180, 270)}
    layout, hz = {"height": SIZE[0], "width": SIZE[1]}, [80e6, 16e6, 120e6]
    path = small_camera(tmp_path, "kinect_v2_dump", layout=layout)
    stored = whole(planes("kinect_v2", [np.full(SIZE, 1.3)], hz, offset=40, noise=3))
    stored.reshape(9, *SIZE).transpose(1, 2, 0).astype("<i4").tofile(tmp_path / "a.bin")
    camera = described(path)
    found = fitting(open_camera_recording(tmp_path / "a.bin", camera).pieces(), camera, 1.3, AT)
    assert fits(found) == {camera.samples.phases_deg}


@pytest.mark.parametrize(
    ("known_m", "at", "changed", "says"),
    [
        (0.0, AT, lambda frames: frames, "known_distance is 0"),
        (1.0, (12, 0), lambda frames: frames, "at is 12,0; expected a pixel of 12 x 16"),
        (1.0, AT, lambda frames: frames * 0 + 2047, "all pixels there are saturated"),
        (1.0, AT, lambda frames: frames * 0, "too little to tell a distance by"),
    ],
)
def test_what_tells_nothing_is_refused(tmp_path, known_m, at, changed, says):
    stored = whole(planes("mlx75027", [np.full(SIZE, 1.0)], [60e6]))[:, 0].astype(np.int16)
    np.save(tmp_path / "a.npy", changed(stored))
    camera = described("mlx75027")
    recording = open_camera_recording(tmp_path / "a.npy", camera)
    with pytest.raises(ValueError, match=says):
        fitting(recording.pieces(), camera, known_m, at)
