"""The jobs of a study: each trains one policy, where it learns, and plays its front."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import file_digest
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

from agents.config import (
    AblationConfig,
    AgentConfig,
    DemoConfig,
    StudyPlan,
    TransferConfig,
    TransferTable,
)
from agents.policies import FAMILIES_OF_PRACTICE, load_policy
from shotenv.config import (
    ConfigError,
    EnvConfig,
    configs_dir,
    find_config,
    merged,
    read_config,
)
from shotenv.decision import FEATURE_NAMES, feature_index
from unwrap.support import Section, open_regular

T = TypeVar("T")
Model = TypeVar("Model", bound=Section)

REFERENCES: Final = "references"
"""What looks at nothing, and the optimum: 0 and 1 of the gap that is closed."""
RANDOM: Final = "random"
Kind = Literal["references", "learned", "saved", "rule", "random"]
OF_PLAY: Final = ("split", "drives", "tuning_drives", "seed", "prices")
"""What of `StudyConfig` the played drives depend on."""


@dataclass(frozen=True)
class Job:
    """One policy on the drives of one table.

    Attributes
    ----------
    table, policy : str
        Names of the table, which is a preset or a transfer's, and of the row.
    kind : str
        What the policy is; "references" is no policy, but what all are measured by.
    config : DemoConfig
    seed : int
        Of the training, or of random choices; rules and references have 0 alone.
    folder : Path, optional
        Of a saved scheduler.
    source : Job, optional
        That trains the scheduler, or on whose validation drives the rule is tuned; this one by
        default.
    """

    table: str
    policy: str
    kind: Kind
    config: DemoConfig
    seed: int = 0
    folder: Path | None = None
    source: Job | None = None

    @property
    def name(self) -> str:
        """Where its result lies in the folder of the study, without the ending."""
        return f"{self.table}/{self.policy}-{self.seed}"

    def depends_on(self, banks: Mapping[str, str]) -> dict[str, Any]:
        """All that its result follows from, as JSON has it.

        `banks` has the fingerprint of each table's bank.
        """
        told: dict[str, Any] = {
            "kind": self.kind,
            "policy": self.policy,
            "seed": self.seed,
            "env": self.config.env.model_dump(mode="json"),
            "study": self.config.study.model_dump(mode="json", include=set(OF_PLAY)),
            "bank": banks[self.table],
        }
        if self.kind == "learned":
            told["agent"] = self.config.agent.told()
        if self.folder is not None:
            with open_regular(self.folder / "policy.safetensors") as file:
                told["scheduler"] = file_digest(file, "sha256").hexdigest()[:16]
        if self.source is not None:
            told["source"] = self.source.depends_on(banks)
        return told


def jobs_of(plan: StudyPlan) -> list[Job]:
    """Every job of a study, those that all are measured by first.

    Raises
    ------
    ConfigError
        A preset, policy or feature that there is none of, a name that stands for two, a setting
        that there is none of, features that something else than a regression is not shown, or a
        transfer of what is not played on its source.
    """
    envs = _named("presets", plan.presets, _env)
    policies = _named("policies", plan.policies, _policy)
    ablations = [_ablation(row, one, envs) for row, one in plan.ablations.items()]
    for row in plan.ablations:
        if row in policies or row == REFERENCES:
            raise ConfigError(f"ablations has {row!r}, which is taken; expected another name")
    jobs: list[Job] = []
    for name, played in plan.presets.items():
        preset = Path(name).stem
        chosen = policies if played == "all" else _chosen(f"presets.{name}", played, policies)
        jobs += _of_preset(plan, preset, envs[preset], chosen)
        jobs += [
            _learned(plan, preset, envs[preset], row, agent, seed)
            for row, agent, shown in ablations
            if preset in shown
            for seed in plan.seeds
        ]
    if plan.transfer is not None:
        jobs += _transferred(plan, plan.transfer, list(envs), jobs)
    # What learns takes longest; what is wrong with the others is told before.
    return sorted(jobs, key=lambda job: (job.kind != REFERENCES, job.kind == "learned"))


def _ablation(
    row: str, one: AblationConfig, envs: dict[str, EnvConfig]
) -> tuple[str, AgentConfig, list[str]]:
    """Name of the row, its learner, and the presets that it is played on."""
    agent = read_config(AgentConfig, _found_agent(one.policy, f"ablations.{row}.policy"))
    agent = _changed(agent, one.agent, f"ablations.{row}.agent")
    if one.unseen and agent.algorithm != "regression":
        raise ConfigError(
            f"ablations.{row}.policy is {one.policy!r}, which learns by {agent.algorithm}; "
            "expected a regression, where unseen is told"
        )
    for name in one.unseen:
        try:
            feature_index(FEATURE_NAMES, name)
        except ValueError as error:
            raise ConfigError(f"ablations.{row}.unseen: {error}") from None
    shown = [Path(preset).stem for preset in one.presets]
    _chosen(f"ablations.{row}.presets", shown, envs)
    if one.unseen:
        agent = merged(agent, {"regression": {"unseen": one.unseen}})
    return row, agent, shown


def _of_preset(
    plan: StudyPlan, preset: str, env: EnvConfig, policies: Mapping[str, tuple[Kind, Any]]
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


def _transferred(
    plan: StudyPlan, transfer: TransferConfig, presets: Sequence[str], jobs: Sequence[Job]
) -> Iterator[Job]:
    """What `jobs` train and tune on the source, on the drives of the transfer's tables."""
    source = Path(transfer.source).stem
    _chosen("transfer.source", [source], dict.fromkeys(presets))
    rows: dict[str, list[Job]] = {}
    for job in jobs:
        if job.table == source and job.kind != REFERENCES:
            rows.setdefault(job.policy, []).append(job)
    chosen = _chosen("transfer.policies", transfer.policies, rows)
    for table, place in transfer.tables.items():
        if table in presets:
            raise ConfigError(
                f"transfer.tables has {table!r}, which is a preset's; expected another name"
            )
        env = _env_of(table, place)
        study = plan.study.model_copy(update={"split": place.split or plan.study.split})
        there = {"env": env, "study": study}
        yield Job(
            table, REFERENCES, REFERENCES, DemoConfig(env=env, agent=AgentConfig(), study=study)
        )
        for job in (job for row in chosen.values() for job in row):
            yield replace(
                job,
                table=table,
                config=job.config.model_copy(update=there),
                # The others neither learn nor are tuned.
                source=job if job.kind in ("learned", "rule") else None,
            )


