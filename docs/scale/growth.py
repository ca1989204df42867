"""Commands of the product at several sizes: processor time, memory and disk of each run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

Point = dict[str, float]
"""`size`, `core_s` of all cores, `wall_s`, `memory_mb` of the largest process; some have more."""

RENDERED: Final = ((1, 1, 1), (2, 1, 1), (3, 1, 1))
"""Train, validation and test clips of each of five families, 24 frames of 160 x 120 each."""
FRAMES_PER_CLIP: Final = 24
OPENED: Final = (4_000, 20_000, 100_000, 500_000, 1_000_000)
"""Frames of banks that are opened, in clips of `LONG_CLIP`."""
LONG_CLIP: Final = 250
VECTOR: Final = 64
STEPS: Final = (1_024, 2_048, 4_096)
"""Steps of a vector of `VECTOR` drives on `pocket`."""
FULL_STEPS: Final = (64, 128, 256)
"""The same on every pixel."""
LEARNT: Final = (64, 128, 256)
"""Drives that the regression learns from."""
JUDGED: Final = (24, 192, 384)
"""Drives on which a scheduler is judged with all that stands beside it; to tune that takes longer
than to play some tens of them."""
FAMILIES: Final = ("cycle", "snr_threshold", "look_and_hold", "look_and_weigh")
BESIDE: Final = (0, 2, 4)
"""Of them, families of rules that are tuned and played beside it."""
PASSES: Final = 8
"""Passes of TofRegNet over the training frames of each rendered bank."""


@dataclass(frozen=True)
class Subject:
    """Something that grows.

    Attributes
    ----------
    what, unit : str
        What is done, and what its size counts.
    measure : callable
        Yields the points; its folder is that of all subjects, in their order.
    needs : str
        Name of a subject whose banks or schedulers it takes; empty: none.
    """

    what: str
    unit: str
    measure: Callable[[Path], Iterator[Point]]
    needs: str = ""


def shotenv(*words: object) -> list[str]:
    """A command of the product."""
    return [sys.executable, "-m", "agents.cli", *map(str, words)]


def python(code: str) -> list[str]:
    """Some lines of Python."""
    return [sys.executable, "-c", code]


def measured(size: float, command: Sequence[str], cache: Path) -> Point:
    """Run a command, on one thread each of its processes, and say what it took.

    Raises
    ------
    RuntimeError
        It failed; the message has the end of what it wrote.
    """
    env = {**os.environ, "SHOTENV_CACHE": str(cache), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryFile() as log:
        began = time.perf_counter()
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=env)
        # Of the process and of all that it waited for.
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            log.seek(0)
            raise RuntimeError(f"{' '.join(command)}: {log.read()[-2000:].decode()}")
    return {
        "size": size,
        "core_s": round(used.ru_utime + used.ru_stime, 2),
        "wall_s": round(time.perf_counter() - began, 2),
        "memory_mb": round(used.ru_maxrss / 1024, 1),
    }


def rendering(folder: Path) -> Iterator[Point]:
    """Banks of the configuration `starter` with more and more clips."""
    for clips in RENDERED:
        splits = zip(("train", "validation", "test", "shift"), (*clips, 0), strict=True)
        told = [f"--{split}_clips={count}" for split, count in splits]
        frames = 5 * sum(clips) * FRAMES_PER_CLIP
        name = f"--name={bank_name(clips)}"
        point = measured(frames, shotenv("render", name, *told), folder)
        disk = sum(p.stat().st_size for p in bank_of(folder, clips).rglob("*") if p.is_file())
        yield {**point, "disk_mb": round(disk / 1e6, 2)}


def bank_name(clips: Sequence[int]) -> str:
    """Name of the bank that `rendering` makes of so many clips."""
    return "grown-" + "-".join(map(str, clips))


def bank_of(folder: Path, clips: Sequence[int] = RENDERED[-1]) -> Path:
    """Its folder."""
    (bank,) = (folder / "banks").glob(f"{bank_name(clips)}-*")
    return bank


def opening(folder: Path) -> Iterator[Point]:
    """Banks of more and more frames, opened: their tables of contents are read and checked."""
    for frames in OPENED:
        bank = folder / f"listed-{frames}"
        # Not here: what this process once held, the system counts as held by all that it starts.
        measured(frames, python(listed(bank, frames)), folder)
        code = f"from shotenv import open_bank; assert len(open_bank({str(bank)!r})) == {frames}"
        yield measured(frames, python(code), folder)


def listed(bank: Path, frames: int) -> str:
    """Lines that make a bank of so many frames."""
    return (
        "import sys; from pathlib import Path\n"
        f"sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
        f"from scale.growth import list_frames; list_frames(Path({str(bank)!r}), {frames})"
    )


def list_frames(folder: Path, frames: int) -> None:
    """A bank of black frames of 16 x 16 pixels that takes next to no disk."""
    from shotenv.bank.files import ARRAYS, ClipRecord, write_manifest

    records = []
    for number in range(frames // LONG_CLIP):
        where = f"clips/{number:06d}"
        (folder / where).mkdir(parents=True)
        for name, spec in ARRAYS.items():
            shape = (LONG_CLIP, *spec.channels, 16, 16)
            with (folder / where / f"{name}.npy").open("wb") as file:
                header = {
                    "descr": np.lib.format.dtype_to_descr(np.dtype(spec.dtype)),
                    "fortran_order": False,
                    "shape": shape,
                }
                np.lib.format.write_array_header_1_0(file, header)
                # Sparse: what is not written is no block of the disk.
                file.truncate(file.tell() + LONG_CLIP * spec.frame_bytes(16, 16))
        times = np.arange(LONG_CLIP) / 10
        per_frame = {
            name: np.random.default_rng(number).random(LONG_CLIP).tolist()
            for name in ("ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
        }
        records.append(
            ClipRecord(
                name=f"{number:06d}",
                family="sunny_road",
                seed=number,
                split="train",
                frames=LONG_CLIP,
                time_s=tuple(times.tolist()),
                folder=where,
                sha256=dict.fromkeys(ARRAYS, "0" * 64),
                **per_frame,
            )
        )
    write_manifest(folder, "listed", records, (16, 16))


def playing(folder: Path) -> Iterator[Point]:
    """Random actions on `pocket`, many drives at a time."""
    measured(1, python(played("pocket", 1)), folder)  # Compiles the loops, where it is the first.
    for steps in STEPS:
        yield measured(VECTOR * steps, python(played("pocket", steps)), folder)


def playing_every_pixel(folder: Path) -> Iterator[Point]:
    """The same on every pixel of a rendered bank, whose predictions stand."""
    bank = str(bank_of(folder))
    measured(1, python(played(bank, 1)), folder)  # Predicts.
    for steps in FULL_STEPS:
        yield measured(VECTOR * steps, python(played(bank, steps)), folder)


def played(bank: str, steps: int) -> str:
    """Lines that play random actions for so many steps of a vector."""
    return (
        "import gymnasium, shotenv, torch; torch.set_num_threads(1)\n"
        f"envs = gymnasium.make_vec('shotenv/ShotSchedule-v0', num_envs={VECTOR}, bank={bank!r})\n"
        "envs.reset(seed=0); envs.action_space.seed(0)\n"
        f"for _ in range({steps}): envs.step(envs.action_space.sample())"
    )


def learning(folder: Path) -> Iterator[Point]:
    """The scheduler of the demo from more and more drives; the last is judged afterwards."""
    for drives in LEARNT:
        out = folder / f"agent-{drives}"
        told = (f"--agent.regression.drives={drives}", f"--out={out}")
        yield measured(drives, shotenv("train", *told), folder)


def judging(folder: Path) -> Iterator[Point]:
    """A scheduler, the blind, the rules and the optimum on more and more drives."""
    agent = folder / f"agent-{LEARNT[-1]}"
    for drives in JUDGED:
        told = (f"--study.drives={drives}", f"--out={folder / f'judged-{drives}'}")
        yield measured(drives, shotenv("evaluate", agent, *told), folder)


def comparing(folder: Path) -> Iterator[Point]:
    """The same with more and more families of rules beside."""
    agent = folder / f"agent-{LEARNT[-1]}"
    for count in BESIDE:
        families = ",".join(FAMILIES[:count])
        told = (
            "--study.drives=6",
            f"--study.families=[{families}]",
            f"--out={folder / 'compared'}",
        )
        yield measured(count, shotenv("evaluate", agent, *told), folder)


def network(folder: Path) -> Iterator[Point]:
    """TofRegNet as its recipe has it, for fewer passes over more and more frames.

    Passes and validation frames are the same each time: what grows is training alone.
    """
    recipe = Path(__file__).parents[2] / "configs" / "unwrap" / "tofregnet.yaml"
    for clips in RENDERED:
        frames = 5 * clips[0] * FRAMES_PER_CLIP
        told = (
            f"--bank={bank_of(folder, clips)}",
            f"--epochs={PASSES}",
            f"--out={folder / f'network-{frames}'}",
        )
        command = shotenv("unwrap", "train", f"--config={recipe}", *told)
        yield measured(frames * PASSES, command, folder)


SUBJECTS: Final[dict[str, Subject]] = {
    "rendering": Subject("rendering, 160 x 120", "frame", rendering),
    "opening": Subject("opening a bank", "frame", opening),
    "network": Subject("training TofRegNet, 160 x 120", "frame and pass", network, "rendering"),
    "playing": Subject("playing `pocket`", "step", playing),
    "playing_every_pixel": Subject(
        "playing every pixel, 160 x 120", "step", playing_every_pixel, "rendering"
    ),
    "learning": Subject("training a scheduler (regression)", "drive", learning),
    "judging": Subject("judging a scheduler", "drive", judging, "learning"),
    "comparing": Subject(
        "judging it beside rules, 6 drives", "family of rules", comparing, "learning"
    ),
}
"""In their order: later ones use what earlier ones left in the folder."""


def fitted(points: Sequence[Point], of: str = "core_s") -> tuple[float, float]:
    """What a run costs before the first of its size, and each of it: least squares."""
    size = np.array([point["size"] for point in points])
    slope, start = np.polyfit(size, [point[of] for point in points], 1)
    return float(start), float(slope)


def measure(
    told: Callable[[str], Any], names: Sequence[str] = (), kept: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Points of every subject, with the machine that gave them.

    Of the subjects `names` alone and those that they need, where some are named; points of the
    others are those of `kept`.
    """
    needed = {*names, *(SUBJECTS[name].needs for name in names)} if names else set(SUBJECTS)
    found = {} if kept is None else dict(kept)
    with tempfile.TemporaryDirectory() as folder:
        for name in (name for name in SUBJECTS if name in needed):
            found[name] = []
            for point in SUBJECTS[name].measure(Path(folder)):
                told(f"{SUBJECTS[name].what}: {point}")
                found[name].append(point)
    points = {name: found[name] for name in SUBJECTS}
    return {"cores": os.cpu_count(), "date": time.strftime("%Y-%m-%d"), "points": points}
