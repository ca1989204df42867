"""Render the clips of a bank that do not stand yet; interruptible, resumable."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from shotenv.bank.clip_jobs import ClipJob, clip_jobs
from shotenv.bank.files import (
    CLIP_RECORD,
    CLIPS,
    MANIFEST,
    SOURCE,
    BankError,
    ClipRecord,
    alone_in,
    bank_folder,
    frame_bytes,
    identity,
    read_clip_record,
    require_place,
    was_rendered_from,
    write_manifest,
)
from shotenv.config import BankConfig
from shotenv.render.backend import (
    RendererError,
    chosen_variant,
    limit_threads,
    require_device,
)
from unwrap.execution import Executor, WorkerError, available_cores, run_tasks, wait_for_file
from unwrap.signal import Shots
from unwrap.storage import StorageError
from unwrap.support import progress, say, write_json

SECONDS_PER_MILLION_RAYS = 0.7
"""Camera rays with two bounces, one core; only to announce a duration. Measured on the
training bank with two workers on two cores: 3.0 frames/s of 0.92 million rays, nearly half of them
of scenes that had to be built first."""

FRAMES_PER_WORKER = 512
"""Rendered frames after which a worker process is replaced: rebuilding scenes leaks memory."""

DISK_MARGIN = 1.05
"""Free space asked for, over what the arrays take: records and file system want some, too."""


def build_bank(
    config: BankConfig,
    folder: Path | None = None,
    *,
    workers: int | None = None,
    executor: Executor = "local",
) -> Path:
    """Render the bank of `config` and return its folder; clips that already stand are kept.

    Parameters
    ----------
    folder
        Where to; the user's cache folder by default.
    workers
        Clips that are rendered at a time; one per core by default.
    executor
        "local", or "ray": on the machines of a cluster, which must all see `folder`. The bank is
        the same.

    Raises
    ------
    BankError
        `folder` holds another bank or a clip without its record, what tells which bank it is is
        damaged, or the disk has no room.
    RendererError
        No usable LLVM library or GPU.
    WorkerError
        A clip failed, its worker died, or another machine does not see `folder`.
    """
    folder = bank_folder(config) if folder is None else Path(folder).resolve()
    jobs = clip_jobs(config, folder)
    # Without the lock, which a folder that can only be read would not give.
    finished = (folder / MANIFEST).is_file() and was_rendered_from(folder, config)
    if finished and all(job.stands for job in jobs):
        return folder
    try:
        (folder / CLIPS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BankError(
            f"cannot create {folder}: {error.strerror}; choose another cache folder "
            "with SHOTENV_CACHE"
        ) from None
    with alone_in(folder):
        _claim(folder, config)
        # Only now, under the lock: another process may have rendered them meanwhile.
        missing = [job for job in jobs if read_clip_record(job.folder) is None]
        for job in missing:
            require_place(job.folder)
        _announce(config, folder, len(jobs), missing)
        render_clips(missing, workers, executor)
        _delete_half_written(folder)
        size = (config.camera.height, config.camera.width)
        records = [_record(job, executor) for job in jobs]
        write_manifest(folder, config.name, records, size, config)
    return folder


def _claim(folder: Path, config: BankConfig) -> None:
    """Mark the folder as this configuration's, or refuse when it is another's."""
    if not os.path.lexists(folder / SOURCE):
        if any((folder / CLIPS).iterdir()):
            raise BankError(f"{folder} holds clips of unknown origin; choose another folder")
        write_json(folder / SOURCE, identity(config))
    elif not was_rendered_from(folder, config):
        raise BankError(f"{folder} holds a bank of another configuration; choose another folder")
    _delete_half_written(folder)


def _delete_half_written(folder: Path) -> None:
    """Remove what a killed rendering, or a machine that died, has left under hidden names."""
    for leftover in (folder / CLIPS).glob(".*"):
        shutil.rmtree(leftover, ignore_errors=True)
    for leftover in folder.glob(".*.json.*"):
        leftover.unlink()


def _record(job: ClipJob, executor: Executor) -> ClipRecord:
    """Record of a clip that is rendered.

    Raises
    ------
    WorkerError
        It is not in this machine's folder.
    """
    wait_for_file(job.folder / CLIP_RECORD, executor)
    if (record := read_clip_record(job.folder)) is None:
        raise WorkerError(
            f"{job.name} was rendered, but is not in {job.folder.parent} of this machine; "
            "expected a folder that all machines share"
        )
    return record


def _announce(config: BankConfig, folder: Path, clips: int, missing: Sequence[ClipJob]) -> None:
    """Say what is going to be rendered and how long it takes, or that the disk has no room."""
    frames = sum(job.frames for job in missing)
    needed, free = bank_bytes(config, frames), shutil.disk_usage(folder).free
    if needed * DISK_MARGIN > free:
        raise BankError(
            f"{folder} needs {needed / 1e9:.2f} GB but the disk has {free / 1e9:.2f} GB "
            "free; free space or choose another cache folder with SHOTENV_CACHE"
        )
    say(
        f"Rendering bank '{config.name}' into {folder}: {len(missing)} of {clips} clips, "
        f"{frames} frames, {needed / 1e6:.0f} MB, about {rendering_minutes(config, frames):.1f} "
        f"minutes on {available_cores()} cores. It can be interrupted; the next start continues.",
    )


def render_clips(jobs: Sequence[ClipJob], workers: int | None, executor: Executor) -> None:
    """Render clips under a bar of progress; see `build_bank`."""
    if not jobs:
        return
    if executor == "local":
        require_device()
    # Worlds and renderer want packages that those who only open a bank need not have.
    from shotenv.bank.clip_rendering import render_missing

    longest = max(job.frames for job in jobs)
    with progress(sum(job.frames for job in jobs), "rendering", "frame") as bar:
        # With no name of its own: whatever leaves the loop ends the workers at once.
        for job, _ in run_tasks(
            render_missing,
            jobs,
            executor=executor,
            workers=workers,
            gpu=chosen_variant().startswith("cuda"),
            # A clip of more frames than that still has to be one worker's.
            tasks_per_worker=max(1, FRAMES_PER_WORKER // longest),
            prepare=limit_threads,
            passing=(BankError, RendererError, StorageError, WorkerError),
            name=lambda job: f"clip {job.name}",
        ):
            bar.update(job.frames)


def bank_bytes(config: BankConfig, frames: int) -> int:
    """Bytes on disk of `frames` frames."""
    return frames * frame_bytes(config.camera.height, config.camera.width, config.storage)


def rendering_minutes(config: BankConfig, frames: int) -> float:
    """Estimated time to render `frames` frames on all cores, minutes."""
    camera = config.camera
    rays = frames * camera.height * camera.width * camera.samples_per_pixel
    rays *= int(Shots.EIGHT) + camera.gray_instants
    seconds = rays / 1e6 * SECONDS_PER_MILLION_RAYS * camera.bounces / 2 / available_cores()
    return max(seconds / 60, 0.1)


def clips_standing(config: BankConfig) -> tuple[int, int]:
    """Clips of the bank that stand in the cache folder, and all that it will have."""
    jobs = clip_jobs(config, bank_folder(config))
    return sum(job.stands for job in jobs), len(jobs)
