"""A sensor's configuration with the measured numbers in place, each with its interval."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from unwrap.calibration.camera_numbers import Calibration
from unwrap.calibration.intervals import CONFIDENCE, Estimate, significant

FIELD = re.compile(r"^(\w+):\s*([^#\n]*?)\s*(#.*)?$")
"""A field of a sensor's YAML file, which is flat: name, value and comment."""


def sensor_text(
    base_text: str,
    base_name: str,
    name: str,
    calibration: Calibration,
    fields: Mapping[str, str],
    described: Mapping[str, str] | None = None,
) -> str:
    """Text of a sensor's YAML file: that of its kind, measured numbers in place.

    What was not measured keeps its line, value and mark.

    Parameters
    ----------
    base_text, base_name : str
        Text and name of the file that serves where nothing was measured.
    name : str
        Of the camera.
    calibration : Calibration
    fields : mapping of str to str
        The numbers to write, and their units.
    described : mapping of str to str
        Fields that the camera's description tells otherwise than the base, each with what follows
        its colon.
    """
    written = {n: f"{n}: {told}" for n, told in (described or {}).items()}
    written |= {n: measured_line(n, fields[n], calibration) for n in fields}
    written["name"] = f"name: {name}"
    if calibration.temperature_k is not None:
        written["calibration_temperature_k"] = (
            f"calibration_temperature_k: {calibration.temperature_k:g}  # K [told] of the "
            "recordings in the dark and of the wall"
        )
    lines = list(_header(name, base_name, calibration))
    if described:
        lines.append("# [described]: told by the camera's description, in place of what is named.")
    for line in base_text.splitlines():
        found = FIELD.match(line)
        lines.append(written.pop(found[1], line) if found else line)
    # Fields that the base leaves to their defaults.
    return "\n".join((*lines, *written.values())) + "\n"


def measured_line(name: str, unit: str, calibration: Calibration) -> str:
    """`name: value  # unit [measured] interval`."""
    estimate = calibration.numbers[name]
    note = f"{unit} [measured] {interval_text(estimate)}".strip()
    if name in calibration.leaning:
        note += f", given {calibration.leaning[name]}"
    return f"{name}: {number_text(estimate)}  # {note}"


def number_text(estimate: Estimate) -> str:
    """The number with one digit more than its interval tells."""
    return f"{estimate.value:.{significant(estimate.high - estimate.low) + 1}f}"


def interval_text(estimate: Estimate) -> str:
    """`low to high`."""
    digits = significant(estimate.high - estimate.low)
    return f"{estimate.low:.{digits}f} to {estimate.high:.{digits}f}"


def _header(name: str, base_name: str, calibration: Calibration) -> Iterator[str]:
    """What the marks mean, and what no field of the file can say."""
    percent = f"{100 * CONFIDENCE:g} %"
    yield f"# {name}: [measured] by its own recordings, with {percent} intervals; what a number"
    yield "# leans on and was not measured is named (given ...). Lines with other marks are those"
    yield f"# of {base_name}, whose heading follows."
    delay = calibration.numbers.get("distance_offset_m")
    if delay is not None:
        yield f"# Distances are {number_text(delay)} m too long [measured] {interval_text(delay)}:"
        yield "# no field holds that; the measured wiggle tables take it away."
