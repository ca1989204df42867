"""Render a bank: worlds from seeds, light from worlds, clips on disk; interruptible, resumable."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from filelock import FileLock

from shotenv.bank.store import (
    ARRAYS,
    CLIP_RECORD,
    MANIFEST,
    BankError,
    ClipRecord,
    frame_bytes,
    read_clip_record,
    write_clip,
    write_manifest,
)
from shotenv.config import BankConfig, Family, Split
from shotenv.render.backend import available_cores, require_device, run_jobs
from unwrap.signal import Shots
from unwrap.support import progress, say, write_json

if TYPE_CHECKING:  # How worlds are drawn and rendered is loaded where it is done.
    from shotenv.render import RenderedFrame
    from shotenv.world.geometry import World

RENDERING_VERSION = 3
"""Raised when the same configuration would give other light: old banks are then left alone."""

SECONDS_PER_MILLION_RAYS = 0.5
"""Camera rays with two bounces, one core, measured at 320 x 240; only to announce a duration."""

ACQUISITION_FIELDS = {
    "integration_s",
    "contrast",
    "offset_std_lsb",
    "offset_row_share",
    "offset_calibrated_share",
    "offset_ambient_lsb",
    "offset_drift_lsb_per_k",
    "wiggle_calibrated_share",
    "distance_drift_m_per_k",
    "drift_compensated_share",
    "calibration_temperature_k",
    "self_heating_k",
    "min_snr",
    "saturation_range_m",
    "max_range_m",
}
"""Fields of the sensor that neither light nor gray image depend on: a bank serves all of them."""

METER_REDUCTION = 4
"""The light meter sees one pixel where the camera sees so many each way."""

FRAMES_PER_WORKER = 512
"""Rendered frames after which a worker process is replaced: rebuilding scenes leaks memory."""


@dataclass(frozen=True)
class ClipJob:
    """Everything a worker needs to render one clip."""

    config: BankConfig
    name: str
    family: Family
    seed: int
    split: Split
    folder: Path


def clip_jobs(config: BankConfig, folder: Path) -> tuple[ClipJob, ...]:
    """Clips of a bank in their order: split by split, family by family, the held-out ones last."""
    kinds = [
        (split, family)
        for split, (count, families) in config.clips.items()
        for _ in range(count)
        for family in families
    ]
    return tuple(
        _job(config, folder, number, split, family) for number, (split, family) in enumerate(kinds)
    )


def _job(config: BankConfig, folder: Path, number: int, split: Split, family: Family) -> ClipJob:
    name = f"{number:05d}-{family}"
    return ClipJob(config, name, family, config.seed + number, split, folder / "clips" / name)


def cache_dir() -> Path:
    """Folder of rendered banks and kept predictions: SHOTENV_CACHE, or the user's cache folder."""
    import platformdirs

    return Path(os.environ.get("SHOTENV_CACHE") or platformdirs.user_cache_path("shotenv"))


def bank_folder(config: BankConfig) -> Path:
    """Where the bank of `config` lies; another configuration lies elsewhere."""
    content = json.dumps(_identity(config), sort_keys=True)
    return cache_dir() / "banks" / f"{config.name}-{sha256(content.encode()).hexdigest()[:8]}"


def build_bank(
    config: BankConfig, folder: Path | None = None, *, workers: int | None = None
) -> Path:
    """Render the bank of `config` and return its folder; clips that already stand are kept.

    Parameters
    ----------
    folder
        Where to; the user's cache folder by default.
    workers
        Rendering processes; one per core by default.

    Raises
    ------
    BankError
        `folder` holds another bank, or the disk has no room.
    shotenv.render.RendererError
        No usable LLVM library or GPU, or a worker died.
    """
    folder = bank_folder(config) if folder is None else Path(folder)
    if _is_complete(folder, config):
        return folder
    _make_folder(folder)
    with FileLock(folder / ".lock"):
        _claim(folder, config)
        jobs = clip_jobs(config, folder)
        missing = [job for job in jobs if read_clip_record(job.folder) is None]
        _announce(config, folder, len(jobs), len(missing))
        _render(missing, config, workers or available_cores())
        size = (config.camera.height, config.camera.width)
        write_manifest(folder, config.name, _records(jobs), size, config)
    return folder


def _is_complete(folder: Path, config: BankConfig) -> bool:
    if not ((folder / MANIFEST).is_file() and _same_config(folder, config)):
        return False
    return all((job.folder / CLIP_RECORD).is_file() for job in clip_jobs(config, folder))


def _make_folder(folder: Path) -> None:
    try:
        (folder / "clips").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BankError(
            f"cannot create {folder}: {error.strerror}; choose another cache folder "
            "with SHOTENV_CACHE"
        ) from None


def _identity(config: BankConfig) -> dict:
    """Everything that the bank's content depends on."""
    content = config.model_dump(mode="json", exclude={"sensor": ACQUISITION_FIELDS})
    return {"rendering_version": RENDERING_VERSION, "config": content}


def _same_config(folder: Path, config: BankConfig) -> bool:
    path = folder / "source.json"
    return path.is_file() and json.loads(path.read_text()) == _identity(config)


