"""The main job: tune the rule, train the scheduler, judge all policies on test drives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from agents.config import DemoConfig
from agents.evaluation.play import FIXED, SHOTS, Played, drive_seeds, play_drives
from agents.evaluation.summary import best_fixed, drive_rows, summary, timeline
from agents.optimum import tuned_rule
from agents.policies import (
    CyclePolicy,
    FixedPolicy,
    GuardedPolicy,
    Policy,
    PpoPolicy,
    RandomPolicy,
    SnrThresholdPolicy,
)
from agents.report import (
    DRIVES,
    FRAMES,
    RESULTS,
    TIMELINE,
    write_drives,
    write_results,
    write_strip,
)
from shotenv.config import EnvConfig
from unwrap.support import progress, write_json

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

    from agents.policies import ThermalGuard
    from agents.training import KnownFrames
    from shotenv.env import ShotScheduleVectorEnv

SCHEDULER: Final = "ppo"
VALIDATION_DRIVES: Final = 6


def make_envs(config: EnvConfig, split: str, count: int, mode: str) -> ShotScheduleVectorEnv:
    """`count` environments of `config` on the drives of `split`."""
    from shotenv.env import ShotScheduleVectorEnv

    fields = config.model_copy(update={"split": split}).model_dump()
    return ShotScheduleVectorEnv(count, autoreset_mode=mode, remember=True, **fields)


def train_scheduler(config: DemoConfig, out: Path) -> PpoPolicy:
    """Train PPO on training drives, from its checkpoint in `out` where there is one.

    The policy with the best return on validation drives is kept.
    """
    from agents.training import PairedVecEnv, Trainer, warm_start

    envs = make_envs(config.env, "train", config.agent.num_envs, "SameStep")
    seeds = drive_seeds(config.study, min(VALIDATION_DRIVES, config.study.tuning_drives))
    judges = make_envs(config.env, "validation", len(seeds), "Disabled")

    def validate(policy: PpoPolicy) -> float:
        return float(play_drives(policy, judges, seeds).reward.sum(axis=1).mean())

    def warm(network: ActorCriticPolicy) -> None:
        warm_start(network, _known_frames(config, guard), seed=config.agent.seed)

    guard = thermal_guard(config)
    paired, frames = PairedVecEnv(envs, guard), config.env.frames_per_drive
    start = warm if config.agent.warm_start else None
    return Trainer(paired, guard, frames, config.agent, validate, out, start).run()


def _known_frames(config: DemoConfig, guard: ThermalGuard) -> KnownFrames:
    """Every action in every frame of the training drives."""
    from agents.training import ROLLOUTS, known_frames, training_drives

    seeds = training_drives(config.agent).tolist()
    envs = make_envs(config.env, "train", len(seeds), "Disabled")
    frames = (1 + ROLLOUTS) * len(seeds) * config.env.frames_per_drive
    with progress(frames, "every action in the training drives", "frame") as bar:
        return known_frames(envs, seeds, guard, tick=bar.update)


def thermal_guard(config: DemoConfig) -> ThermalGuard:
    """The guard of `config`: `agent.guard` times the most that a frame can warm the laser by."""
    from agents.policies import ThermalGuard, largest_rises_k
    from shotenv.decision import FEATURE_NAMES

    needed_k = [config.agent.guard * rise_k for rise_k in largest_rises_k(config.env)]
    return ThermalGuard(FEATURE_NAMES, needed_k)


def tune_rule(config: DemoConfig) -> SnrThresholdPolicy:
    """The one-threshold rule with the best return on validation drives."""
    from agents.optimum import tabulate
    from shotenv.decision import FEATURE_NAMES, open_problem

    problem = open_problem(config.env.model_copy(update={"split": "validation"}))
    seeds = drive_seeds(config.study, config.study.tuning_drives)
    frames = len(seeds) * config.env.frames_per_drive
    with progress(frames, "tuning the threshold rule", "frame") as bar:
        possible = tabulate(problem, seeds, tick=bar.update)
    rule = tuned_rule(possible.table(config.env.reward))
    return SnrThresholdPolicy(
        FEATURE_NAMES, rule.limit, below=SHOTS[rule.below], above=SHOTS[rule.above]
    )


def baselines(config: DemoConfig) -> dict[str, Policy]:
    """What a scheduler is compared with; the rule is tuned here."""
    return {
        "snr_threshold": tune_rule(config),
        "cycle": CyclePolicy(4, shots=8, otherwise=2),
        "random": RandomPolicy(config.study.seed),
        "always_8_guarded": GuardedPolicy(FixedPolicy(8), thermal_guard(config)),
        **FIXED,
    }


def play_all(config: DemoConfig, policies: Mapping[str, Policy]) -> dict[str, Played]:
    """Every policy on the same test drives."""
    seeds = drive_seeds(config.study, config.study.drives)
    envs = make_envs(config.env, config.study.split, len(seeds), "Disabled")
    frames = len(policies) * len(seeds) * config.env.frames_per_drive
    with progress(frames, "evaluating on test drives", "frame") as bar:
        return {
            name: play_drives(policy, envs, seeds, tick=bar.update)
            for name, policy in policies.items()
        }


def evaluate_scheduler(config: DemoConfig, scheduler: PpoPolicy, out: Path) -> dict[str, Any]:
    """Judge `scheduler` beside the baselines and write everything that the report shows.

    Raises
    ------
    ValueError
        The scheduler was trained on other features than the environment has.
    """
    from shotenv.decision import FEATURE_NAMES

    if scheduler.feature_names != FEATURE_NAMES:
        raise ValueError(
            "the scheduler was trained on other features than this environment has; "
            "train it again (`shotenv train`)"
        )
    policies = {SCHEDULER: scheduler, **baselines(config)}
    played = play_all(config, policies)
    results = summary(played, config.study, scheduler=SCHEDULER)
    results["policies"]["snr_threshold"]["rule"] = str(policies["snr_threshold"])
    results["policies"]["cycle"]["rule"] = "8 DCS every 4th frame, else 2"
    results["config"] = config.model_dump(mode="json")
    _write(config, played, results, out)
    return results


def _write(
    config: DemoConfig, played: Mapping[str, Played], results: dict[str, Any], out: Path
) -> None:
    from agents.report import take_strip
    from shotenv.decision import open_problem

    out.mkdir(parents=True, exist_ok=True)
    compared = {name: played[name] for name in (SCHEDULER, best_fixed(played))}
    laser = config.env.laser
    shown = _drive_to_show(compared[SCHEDULER])
    write_json(
        out / TIMELINE,
        timeline(compared, shown, config.env.frame_rate_hz, laser.trip_k, laser.release_k),
    )
    write_drives(out / DRIVES, drive_rows(played))
    problem = open_problem(config.env.model_copy(update={"split": config.study.split}))
    write_strip(out / FRAMES, take_strip(problem, played[SCHEDULER]))
    write_results(out / RESULTS, results)


def _drive_to_show(played: Played) -> int:
    """The drive with the most scene families, and among those the hottest."""
    families = [len(set(row)) for row in played.family.tolist()]
    hottest = played.temperature_k.max(axis=1).tolist()
    return max(range(len(families)), key=lambda i: (families[i], hottest[i]))
