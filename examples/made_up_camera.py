"""Make up what comes out of the box of a camera: recordings, in its own format.

    python examples/made_up_camera.py box [--camera mlx75027] [--seed 1]

The folder then has, as whoever measures a real camera would have,

camera.yaml   a description of one's own: the shipped one with a small image and its lens
wall.*        a still wall at 1.5 m, to try the order and sign of the samples
bench/        recordings to calibrate by, and calibration.yaml
drives/       drives through a scene with their true distances, and recordings.yaml
sensor.yaml   an imager of the camera's frequencies, before anything is measured
hidden.yaml   what nobody knows of a real camera: its true numbers

The camera is simulated, by `calibration_recordings.py` beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from calibration_recordings import (
    FOV_DEG,
    INTEGRATION_S,
    ROOM_K,
    Camera,
    Scene,
    bench,
    hidden_camera,
    record,
)

from shotenv.config import SensorConfig, find_config, merged, read_config
from unwrap.cameras import CameraFrames
from unwrap.cameras.files import CameraDescription
from unwrap.cameras.writing import WrittenFiles, container_of, write_camera_recording
from unwrap.signal import joint_range_m, unambiguous_range_m

TWO_HZ = (24e6, 10e6)
"""Where a camera may choose, it takes these: networks here are trained at 24 MHz."""
WALL_M, LASER_W, FRAME_RATE_HZ = 1.5, 3.0, 10.0
FLOOR_M, START_M, SPEED_M_S = 1.0, 7.0, 0.8
"""Height of the camera in a drive, its distance from the wall, and its speed."""


def main(
    folder: Path,
    name: str,
    seed: int = 1,
    *,
    drives: int = 6,
    frames: int = 33,
    size: tuple[int, int] = (24, 32),
) -> None:
    """Write everything; `frames` are those of a drive."""
    folder.mkdir(parents=True)
    camera = write_description(folder / "camera.yaml", name, size)
    imager = hidden_imager(camera, seed, size)
    write_yaml(folder / "sensor.yaml", nominal_sensor(camera).model_dump(mode="json"))
    hidden = imager.sensor.model_dump(mode="json") | {"distance_offset_m": imager.delay_m}
    write_yaml(folder / "hidden.yaml", hidden)
    wall = still_wall(imager)
    write_camera_recording(folder, "wall", delivered(camera, imager, [wall], 900, 8)[0], camera)
    bench_rows = write_bench(folder / "bench", camera, imager)
    write_drives(folder / "drives", camera, imager, drives, frames)
    print(f"{folder}: a wall, {bench_rows} recordings of a bench and {drives} drives of {name}")


def write_description(path: Path, name: str, size: tuple[int, int]) -> CameraDescription:
    """Write the shipped description with this image and its field of view; it, as read."""
    about = yaml.safe_load(find_config("camera", name).read_text(encoding="utf-8"))
    about["lens"] = {"horizontal_fov_deg": FOV_DEG}
    if name == "mlx75027":
        about["frequencies_hz"] = list(TWO_HZ)
    if about["container"] in ("packed_raw12", "dump"):
        about["layout"] |= {"height": size[0], "width": size[1]}
    if about["container"] == "packed_raw12":
        about["layout"] |= {"row_bytes": 2 * size[1], "trailer_rows": 2}
    # Gray images come from the same converter.
    bits = about.get("words", {}).get("bits", 12)
    about.setdefault("passive", {})["highest"] = 2.0 ** min(bits, 12) - 1
    write_yaml(path, about)
    return read_config(CameraDescription, path)


def nominal_sensor(camera: CameraDescription) -> SensorConfig:
    """An epc660-class imager at the camera's frequencies; of one, f2 is what nobody asks for."""
    first_hz, *others = sorted(camera.frequencies_hz, reverse=True)
    f2_hz = others[-1] if others else TWO_HZ[1] / TWO_HZ[0] * first_hz
    bits = 12 if camera.words.real else min(camera.words.bits, 12)
    base = read_config(SensorConfig, find_config("sensor", "epc660"))
    return merged(
        base,
        {
            "f1_hz": first_hz,
            "f2_hz": f2_hz,
            "saturation_range_m": 0.99 * unambiguous_range_m(first_hz),
            "max_range_m": min(base.max_range_m, 0.999 * joint_range_m(first_hz, f2_hz)),
            "adc_bits": bits,
            "gain_lsb_per_e": base.gain_lsb_per_e * 2.0 ** (bits - 12),
        },
    )


