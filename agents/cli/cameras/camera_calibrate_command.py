"""The command that measures a camera by its recordings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jsonargparse import ArgumentParser, Namespace

from agents.cli.cameras.camera_commands import read_camera
from agents.cli.command import DONE, Command, add_json, write_numbers
from shotenv.config import ConfigError, SensorConfig, find_config, merged, read_config
from unwrap.signal import joint_range_m
from unwrap.support import progress, write_bytes, write_text

if TYPE_CHECKING:
    from unwrap.calibration import Assumed, Calibration
    from unwrap.cameras.files import CameraDescription

UNITS = {
    "gain_lsb_per_e": "LSB/e",
    "contrast": "",
    "read_noise_e": "e",
    "full_well_e": "e",
    "offset_std_lsb": "LSB",
    "offset_row_share": "",
    "offset_ambient_lsb": "LSB",
    "offset_drift_lsb_per_k": "LSB/K",
    "harmonic_strength": "",
    "distance_drift_m_per_k": "m/K",
}
"""Fields of the sensor that recordings tell, in the order of the table."""


def calibrate_arguments(parser: ArgumentParser) -> None:
    """Which recordings, of which kind of camera, and where its numbers go."""
    parser.add_argument("folder", type=Path, help="folder with calibration.yaml and its recordings")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.yaml")
    parser.add_argument(
        "--sensor",
        default="epc660",
        help="name or path of a sensor configuration: frequencies, bits, and what is not measured",
    )
    parser.add_argument(
        "--camera",
        metavar="NAME",
        help="name or path of the camera's description, which tells how to read its recordings, "
        "its frequencies, bits and lens; without it .npz, .npy or folders of PNG files",
    )
    add_json(parser)


def calibrate(arguments: Namespace) -> int:
    """Measure a camera; write its sensor file, tables, dark-offset map and page."""
    from agents.report.calibration import write_calibration_page
    from unwrap.calibration import (
        BENCH_FILE,
        BenchConfig,
        calibrate_camera,
        read_bench,
        sensor_text,
        stretch_of,
    )
    from unwrap.cameras import rays_of
    from unwrap.signal import write_wiggle

    if arguments.out.suffix != ".yaml":
        raise ConfigError(f"out is {arguments.out}; expected a file that ends in .yaml")
    base_path = find_config("sensor", arguments.sensor)
    kind = read_config(SensorConfig, base_path)
    config = read_config(BenchConfig, arguments.folder / BENCH_FILE)
    camera, lens_folder = None, Path()
    if arguments.camera is not None:
        camera, lens_folder = read_camera(arguments.camera)
    with progress(len(config.recordings), "reading", "recording") as bar:
        bench = read_bench(
            config, arguments.folder, bits=kind.adc_bits, camera=camera, tick=bar.update
        )
    base, described = kind, dict[str, str]()
    if camera is None:
        stretch = stretch_of(bench.shape, config.horizontal_fov_deg)
    else:
        assert bench.frequencies_hz is not None  # A description tells them.
        base, described = as_described(kind, camera, bench.frequencies_hz)
        ahead = rays_of(camera.lens, bench.shape, lens_folder)[0]
        stretch = (1.0 / ahead).flatten().numpy()
    assumed = assumed_of(base, frequencies=len(bench.recordings[0].mean_lsb))
    found = calibrate_camera(bench.recordings, bench.shape, stretch, assumed)
    held, refused = held_by_simulation(base, found)

    files = {
        what: arguments.out.with_suffix(suffix)
        for what, suffix in (
            ("wiggle", ".wiggle.json"),
            ("offset", ".offset.npy"),
            ("page", ".html"),
        )
    }
    text = sensor_text(
        base_path.read_text(encoding="utf-8"), base.name, config.name, found, held, described
    )
    if found.tables:
        write_wiggle(files["wiggle"], found.tables)
    if found.offset_lsb is not None:
        write_bytes(files["offset"], npy_bytes(found.offset_lsb))
    write_calibration_page(files["page"], config, found, base, UNITS, refused, described)
    write_text(arguments.out, text)
    read_config(SensorConfig, arguments.out)  # as whoever simulates with it will
    for name, told in described.items():
        print(f"{name:24}{told}")
    tell(found, refused)
    print(f"{arguments.out}: a sensor to simulate; {files['page']}: its page")
    write_numbers(arguments, numbers_of(found, refused))
    return DONE


def as_described(
    kind: SensorConfig, camera: CameraDescription, frequencies_hz: tuple[float, ...]
) -> tuple[SensorConfig, dict[str, str]]:
    """The kind of sensor with the camera's frequencies and bits, and the fields that differ.

    These as what follows their colon in a YAML file, with what they stand in place of. The range of
    trusted wrapped distances follows the frequency; what is unwrapped ends with the joint range.

    Raises
    ------
    ConfigError
        The sensor cannot have these frequencies; the message names camera and sensor.
    """
    told: dict[str, float] = dict(zip(("f1_hz", "f2_hz"), frequencies_hz, strict=False))
    if not camera.words.real:
        told["adc_bits"] = camera.words.bits
    f1_hz, f2_hz = told["f1_hz"], told.get("f2_hz", kind.f2_hz)
    if f2_hz >= f1_hz:
        raise ConfigError(
            f"sensor {kind.name} has f2_hz = {f2_hz:g} and {camera.name} records at {f1_hz:g} Hz; "
            "expected a --sensor whose f2_hz is less"
        )
    ends = {
        # The same share of a wrap: what is almost a whole one may be none.
        "saturation_range_m": round(kind.saturation_range_m * kind.f1_hz / f1_hz, 4),
        # To a tenth of a millimetre, downwards: beyond the joint range is refused.
        "max_range_m": min(kind.max_range_m, math.floor(1e4 * joint_range_m(f1_hz, f2_hz)) / 1e4),
    }
    told |= ends
    changed = {name: value for name, value in told.items() if getattr(kind, name) != value}
    lines = {}
    for name, value in changed.items():
        source = f"[described] by the frequencies of {camera.name}"
        if name not in ends:
            source = f"[described] of {camera.name}"
        lines[name] = f"{number_of(value)}  # {source}; {kind.name} has {getattr(kind, name):g}"
    return merged(kind, changed), lines


def number_of(value: float) -> str:
    """A number as YAML has it: `100.0e+6` and not `1e+08`, which YAML 1.1 takes for a word."""
    return f"{value / 1e6!r}e+6" if value >= 1e6 else f"{value:g}"


def assumed_of(base: SensorConfig, *, frequencies: int) -> Assumed:
    """What the kind of camera tells where recordings do not; four samples are at f1 alone."""
    from unwrap.calibration import Assumed

    return Assumed(
        frequencies_hz=(base.f1_hz, base.f2_hz)[:frequencies],
        bits=base.adc_bits,
        contrast=base.contrast,
        gain_lsb_per_e=base.gain_lsb_per_e,
        full_well_e=base.full_well_e,
        harmonic_strength=base.harmonic_strength,
        highest_harmonic=base.highest_harmonic,
    )


def held_by_simulation(
    base: SensorConfig, found: Calibration
) -> tuple[dict[str, str], dict[str, str]]:
    """Measured fields that the simulation can hold, with their units, and why it holds others not.

    A drift towards the camera, or more demodulated than there is light, is no legal sensor.
    """
    held, refused, sensor = {}, {}, base
    for name, unit in UNITS.items():
        if name not in found.numbers:
            continue
        try:
            sensor = merged(sensor, {name: found.numbers[name].value})
            held[name] = unit
        except ConfigError as error:
            refused[name] = str(error)
    return held, refused


def npy_bytes(values: np.ndarray) -> bytes:
    """An array as the content of an `.npy` file."""
    from io import BytesIO

    content = BytesIO()
    np.save(content, values.astype(np.float32), allow_pickle=False)
    return content.getvalue()


def tell(found: Calibration, refused: dict[str, str]) -> None:
    """One line for each number."""
    for name, unit in {**UNITS, "distance_offset_m": "m"}.items():
        told = str(found.numbers[name]) if name in found.numbers else "not measured"
        note = f"  given {found.leaning[name]}" if name in found.leaning else ""
        note = f"  not written: {refused[name]}" if name in refused else note
        note = f"  record {found.missing[name]}" if name in found.missing else note
        print(f"{name:24}{told} {unit}{note}")


def numbers_of(found: Calibration, refused: dict[str, str]) -> dict[str, Any]:
    """All of it as plain values."""
    from dataclasses import asdict

    return {
        "numbers": {name: asdict(number) for name, number in found.numbers.items()},
        "leaning": found.leaning,
        "missing": found.missing,
        "refused": refused,
    }


CALIBRATE = Command(
    "camera calibrate",
    "measure a camera by its recordings: a sensor to simulate, and a page",
    calibrate_arguments,
    calibrate,
    out_is_file=True,
)
