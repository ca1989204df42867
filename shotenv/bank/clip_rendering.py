"""One clip from its seed: world, light of every frame, gray images. Runs in a worker process."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from shotenv.bank.clip_jobs import ClipJob
from shotenv.bank.files import ARRAYS, BankError, write_clip
from shotenv.bank.published import publish_clip
from shotenv.config import BankConfig, Family
from shotenv.render import FrameRenderer, RenderedFrame
from shotenv.scenes import own_world, read_scene
from shotenv.sensor import capture_gray, gray_exposure_s
from shotenv.world import draw_world
from shotenv.world.geometry import World, ground_speed_m_s, mounted, yaw_rate_rad_s
from unwrap.execution import visible

METER_REDUCTION = 4
"""The light meter sees one pixel where the camera sees so many each way; assumed."""

GRAY_NOISE = -1
"""Number, among those of the frames, that seeds the noise of a clip's gray images."""

MOST_WORLDS = 64
"""Worlds that are drawn for a clip in which the ego has to move; about a fifth stand still."""

SEEDS_APART = 2**32
"""From the seed of one of them to the next: no other clip of any bank has seeds so far up."""


def render_missing(job: ClipJob) -> None:
    """In a worker: render a clip, unless the same task was begun before and came to its end.

    Raises
    ------
    WorkerError
        This machine does not see the bank's folder.
    unwrap.storage.StorageError
        The place where the clip goes cannot be written.
    """
    if job.url is not None:
        # What of it was published before is as good, and another's may be the one that is named.
        with tempfile.TemporaryDirectory() as scratch:
            here = replace(job, folder=Path(scratch) / job.name)
            render_clip(here)
            publish_clip(job.url, here)
        return
    visible(job.folder.parent)
    if not job.stands:
        render_clip(job)


def render_clip(job: ClipJob) -> str:
    """Render one clip and write it; returns its name."""
    config = job.config
    world = world_of(job)
    times = np.arange(job.frames) / config.world.frame_rate_hz
    rendered = _render_frames(world, times, job)
    light = {
        name: np.stack([getattr(frame, name) for frame in rendered])
        for name in ARRAYS
        if name != "gray"
    }
    # The noise of the gray image belongs to the bank: what networks make of it is then the same in
    # every drive, and can be kept.
    generator = torch.Generator().manual_seed(_seed(job, GRAY_NOISE))
    noise = torch.randn(light["ambient"].shape, generator=generator)
    gray, exposure_s = capture_gray(torch.from_numpy(light["ambient"]), config.sensor, noise=noise)
    metadata = {
        "name": job.name,
        "family": job.family,
        "seed": world.seed,
        "split": job.split,
        "time_s": times.tolist(),
        "ego_speed_m_s": [ground_speed_m_s(world.ego, time) for time in times],
        "yaw_rate_rad_s": [yaw_rate_rad_s(world.ego, time) for time in times],
        "gray_exposure_s": exposure_s.tolist(),
    }
    arrays = {**light, "gray": gray.numpy().astype(np.uint16)}
    write_clip(job.folder, arrays, metadata, storage=config.storage)
    return job.name


def world_of(job: ClipJob) -> World:
    """The world of a clip, drawn or read from its file, seen by the clip's camera.

    Raises
    ------
    BankError
        The scene's file, or another that belongs to it, is no longer what the bank is of; or no
        world drawn is as `drawn_world` wants it.
    """
    if job.family != "own":
        drawn = drawn_world(job.family, job)
        return replace(drawn, ego=mounted(drawn.ego, job.mount))
    own, way = job.config.own_scene, job.way
    if own is None or way is None:
        raise BankError(f"clip {job.name} has no scene; expected own_scene in its configuration")
    scene = read_scene(own)
    if scene.digest != own.digest:
        raise BankError(
            f"{own.file} has changed since the bank was begun; `shotenv render --scene` begins "
            "one of what it is now"
        )
    return own_world(scene, own, way, job.mount)


def drawn_world(family: Family, job: ClipJob) -> World:
    """The world of a clip's seed, or in the shift split the first with a moving ego.

    Raises
    ------
    BankError
        No world drawn has an ego as fast as `shift_mean_speed_m_s`.
    """
    config = job.config
    least_m_s = config.shift_mean_speed_m_s if job.split == "shift" else 0.0
    for attempt in range(MOST_WORLDS):
        world = draw_world(family, job.seed + attempt * SEEDS_APART, config.world)
        if mean_speed_m_s(world, config) >= least_m_s:
            return world
    raise BankError(
        f"shift_mean_speed_m_s is {least_m_s:g}, but in {MOST_WORLDS} worlds of {family} the "
        "ego was slower; expected a speed that is usual there"
    )


def mean_speed_m_s(world: World, config: BankConfig) -> float:
    """Length of the ego's way over a clip by the clip's duration, m/s."""
    # From instant to instant: who drives to and fro, or stops half way, has moved all the same.
    times = np.arange(config.world.frames_per_clip + 1) / config.world.frame_rate_hz
    way = np.array([world.ego.at(float(time)).position_m[:2] for time in times])
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum() / times[-1])


def _render_frames(world: World, times: np.ndarray, job: ClipJob) -> list[RenderedFrame]:
    """Frames of a clip; motion blurs gray for as long as the frame before called for.

    Before the first frame comes a coarse look, as a light meter takes it.
    """
    camera, sensor = job.config.camera, job.config.sensor
    coarse = {"width": camera.width // METER_REDUCTION, "height": camera.height // METER_REDUCTION}
    meter = camera.model_copy(update=coarse)
    renderer = FrameRenderer(world, sensor)
    # The meter's look has a seed of its own, as if it were one frame more.
    frames = [renderer.frame(float(times[0]), meter, seed=_seed(job, len(times)))]
    for number, time in enumerate(times):
        light = torch.from_numpy(frames[-1].ambient).unsqueeze(0)
        exposure_s = float(gray_exposure_s(light, sensor))
        frame_seed = _seed(job, number)
        frames.append(
            renderer.frame(float(time), camera, seed=frame_seed, gray_exposure_s=exposure_s)
        )
    return frames[1:]


def _seed(job: ClipJob, number: int) -> int:
    """A 32-bit seed of its own for each frame of each clip, also of clips that share a world."""
    camera = job.config.world.mounts.index(job.mount)
    # Without the number of the first camera: the seeds of cars with one are without any.
    numbers = [job.seed, number + 1, camera] if camera else [job.seed, number + 1]
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])
