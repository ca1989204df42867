"""The page: every promise, with the tests that hold it in each run of CI and what was measured."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import Any

from reliability.rows import ROOT, Row, file_of, kept

PAGE = ROOT / "docs" / "reliability.md"
FOLDER = ROOT / "reliability"


@dataclass(frozen=True)
class Promise:
    """What must not break: in a word, in a sentence, and test files (or folders) that hold it."""

    name: str
    words: str
    tests: tuple[str, ...] = ()


PROMISES = {
    1: Promise(
        "Every registered environment conforms",
        "The checkers of Gymnasium and stable-baselines3 pass with warnings as errors; observations share no memory, no element of them is constant over "
        "episodes, starts are random, the spec goes through JSON and pickle.",
        ("tests/contract/test_registered.py", "tests/contract/test_front_doors.py"),
    ),
    2: Promise(
        "Same seed, same numbers",
        "Not one bit differs between two environments over 500 steps through auto-resets, between fresh processes with other hash seeds and numbers of "
        "threads, and between an environment alone and in a vector of any size.",
        (
            "tests/reliability/test_determinism.py",
            "tests/shotenv/env/test_env.py",
            "tests/shotenv/sensor/test_normals.py",
            "tests/shotenv/laser/test_laser.py",
            "tests/unwrap/support/test_kept_code.py",
        ),
    ),
    3: Promise(
        "The physics is right",
        "Phase, fall-off of light, wiggle, motion and multi-path are checked against closed forms, and rendered multi-path against an independent "
        "transient renderer; [each effect with its figure](physics.md).",
        ("tests/physics", "tests/shotenv/render/test_render.py"),
    ),
    4: Promise(
        "The noise is right",
        "Mean and variance follow the photon-transfer curve at ten light levels, and the standard deviation of depth its formula.",
        ("tests/physics/test_sensor_physics.py",),
    ),
    5: Promise(
        "The fast path is the slow reference",
        "Compiled loops give what plain ones in Python and array operations give.",
        (
            "tests/shotenv/sensor/test_compiled.py",
            "tests/unwrap/depth/test_merge.py",
            "tests/unwrap/signal/test_decoding.py",
        ),
    ),
    6: Promise(
        "Bad input is refused",
        "A wrong kind, shape, unit, key or action, NaN, infinity, negative or empty input raises a ValueError or TypeError that names it.",
        (
            "tests/shotenv/sensor/test_sensor.py",
            "tests/shotenv/config/test_env_config.py",
            "tests/shotenv/env/test_reset_options.py",
            "tests/contract/test_public_arguments.py",
            "tests/reliability/test_extreme_numbers.py",
            "tests/agents/cli/test_outputs.py",
        ),
    ),
    7: Promise(
        "Hostile and damaged files are refused",
        "No code of a file is executed, nothing hangs or fills the memory, and the error names the file.",
        (
            "tests/shotenv/config/test_yaml_limits.py",
            "tests/shotenv/bank/test_bank.py",
            "tests/shotenv/bank/test_thinned.py",
            "tests/agents/policies/test_foreign_zips.py",
            "tests/agents/policies/test_scheduler_files.py",
            "tests/reliability/test_hostile_files.py",
            "tests/shotenv/scenes/test_mesh_refusals.py",
            "tests/shotenv/scenes/test_mitsuba_refusals.py",
            "tests/unwrap/cameras/files/test_bad_recordings.py",
        ),
    ),
    8: Promise(
        "A killed run loses at most one interval",
        "Killed at any moment and started again, a run ends as one that was left alone; nothing half-written has a final name.",
        (
            "tests/shotenv/bank/test_bank_rendering.py",
            "tests/agents/training/test_training.py",
            "tests/agents/training/test_q_learning.py",
            "tests/agents/training/test_recurrent_ppo.py",
            "tests/agents/training/test_regression.py",
            "tests/unwrap/training/test_training_loop.py",
            "tests/unwrap/support/test_whole_files.py",
        ),
    ),
    9: Promise(
        "Long runs stay flat",
        "A million steps grow memory by at most 10 MB and a hundred thousand rendered frames that of the parent by at most 50 MB, with no new file descriptors "
        "(rendering: one at most, while a worker is replaced) and steps at most 15 % slower.",
    ),
    10: Promise(
        "A dead or stuck worker is named within 10 s",
        "Killed, stopped or raising: the parent says which, leaves no process behind and does not hang.",
        (
            "tests/unwrap/execution/test_processes.py",
            "tests/agents/study/test_study.py",
            "tests/unwrap/support/test_workers.py",
        ),
    ),
    11: Promise(
        "Any surroundings work, or a sentence says what to do",
        "Any order of imports, spawn and forkserver, one core, no LLVM or the wrong one, a full disk, a cache that cannot be written, odd paths, no home folder.",
        ("tests/shotenv/render/test_render.py", "tests/agents/cli/test_doctor.py"),
    ),
    12: Promise(
        "Processor and GPU agree",
        "Measured on an NVIDIA H100 on 26 November 2026 ([all of it](../CHANGELOG.md#measured-once)): distances within 4e-6 m where the prediction is the same. "
        "Networks compute in bfloat16 on both and round differently, so that the merged wrap is the same for 99.94 to 99.97 % of the pixels: not the 99.99 % "
        "that were aimed at. Continuous integration has no GPU.",
    ),
    13: Promise(
        "What was made for one sensor is refused by another",
        "Every field of sensor, laser, camera and frame rate is applied when a frame is acquired, or compared; a test walks over all fields.",
        (
            "tests/shotenv/bank/test_compatibility.py",
            "tests/shotenv/recorded/test_imported_bank.py",
        ),
    ),
    14: Promise(
        "Intervals are honest",
        "Policies are compared over clips as clusters, and a known difference lies within a 95 % interval in about 95 % of repetitions.",
        (
            "tests/agents/evaluation/test_statistics.py",
            "tests/agents/study/test_study_statistics.py",
        ),
    ),
    15: Promise(
        "Nothing is skipped",
        "In continuous integration a test that is skipped has failed.",
        ("tests/architecture/test_no_skips.py",),
    ),
}


def is_measurement(text: str) -> bool:
    """Whether a source has a function `measure` of its own."""
    return any(isinstance(n, ast.FunctionDef) and n.name == "measure" for n in ast.parse(text).body)


MEASUREMENTS = tuple(
    path.stem for path in sorted(FOLDER.glob("*.py")) if is_measurement(path.read_text("utf-8"))
)


def figure(value: Any) -> str:
    """A measured value as the page has it."""
    if isinstance(value, list):
        return ", ".join(figure(one) for one in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def row_line(name: str, row: Row) -> str:
    found = "; ".join(f"{what}: {figure(value)}" for what, value in row.found.items())
    verdict = "yes" if row.holds else "**no**"
    return f"| `{name}` | {row.done} | {found} | {verdict} | {row.seconds:.0f} s |"


def purpose(name: str) -> str:
    """First line of a measurement's docstring."""
    words = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text("utf-8"))) or ""
    return words.partition("\n")[0]


