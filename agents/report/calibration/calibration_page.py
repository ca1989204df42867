"""The page of a camera's calibration: its numbers beside those of its kind, and the plots."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agents.report import figure_html, page_of
from agents.report.calibration.calibration_charts import charts_of
from shotenv.config import SensorConfig
from unwrap.calibration import CONFIDENCE, BenchConfig, Calibration, interval_text, number_text
from unwrap.support import write_text

PAGE = Path(__file__).with_name("calibration.html.jinja")
TITLES = {
    "gain_lsb_per_e": "gain of the converter",
    "contrast": "demodulation contrast",
    "read_noise_e": "read noise of a tap",
    "full_well_e": "full well of a tap",
    "offset_std_lsb": "offset pattern, standard deviation",
    "offset_row_share": "share of its variance common to a row",
    "offset_ambient_lsb": "offset by ambient light that fills the taps",
    "offset_drift_lsb_per_k": "change of the pattern, standard deviation",
    "harmonic_strength": "strength of the overtones (1: squares)",
    "distance_drift_m_per_k": "drift of distance",
    "distance_offset_m": "distances too long, all frequencies",
}


def write_calibration_page(
    path: Path,
    bench: BenchConfig,
    found: Calibration,
    base: SensorConfig,
    units: Mapping[str, str],
    refused: Mapping[str, str],
    described: Mapping[str, str],
) -> None:
    """Write the page, self-contained.

    Parameters
    ----------
    path : Path
    bench : BenchConfig
        What is known of the recordings.
    found : Calibration
    base : SensorConfig
        Of the kind of camera, which serves where nothing was measured.
    units : mapping of str to str
        Of the sensor's fields, in the order of the table.
    refused : mapping of str to str
        Fields that the simulation cannot hold, and why.
    described : mapping of str to str
        Fields that the camera's description tells otherwise than the kind of camera.
    """
    rows = rows_of(found, base, units, refused)
    text = page_of(
        PAGE,
        bench=bench,
        base=base.name,
        described=described,
        rows=rows,
        measured=sum(row["measured"] for row in rows),
        missing=wanted(found),
        recordings=[
            # What the recording itself tells stands in its setting.
            {"frames": moments.frames, **row.model_dump(), **vars(moments.setting)}
            for row, moments in zip(bench.recordings, found.recordings, strict=True)
        ],
        tables=[f"{hz / 1e6:g} MHz" for hz in found.tables],
        frequencies=[f"{hz / 1e6:g} MHz" for hz in found.assumed.frequencies_hz],
        confidence=f"{100 * CONFIDENCE:g} %",
        charts=[
            {"title": title, "note": note, "figure": figure_html(figure)}
            for title, note, figure in charts_of(found)
        ],
    )
    write_text(path, text)


def rows_of(
    found: Calibration,
    base: SensorConfig,
    units: Mapping[str, str],
    refused: Mapping[str, str],
) -> list[dict[str, Any]]:
    """Rows of the table: numbers of the sensor, then the delay at all and at each frequency."""
    delays = [name for name in found.numbers if name.startswith("distance_offset_m at ")]
    rows = []
    for name in (*units, "distance_offset_m", *delays):
        number = found.numbers.get(name)
        note = f"given {found.leaning[name]} of {base.name}" if name in found.leaning else ""
        title = TITLES.get(name) or name.replace("distance_offset_m", "the same")
        kind_value = getattr(base, name, None)
        rows.append(
            {
                "title": title,
                "name": name if name in units else "",
                "unit": units.get(name, "m"),
                "value": "" if number is None else number_text(number),
                "interval": "" if number is None else interval_text(number),
                "base": "" if kind_value is None else f"{kind_value:g}",
                "note": f"not written: {refused[name]}" if name in refused else note,
                "measured": number is not None,
            }
        )
    return rows


def wanted(found: Calibration) -> list[tuple[str, str]]:
    """What to record, and the numbers that it would tell."""
    by_recording: dict[str, list[str]] = {}
    for name, what in found.missing.items():
        by_recording.setdefault(what, []).append(TITLES[name])
    return [(what, "; ".join(names)) for what, names in by_recording.items()]
