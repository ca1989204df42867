"""What comes from cameras and from elsewhere: files of each kind, and what reads them.

The helpers that write them are those of the tests; `hostile_kinds` says where they lie.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np


def wiggle(folder: Path) -> Path:
    from unwrap.signal.shots import harmonic_weights
    from unwrap.signal.wiggle import wiggle_of, write_wiggle

    table = wiggle_of(harmonic_weights(1.0, 7))
    write_wiggle(folder / "wiggle.json", {24e6: table, 10e6: table})
    return folder / "wiggle.json"


def read_wiggle(path: Path) -> object:
    from unwrap.signal.wiggle import read_wiggle

    return read_wiggle(path)


def _samples() -> np.ndarray:
    return (2048 + 500 * np.random.default_rng(0).standard_normal((2, 4, 8, 12))).astype(np.uint16)


def recording(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path, dcs = folder / name, _samples()
        if path.suffix == ".npy":
            np.save(path, dcs)
        else:
            np.savez(path, dcs=dcs, gray=dcs[:, 0])
        return path

    return make


def read_recording(path: Path) -> object:
    from unwrap.recordings import load_recording

    return load_recording(path, unwrapped=path.suffix == ".npz")


def picture(folder: Path) -> Path:
    from PIL import Image

    for number in range(4):
        Image.fromarray(_samples()[0, number]).save(folder / f"dcs_{number}.png")
    return folder / "dcs_2.png"


def read_pictures(path: Path) -> object:
    from unwrap.recordings import load_recording

    return load_recording(path.parent, unwrapped=False)


def rays(folder: Path) -> Path:
    rays = np.random.default_rng(0).standard_normal((6, 8, 3))
    np.save(folder / "rays.npy", rays / np.linalg.norm(rays, axis=-1, keepdims=True))
    return folder / "rays.npy"


def read_rays(path: Path) -> object:
    from unwrap.cameras.pixel_rays import _table

    return _table(path, (6, 8))


def truth(folder: Path) -> Path:
    np.save(folder / "truth.npy", np.full((2, 6, 8), 3.0, np.float32))
    return folder / "truth.npy"


def read_truth(path: Path) -> object:
    from shotenv.recorded.frame_tables import read_truth

    return read_truth(path, (2, 6, 8))


LAYOUT = {"height": 16, "width": 24, "row_bytes": 40, "trailer_rows": 3}
DISTANCES = [np.full((16, 24), metres) for metres in (1.5, 2.5)]


def camera(camera: str, name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        import camera_files as files

        path, frequencies_hz = folder / name, {"arducam_b0548": (90e6, 15e6)}.get(camera, (24e6,))
        if camera == "kinect_v2":
            frames = 100 * np.random.default_rng(0).standard_normal((1, 9, *files.KINECT_SIZE))
            files.write_kinect(path, frames)
            return path
        family = "arducam_b0548" if camera == "arducam_b0548" else "epc660"
        planes = files.whole(files.planes(family, DISTANCES, frequencies_hz))
        if camera == "arducam_b0548":
            files.small_camera(folder, camera, layout=LAYOUT)
            trailer = bytes(LAYOUT["trailer_rows"] * LAYOUT["row_bytes"])
            files.write_raw12(path, planes, row_bytes=LAYOUT["row_bytes"], trailer=trailer)
        elif camera == "epc660_wire":
            files.write_wire(path, planes[:, 0])
        else:
            files.write_espros(path, planes[:, 0])
        return path

    return make


def read_camera(camera: str) -> Callable[[Path], object]:
    def read(path: Path) -> object:
        from agents.cli.cameras import read_camera
        from unwrap.cameras import open_camera_recording

        small = path.parent / f"{camera}_small.yaml"
        described, _ = read_camera(str(small) if small.is_file() else camera)
        return list(open_camera_recording(path, described).pieces())

    return read


def scene(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from scene_files import write_mesh, write_obj

        corners = np.random.default_rng(0).random((12, 3, 3)) + np.arange(12)[:, None, None]
        path = folder / name
        return write_obj(path, corners) if path.suffix == ".obj" else write_mesh(path, corners)

    return make


def xml(folder: Path) -> Path:
    from scene_files import write_xml

    shade = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.4"/></bsdf>'
    return write_xml(folder / "scene.xml", f'<shape type="rectangle">{shade}</shape>' * 3)


def read_scene(path: Path) -> object:
    from scene_files import scene_config

    from shotenv.scenes.scene_worlds import read_scene

    return read_scene(scene_config(path))
