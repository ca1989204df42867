"""Clips of drawn numbers in place of rendered ones: for what only stores and carries them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shotenv.bank.clip_jobs import ClipJob, clip_jobs
from shotenv.bank.files import ARRAYS, read_clip_record, write_clip, write_manifest
from shotenv.config.bank import BankConfig


def write_made_up(job: ClipJob, *, last_bit: float = 0.0) -> None:
    """The clip of a job, drawn from its seed; another machine's last bits differ."""
    random, camera = np.random.default_rng(job.seed), job.config.camera
    arrays = {
        name: random.random((job.frames, *spec.channels, camera.height, camera.width))
        for name, spec in ARRAYS.items()
    }
    arrays = {name: values.astype(ARRAYS[name].dtype) for name, values in arrays.items()}
    arrays["active"] += np.float32(last_bit)
    per_frame = ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
    about = {"name": job.name, "family": job.family, "seed": job.seed, "split": job.split}
    told = about | dict.fromkeys(per_frame, [0.5] * job.frames)
    write_clip(job.folder, arrays, told, storage=job.config.storage)


def write_made_up_bank(config: BankConfig, folder: Path) -> Path:
    """A whole bank in `folder`, as rendering writes it."""
    jobs = clip_jobs(config, folder)
    for job in jobs:
        write_made_up(job)
    records = [read_clip_record(job.folder) for job in jobs]
    size = (config.camera.height, config.camera.width)
    write_manifest(folder, config.name, records, size, config)
    return folder
