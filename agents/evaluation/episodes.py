"""Drives as data sets of Minari: what offline learners and off-policy evaluation read."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np

from agents.policies import Policy


def require_minari() -> Any:
    """The package, or ImportError that says how to get it."""
    try:
        import minari
    except ImportError:
        raise ImportError(
            "data sets need minari, which is not installed: pip install 'shotenv[minari]'"
        ) from None
    return minari


def play_episodes(
    policy: Policy,
    env: gymnasium.Env,
    seeds: Sequence[int],
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> list[Any]:
    """Episodes of `env` with these seeds, as Minari's buffers: every number that was told.

    Parameters
    ----------
    tick : callable
        Told the number of frames after each drive.
    """
    require_minari()
    from minari.data_collector import EpisodeBuffer

    episodes = []
    for number, seed in enumerate(seeds):
        policy.reset()
        observation, info = env.reset(seed=seed)
        observations, infos = [observation], [info]
        actions: list[int] = []
        paid: list[tuple[Any, bool, bool]] = []
        over = False
        while not over:
            actions.append(policy.act(observation, info))
            observation, reward, terminated, truncated, info = env.step(actions[-1])
            paid.append((reward, terminated, truncated))
            observations.append(observation)
            infos.append(info)
            over = terminated or truncated
        rewards, terminations, truncations = (list(column) for column in zip(*paid, strict=True))
        episodes.append(
            EpisodeBuffer(
                id=number,
                seed=seed,
                observations=stacked(observations),
                actions=np.array(actions),
                rewards=rewards,
                terminations=terminations,
                truncations=truncations,
                infos=stacked(infos),
            )
        )
        tick(len(actions))
    return episodes


def write_dataset(
    dataset_id: str, env: gymnasium.Env, episodes: Sequence[Any], *, policy: str, description: str
) -> Any:
    """Write episodes as a data set of Minari, without loss, and return it.

    It lies in the folder `MINARI_DATASETS_PATH`, or in Minari's own. Its environment is the one
    that it was played in: `recover_environment` makes it again.

    Raises
    ------
    ValueError
        There is a data set of that name, or it is no name.
    """
    minari = require_minari()
    with warnings.catch_warnings():
        # It warns of everything that is left out: author, address, link.
        warnings.simplefilter("ignore", UserWarning)
        return minari.create_dataset_from_buffers(
            dataset_id,
            list(episodes),
            env=env,
            eval_env=env.spec,
            algorithm_name=policy,
            description=description,
            data_format="hdf5",
            # Images, too, as they were: JPEG would change them.
            jpeg_encoding=False,
        )


def stacked(each: Sequence[Any]) -> Any:
    """Observations or infos one behind the other: dictionaries of arrays as one such."""
    if isinstance(each[0], Mapping):
        return {key: stacked([one[key] for one in each]) for key in each[0]}
    return np.stack([np.asarray(one) for one in each])
