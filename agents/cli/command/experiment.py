"""What commands that play drives share: their configuration, the bank, and the one thread."""

from __future__ import annotations

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command.command import add_config, add_json
from agents.config import DemoConfig
from shotenv.config import EnvConfig
from unwrap.storage import is_url, require_plain


def add_experiment(parser: ArgumentParser) -> None:
    """Environment, agent and drives, from `configs/demo.yaml` unless told otherwise."""
    add_config(parser, DemoConfig, "demo.yaml")
    add_json(parser)


def experiment_of(arguments: Namespace) -> DemoConfig:
    """The configuration that `add_experiment` asked for; a bank's URL may have no password."""
    if is_url(arguments.env.bank):
        require_plain(arguments.env.bank)  # Before anything tells it.
    return DemoConfig(env=arguments.env, agent=arguments.agent, study=arguments.study)


def prepare_bank(config: EnvConfig) -> None:
    """Render the bank and compute the network's predictions where they do not stand yet."""
    from shotenv.decision import open_problem

    open_problem(config.model_copy(update={"split": "all"}))


def play_on_one_thread() -> None:
    """Let torch compute on one thread from here on, in the whole process.

    Drives are made of small maps (some ten thousand pixels): several threads would only wait for
    each other. The predictions of `prepare_bank`, which comes first, gain from all cores.
    """
    import torch

    torch.set_num_threads(1)