def _env_of(table: str, place: TransferTable) -> EnvConfig:
    field = f"transfer.tables.{table}"
    return _changed(_env(place.preset, f"{field}.preset"), place.env, f"{field}.env")


def _changed(config: Model, changes: Mapping[str, Any], field: str) -> Model:
    try:
        return merged(config, changes)
    except ConfigError as error:
        raise ConfigError(f"{field}: {error}") from None


def _chosen(field: str, names: Sequence[str], known: Mapping[str, T]) -> dict[str, T]:
    """Those of `known` that are named, by the last part of what may be a path."""
    for name in names:
        if Path(name).stem not in known:
            raise ConfigError(f"{field} has {name!r}; expected of {', '.join(known)}")
    return {stem: known[stem] for stem in (Path(name).stem for name in names)}


def _learned(
    plan: StudyPlan, preset: str, env: EnvConfig, row: str, agent: AgentConfig, seed: int
) -> Job:
    agent = agent.model_copy(update={"seed": seed})
    return Job(preset, row, "learned", DemoConfig(env=env, agent=agent, study=plan.study), seed)


def _named(field: str, names: Iterable[str], made: Any) -> dict[str, Any]:
    """What `made` makes of each name, by the last part of what may be a path."""
    found: dict[str, Any] = {}
    for name in names:
        stem = Path(name).stem
        if stem in found or stem == REFERENCES:
            raise ConfigError(f"{field} has {name!r}, but {stem!r} is taken; expected other names")
        found[stem] = made(name)
    return found


def _env(name: str, field: str = "presets") -> EnvConfig:
    try:
        return read_config(EnvConfig, find_config("env", name))
    except ConfigError as error:
        raise ConfigError(f"{field}: {error}") from None


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
