"""The jobs of a study: each trains one policy, where it learns, and plays its front."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Any, Final, Literal

from agents.config import AblationConfig, AgentConfig, DemoConfig, StudyPlan
from agents.policies import FAMILIES_OF_PRACTICE, load_policy
from shotenv.config import ConfigError, EnvConfig, configs_dir, find_config, read_config
from shotenv.decision import FEATURE_NAMES, feature_index

REFERENCES: Final = "references"
"""What looks at nothing, and the optimum: 0 and 1 of the gap that is closed."""
RANDOM: Final = "random"
Kind = Literal["references", "learned", "saved", "rule", "random"]
OF_PLAY: Final = ("split", "drives", "tuning_drives", "seed", "prices")
"""What of `StudyConfig` the played drives depend on."""


@dataclass(frozen=True)
class Job:
    """One policy on the drives of one preset.

    Attributes
    ----------
    preset, policy : str
        Names of the table and of the row.
    kind : str
        What the policy is; "references" is no policy, but what all are measured by.
    config : DemoConfig
    seed : int
        Of the training, or of random choices; rules and references have 0 alone.
    folder : Path, optional
        Of a saved scheduler.
    """

    preset: str
    policy: str
    kind: Kind
    config: DemoConfig
    seed: int = 0
    folder: Path | None = None

    @property
    def name(self) -> str:
        """Where its result lies in the folder of the study, without the ending."""
        return f"{self.preset}/{self.policy}-{self.seed}"

    def depends_on(self, bank: str) -> dict[str, Any]:
        """All that its result follows from, as JSON has it; `bank` is the bank's fingerprint."""
        told: dict[str, Any] = {
            "kind": self.kind,
            "policy": self.policy,
            "seed": self.seed,
            "env": self.config.env.model_dump(mode="json"),
            "study": self.config.study.model_dump(mode="json", include=set(OF_PLAY)),
            "bank": bank,
        }
        if self.kind == "learned":
            told["agent"] = self.config.agent.told()
        if self.folder is not None:
            with (self.folder / "policy.safetensors").open("rb") as file:
                told["scheduler"] = file_digest(file, "sha256").hexdigest()[:16]
        return told


def jobs_of(plan: StudyPlan) -> list[Job]:
    """Every job of a study, those that all are measured by first.

    Raises
    ------
    ConfigError
        A policy, preset or feature that there is none of, a name that stands for two, or an
        ablation of what is no regression.
    """
    envs = _named("presets", plan.presets, _env)
    ablations = [_ablation(row, one, envs) for row, one in plan.ablations.items()]
    policies = _named("policies", plan.policies, _policy)
    for row in plan.ablations:
        if row in policies or row == REFERENCES:
            raise ConfigError(f"ablations has {row!r}, which is taken; expected another name")
    jobs: list[Job] = []
    for preset, env in envs.items():
        jobs += _of_preset(plan, preset, env, policies)
        jobs += [
            _learned(plan, preset, env, row, agent, seed)
            for row, agent, shown in ablations
            if preset in shown
            for seed in plan.seeds
        ]
    # What learns takes longest; what is wrong with the others is told before.
    return sorted(jobs, key=lambda job: (job.kind != REFERENCES, job.kind == "learned"))


def _ablation(
    row: str, one: AblationConfig, envs: dict[str, EnvConfig]
) -> tuple[str, AgentConfig, list[str]]:
    """Name of the row, its learner, and the presets that it is played on."""
    agent = read_config(AgentConfig, _found_agent(one.policy, f"ablations.{row}.policy"))
    if agent.algorithm != "regression":
        raise ConfigError(
            f"ablations.{row}.policy is {one.policy!r}, which learns by {agent.algorithm}; "
            "expected a regression"
        )
    for name in one.unseen:
        try:
            feature_index(FEATURE_NAMES, name)
        except ValueError as error:
            raise ConfigError(f"ablations.{row}.unseen: {error}") from None
    shown = [Path(preset).stem for preset in one.presets]
    for preset in shown:
        if preset not in envs:
            raise ConfigError(
                f"ablations.{row}.presets has {preset!r}; expected of {', '.join(envs)}"
            )
    learner = agent.regression.model_copy(update={"unseen": one.unseen})
    return row, agent.model_copy(update={"regression": learner}), shown


def _of_preset(
    plan: StudyPlan, preset: str, env: EnvConfig, policies: dict[str, tuple[Kind, Any]]
) -> Iterator[Job]:
    config = DemoConfig(env=env, agent=AgentConfig(), study=plan.study)
    yield Job(preset, REFERENCES, REFERENCES, config)
    for name, (kind, source) in policies.items():
        if kind == "learned":
            yield from (_learned(plan, preset, env, name, source, seed) for seed in plan.seeds)
        elif kind == "random":
            yield from (Job(preset, name, kind, config, seed) for seed in plan.seeds)
        else:
            yield Job(preset, name, kind, config, folder=source)


def _learned(
    plan: StudyPlan, preset: str, env: EnvConfig, row: str, agent: AgentConfig, seed: int
) -> Job:
    agent = agent.model_copy(update={"seed": seed})
    return Job(preset, row, "learned", DemoConfig(env=env, agent=agent, study=plan.study), seed)


def _named(field: str, names: tuple[str, ...], made: Any) -> dict[str, Any]:
    """What `made` makes of each name, by the last part of what may be a path."""
    found: dict[str, Any] = {}
    for name in names:
        stem = Path(name).stem
        if stem in found or stem == REFERENCES:
            raise ConfigError(f"{field} has {name!r}, but {stem!r} is taken; expected other names")
        found[stem] = made(name)
    return found


def _env(name: str) -> EnvConfig:
    try:
        return read_config(EnvConfig, find_config("env", name))
    except ConfigError as error:
        raise ConfigError(f"presets: {error}") from None


def _found_agent(name: str, field: str) -> Path:
    try:
        return find_config("agent", name)
    except ConfigError as error:
        raise ConfigError(f"{field}: {error}") from None


def _policy(name: str) -> tuple[Kind, Any]:
    """What a policy is, and its configuration or its folder."""
    rules = [family.name for family in FAMILIES_OF_PRACTICE]
    if name == RANDOM:
        return "random", None
    if name in rules:
        return "rule", None
    if Path(name).is_dir():
        load_policy(name)
        return "saved", Path(name)
    learners = sorted(path.stem for path in (configs_dir() / "agent").glob("*.yaml"))
    if name in learners or Path(name).is_file():
        return "learned", read_config(AgentConfig, _found_agent(name, "policies"))
    raise ConfigError(
        f"policies has {name!r}; expected {RANDOM}, of {', '.join((*learners, *rules))}, the path "
        "of an agent's YAML file, or the folder of a trained scheduler"
    )