def hidden_imager(camera: CameraDescription, seed: int, size: tuple[int, int]) -> Camera:
    """A simulated camera of the described kind, whose numbers nobody knows."""
    found, kind = hidden_camera(seed, height=size[0], width=size[1]), nominal_sensor(camera)
    of_the_kind = ("f1_hz", "f2_hz", "saturation_range_m", "max_range_m", "adc_bits")
    changes: dict[str, Any] = {name: getattr(kind, name) for name in of_the_kind}
    # Edges soften as they come faster.
    changes["harmonic_strength"] = found.sensor.harmonic_strength * min(1.0, 24e6 / kind.f1_hz)
    changes["gain_lsb_per_e"] = found.sensor.gain_lsb_per_e * 2.0 ** (kind.adc_bits - 12)
    # Millimetres to centimetres off: more would look like another order at 120 MHz.
    return replace(found, sensor=merged(found.sensor, changes), delay_m=0.1 * found.delay_m)


def delivered(
    camera: CameraDescription, imager: Camera, scenes: Sequence[Scene], number: int, each: int = 1
) -> tuple[CameraFrames, list[float]]:
    """So many frames of each scene at all of the camera's frequencies, and gray exposures.

    `number` tells recordings apart.
    """
    first_hz, *others = sorted(camera.frequencies_hz, reverse=True)
    samples, flags, gray, exposures_s = [], [], [], []
    for frame, scene in enumerate(scenes):
        taken = []
        # Two frequencies at a time; a third is taken with the first once more.
        for second_hz in others or [imager.sensor.f2_hz]:
            # The range is no part of recording, and must not exceed that of the pair.
            changes = {"f2_hz": second_hz, "max_range_m": 1.0}
            pair = replace(imager, sensor=merged(imager.sensor, changes))
            raw, words, exposure_s = record(pair, scene, each, 1000 * number + frame)
            taken.append(raw)
        of_first = taken[0].dcs_lsb[:, None, :4]
        rest = [raw.dcs_lsb[:, None, 4:] for raw in taken] if others else []
        samples.append(torch.cat((of_first, *rest), 1))
        # Which sample was full is not told: each of the pixel's counts as such.
        full = torch.stack([raw.saturated for raw in taken]).any(0)
        flags.append(full[:, None, None].expand_as(samples[-1]))
        gray.append(words / (2.0**imager.sensor.adc_bits - 1))
        exposures_s += [exposure_s] * each
    count = len(exposures_s)
    frames = CameraFrames(
        samples_lsb=torch.cat(samples),
        saturated=torch.cat(flags)[:, 0, 0],
        saturated_samples=torch.cat(flags),
        gray=torch.cat(gray).float(),
        frequencies_hz=(first_hz, *others),
        made=False,
        names=tuple(f"{frame:05d}" for frame in range(count)),
        temperature_k=tuple(scene.temperature_k for scene in scenes for _ in range(each)),
        integration_s=(INTEGRATION_S,) * count,
        laser_power_w=(LASER_W,) * count,
        timestamp_s=tuple(frame / FRAME_RATE_HZ for frame in range(count)),
    )
    return frames, exposures_s


def still_wall(imager: Camera) -> Scene:
    """A wall that faces the camera."""
    most_e = imager.sensor.full_well_e
    light_e = 0.6 * most_e / imager.stretch**3
    return Scene(WALL_M * imager.stretch, light_e, torch.full_like(light_e, 0.02 * most_e))


def write_bench(folder: Path, camera: CameraDescription, imager: Camera) -> int:
    """Write the recordings of `calibration_recordings.bench`; how many there are."""
    folder.mkdir()
    rows = []
    for number, (known, scene, count) in enumerate(bench(imager)):
        frames, exposures_s = delivered(camera, imager, [scene], number, count)
        name = f"{number:02d}_{known['kind']}"
        written = write_camera_recording(folder, name, frames, camera)
        rows.append({**files_of(written), **known, "gray_exposure_s": exposures_s[0]})
    write_yaml(folder / "calibration.yaml", {"name": "made-up", "recordings": rows})
    return len(rows)


