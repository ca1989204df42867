"""From the files that a command names to the configuration of a bank."""

from __future__ import annotations

import re
from pathlib import Path

from shotenv.config import (
    MOST_FRAMES,
    BankConfig,
    MaterialsConfig,
    OwnSceneConfig,
    ScenePathConfig,
    read_config,
)
from shotenv.scenes.scene_worlds import OwnScene, own_world, read_scene
from shotenv.scenes.way_checks import check_way

NOT_READ = "0" * 64
"""Stands for the digest while the scene that has it is read."""
LONGEST_NAME = 60


def own_bank(base: BankConfig, scene: Path, way: Path, materials: Path | None = None) -> BankConfig:
    """`base` with the scene of a file in place of drawn worlds, named after that file.

    Everything is read and checked once: what this returns can be rendered.

    Parameters
    ----------
    base
        Sensor, camera, frame rate, mounts and seed.
    scene
        Mitsuba scene (XML), or a mesh: PLY, OBJ, STL, GLB.
    way
        YAML file of `ScenePathConfig`: units, lights, clips.
    materials
        YAML file of `MaterialsConfig`.

    Raises
    ------
    ConfigError, SceneFileError, ValueError
        A file that cannot be read or mapped, or a way that cannot be driven; names it.
    """
    told = read_config(ScenePathConfig, way)
    table = MaterialsConfig() if materials is None else read_config(MaterialsConfig, materials)
    parts = {**told.model_dump(), **table.model_dump()}
    config = OwnSceneConfig(**parts, file=str(scene.resolve()), digest=NOT_READ)
    found = read_scene(config)
    _check_clips(base, config, found)
    own = config.model_copy(update={"digest": found.digest})
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", scene.stem)[:LONGEST_NAME]
    return base.model_copy(update={"name": name, "own_scene": own})


def _check_clips(base: BankConfig, config: OwnSceneConfig, found: OwnScene) -> None:
    rate = base.world.frame_rate_hz
    for number, clip in enumerate(config.clips):
        frames = clip.frames(rate)
        if not 1 <= frames <= MOST_FRAMES:
            raise ValueError(
                f"clips[{number}] is {clip.times_s[-1] - clip.times_s[0]:g} s long, {frames} "
                f"frames at {rate:g} Hz; expected 1 to {MOST_FRAMES} frames"
            )
        for mount in base.world.mounts:
            camera = own_world(found, config, number, mount).ego
            title = f"clips[{number}], mount {mount.name},"
            check_way(camera, frames / rate, found.static.corners, title)