def section(number: int, rows: list[tuple[str, Row]]) -> list[str]:
    """Lines of one promise."""
    promise = PROMISES[number]
    lines = [f"## {number}. {promise.name}", "", promise.words]
    if promise.tests:
        lines += ["", "Held in every run by " + ", ".join(f"`{t}`" for t in promise.tests) + "."]
    if rows:
        lines += [
            "",
            "| measured by | what was done | found | holds | took |",
            "|---|---|---|---|---|",
        ]
        lines += [row_line(name, row) for name, row in rows]
    return [*lines, ""]


def page() -> str:
    """All of it, from the table here and the files of the measurements."""
    # One whose module was taken away stays in its file, but not on the page.
    told = {name: kept(name) for name in MEASUREMENTS if file_of(name).is_file()}
    rows = [(name, row) for name, one in told.items() for row in one["rows"]]
    lines = [
        "# What must not break, and how that is shown",
        "",
        "Each promise is held by tests that run in continuous integration, or was measured by a command that takes too long for that, or both; what needs a GPU",
        "(12) was measured once. `make reliability` takes the measurements that have no file yet and writes this page; `python -m reliability NAME` takes one anew, `--quick` tries it at a small size.",
        "",
    ]
    for number in PROMISES:
        lines += section(number, [(name, row) for name, row in rows if row.promise == number])
    lines += [
        "## The measurements",
        "",
        "| `python -m reliability` ... | what | took | on | measured |",
        "|---|---|---|---|---|",
    ]
    for name, one in told.items():
        where = f"{one['machine']['cores']} cores, {one['machine']['processor']}"
        took = f"{one['seconds'] / 60:.1f} min"
        lines.append(f"| `{name}` | {purpose(name)} | {took} | {where} | {one['date']} |")
    return "\n".join(lines) + "\n"
