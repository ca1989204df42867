"""A drive as a recording for the Rerun viewer (rerun.io): its numbers and images over time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from agents.evaluation import PlayedDrives
from agents.optimum import drive_of
from agents.report.results import GRAY_GAMMA
from agents.report.strip import taken_again
from shotenv.decision import Problem
from unwrap.signal import GRAY_FULL_SCALE


def require_rerun() -> Any:
    """The package, or ImportError that says how to get it."""
    try:
        import rerun
    except ImportError:
        raise ImportError(
            "recordings need rerun-sdk, which is not installed: pip install 'shotenv[rerun]'"
        ) from None
    return rerun


def write_recording(
    path: Path,
    problem: Problem,
    played: PlayedDrives,
    name: str,
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> None:
    """Write the first of the drives `played` to `path`, or leave what is there as it was.

    Parameters
    ----------
    path : Path
        An `.rrd` file.
    problem : Problem
        That the drive was played in; images are of banks with every pixel alone.
    played : PlayedDrives
    name : str
        What the viewer calls the recording.
    tick : callable
        Told the number of frames after each.
    """
    rerun = require_rerun()
    path.parent.mkdir(parents=True, exist_ok=True)
    # Beside it and renamed at the end: what is cut off must not look like a recording.
    unfinished = path.with_name(f".{path.name}.part")
    try:
        stream = rerun.RecordingStream("shotenv")
        stream.save(unfinished)
        stream.send_recording_name(name)
        _log_drive(stream, rerun, problem, played, tick)
        stream.disconnect()  # what was logged is on disk from here on
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _log_drive(
    stream: Any,
    rerun: Any,
    problem: Problem,
    played: PlayedDrives,
    tick: Callable[[int], object],
) -> None:
    drive = drive_of(problem, int(played.seeds[0]))
    with_images = problem.bank.every == 1
    columns = {
        "shots/taken": played.shots[0],
        "shots/asked": played.asked[0],
        "error/depth_mae_m": played.depth_mae_m[0],
        "laser/temperature_c": played.temperature_k[0] - 273.15,
        "laser/margin_k": problem.config.laser.trip_k - played.temperature_k[0],
        "laser/energy_so_far_j": played.laser_energy_j[0].cumsum(),
        "reward": played.reward[0],
    }
    for frame in range(played.shots.shape[1]):
        stream.set_time("frame", sequence=frame)
        stream.set_time("time", duration=frame / problem.config.frame_rate_hz)
        stream.log("family", rerun.TextLog(str(played.family[0, frame])))
        for name, values in columns.items():
            # Without laser there is no error.
            if not np.isnan(values[frame]):
                stream.log(name, rerun.Scalars(float(values[frame])))
        if with_images:
            _log_images(stream, rerun, taken_again(problem, drive, played, 0, frame))
        tick(1)


def _log_images(stream: Any, rerun: Any, images: dict[str, np.ndarray]) -> None:
    bright = (images["gray_lsb"] / float(GRAY_FULL_SCALE)) ** GRAY_GAMMA
    stream.log("gray", rerun.Image((255 * bright).astype(np.uint8)))
    if "valid" not in images:
        # Else the viewer would go on showing the last frame with laser.
        stream.log("depth", rerun.Clear(recursive=True))
        return
    # The viewer takes 0 for nothing.
    corrected_m = np.where(images["valid"], images["corrected_m"], 0.0)
    for name, depth_m in (("corrected", corrected_m), ("truth", np.nan_to_num(images["truth_m"]))):
        stream.log(f"depth/{name}", rerun.DepthImage(depth_m.astype(np.float32), meter=1.0))