def _claim(folder: Path, config: BankConfig) -> None:
    """Mark the folder as this configuration's, or refuse when it is another's."""
    path = folder / "source.json"
    if not path.is_file():
        if any((folder / "clips").iterdir()):
            raise BankError(f"{folder} holds clips of unknown origin; choose another folder")
        write_json(path, _identity(config))
    elif not _same_config(folder, config):
        raise BankError(f"{folder} holds a bank of another configuration; choose another folder")
    for leftover in (folder / "clips").glob(".*"):
        shutil.rmtree(leftover, ignore_errors=True)
    for leftover in folder.glob(".*.json.*"):
        leftover.unlink()


def _announce(config: BankConfig, folder: Path, clips: int, missing: int) -> None:
    frames = missing * config.world.frames_per_clip
    needed, free = bank_bytes(config, frames), shutil.disk_usage(folder).free
    if needed * 1.05 > free:
        raise BankError(
            f"{folder} needs {needed / 1e9:.2f} GB but the disk has {free / 1e9:.2f} GB "
            "free; free space or choose another cache folder with SHOTENV_CACHE"
        )
    say(
        f"Rendering bank '{config.name}' into {folder}: {missing} of {clips} clips, "
        f"{frames} frames, {needed / 1e6:.0f} MB, about {rendering_minutes(config, frames):.1f} "
        f"minutes on {available_cores()} cores. It can be interrupted; the next start continues.",
    )


def bank_bytes(config: BankConfig, frames: int) -> int:
    """Bytes on disk of `frames` frames."""
    return frames * frame_bytes(config.camera.height, config.camera.width)


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
    return sum((job.folder / CLIP_RECORD).is_file() for job in jobs), len(jobs)


def _render(jobs: Sequence[ClipJob], config: BankConfig, workers: int) -> None:
    if not jobs:
        return
    require_device()
    frames = config.world.frames_per_clip
    with progress(len(jobs) * frames, "rendering", "frame") as bar:
        jobs_per_worker = max(1, FRAMES_PER_WORKER // frames)
        for _ in run_jobs(render_clip, jobs, workers=workers, jobs_per_worker=jobs_per_worker):
            bar.update(frames)


def render_clip(job: ClipJob) -> str:
    """Render one clip and write it; returns its name. Runs in a worker process."""
    from shotenv.world import draw_world

    config = job.config
    world = draw_world(job.family, job.seed, config.world)
    times = np.arange(config.world.frames_per_clip) / config.world.frame_rate_hz
    rendered = _render_frames(world, times, config, job.seed)
    light = {
        name: np.stack([getattr(frame, name) for frame in rendered])
        for name in ARRAYS
        if name != "gray"
    }
    gray, exposure_s = _capture(light["ambient"], job)
    constant = np.ones(len(times))
    metadata = {
        "name": job.name,
        "family": job.family,
        "seed": job.seed,
        "split": job.split,
        "time_s": times.tolist(),
        "ego_speed_m_s": (constant * world.ego.speed_m_s).tolist(),
        "yaw_rate_rad_s": (constant * world.ego.yaw_rate_rad_s).tolist(),
        "gray_exposure_s": exposure_s,
    }
    write_clip(job.folder, {**light, "gray": gray}, metadata)
    return job.name


def _render_frames(
    world: World, times: np.ndarray, config: BankConfig, seed: int
) -> list[RenderedFrame]:
    """Frames of a clip; motion blurs gray for as long as the frame before called for.

    Before the first frame comes a coarse look, as a light meter takes it.
    """
    from shotenv.render import FrameRenderer
    from shotenv.sensor import gray_exposure_s

    camera, sensor = config.camera, config.sensor
    coarse = {"width": camera.width // METER_REDUCTION, "height": camera.height // METER_REDUCTION}
    meter = camera.model_copy(update=coarse)
    renderer = FrameRenderer(world, sensor)
    frames = [renderer.frame(float(times[0]), meter, seed=_seed(seed, len(times)))]
    for number, time in enumerate(times):
        light = torch.from_numpy(frames[-1].ambient).unsqueeze(0)
        exposure_s = float(gray_exposure_s(light, sensor))
        frame_seed = _seed(seed, number)
        frames.append(
            renderer.frame(float(time), camera, seed=frame_seed, gray_exposure_s=exposure_s)
        )
    return frames[1:]


def _capture(ambient: np.ndarray, job: ClipJob) -> tuple[np.ndarray, list[float]]:
    """Gray images of a clip; the noise belongs to the bank, so that predictions can be kept."""
    from shotenv.sensor import capture_gray

    generator = torch.Generator().manual_seed(_seed(job.seed, -1))
    noise = torch.randn(ambient.shape, generator=generator)
    gray, exposure_s = capture_gray(torch.from_numpy(ambient), job.config.sensor, noise=noise)
    return gray.numpy().astype(np.uint16), exposure_s.tolist()


def _seed(clip_seed: int, number: int) -> int:
    """A 32-bit seed of its own for each frame of each clip."""
    return int(np.random.SeedSequence([clip_seed, number + 1]).generate_state(1)[0])


def _records(jobs: Sequence[ClipJob]) -> list[ClipRecord]:
    records = [read_clip_record(job.folder) for job in jobs]
    return [record for record in records if record is not None]