def write_drives(
    folder: Path, camera: CameraDescription, imager: Camera, drives: int, frames: int
) -> None:
    """Write drives towards a wall, each past a person; half of them to tune by, half to judge."""
    folder.mkdir()
    rows = []
    for number in range(drives):
        scenes = list(drive(imager, number, frames))
        taken, exposures_s = delivered(camera, imager, scenes, 1000 + number)
        written = write_camera_recording(folder, f"drive_{number}", taken, camera)
        row = files_of(written) | {"truth": f"drive_{number}_truth.npy"}
        truth_m = torch.stack([scene.distance_m for scene in scenes]).float().numpy()
        np.save(folder / row["truth"], truth_m)
        row["ego"] = f"drive_{number}_ego.csv"
        lines = [f"{SPEED_M_S},0.0,{exposure_s!r}" for exposure_s in exposures_s]
        head = "ego_speed_m_s,yaw_rate_rad_s,gray_exposure_s"
        (folder / row["ego"]).write_text("\n".join((head, *lines)) + "\n")
        row |= {"family": "corridor", "split": ("validation", "test")[number % 2]}
        known = {"laser_power_w": LASER_W, "integration_s": INTEGRATION_S, "temperature_k": ROOM_K}
        told = container_of(camera).tells  # by the recording itself
        row |= {name: value for name, value in known.items() if name not in told}
        rows.append(row)
    about = {"name": "made-up", "frame_rate_hz": FRAME_RATE_HZ, "recordings": rows}
    write_yaml(folder / "recordings.yaml", about)


def drive(imager: Camera, number: int, frames: int) -> Iterable[Scene]:
    """Frames of a drive along a floor, towards a wall, past a person who crosses."""
    draw = np.random.default_rng((imager.seed, number))
    sun, side = 10 ** draw.uniform(-3.0, -0.5), draw.choice((-1.0, 1.0))
    most_e = 2 * imager.sensor.full_well_e
    height, width = imager.height, imager.width
    focal = width / 2 / np.tan(np.radians(FOV_DEG) / 2)
    right = ((torch.arange(width) - (width - 1) / 2) / focal).expand(height, width)
    down = ((torch.arange(height) - (height - 1) / 2) / focal)[:, None].expand(height, width)
    for frame in range(frames):
        gone_m = SPEED_M_S * frame / FRAME_RATE_HZ
        wall_m, person_m = START_M - gone_m, 4.0 - 0.5 * gone_m
        floor_m = torch.where(down > 0, FLOOR_M / down.clamp(min=1e-6), torch.inf)
        ahead_m = floor_m.clamp(max=wall_m)
        tiles = torch.floor(right * floor_m / 0.5) + torch.floor((floor_m + gone_m) / 0.5)
        albedo = torch.where(floor_m < wall_m, 0.2 + 0.2 * (tiles % 2), 0.4)
        beside_m = right * person_m - side * (1.5 - 0.1 * frame)
        person = (beside_m.abs() < 0.3) & (down * person_m > -0.6) & (floor_m > person_m)
        ahead_m = torch.where(person, person_m, ahead_m)
        albedo = torch.where(person, 0.6, albedo).double()
        distance_m = ahead_m * imager.stretch
        # Full at 1 m where the albedo is 1; the light of the room, or of the sun, beside it.
        signal_e = most_e * albedo / distance_m.clamp(min=0.5) ** 2
        yield Scene(distance_m, signal_e, sun * most_e * albedo)


def files_of(written: WrittenFiles) -> dict[str, Any]:
    """Files of a recording as its row names them."""
    row = {"file": written.recording.name}
    return row if written.gray is None else row | {"gray": written.gray.name}


def write_yaml(path: Path, value: Any) -> None:
    """Write plain values, keys in their order."""
    path.write_text(yaml.safe_dump(value, sort_keys=False), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--camera", default="mlx75027", help="name of a shipped description")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    main(arguments.folder, arguments.camera, arguments.seed)
