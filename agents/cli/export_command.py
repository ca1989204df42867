"""The command that takes a scheduler to a camera."""

from __future__ import annotations

import re

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import DONE, Command, add_json, add_out, add_trust, write_numbers
from shotenv.config import ConfigError
from unwrap.support import write_json

CYCLE = r"cycle:(\d+):(\d+):(\d+)"
SEQUENCE = "dynamic_mode_switching.json"


def export_arguments(parser: ArgumentParser) -> None:
    """Which policy, and where its files go."""
    parser.add_argument(
        "policy",
        help="folder of a trained scheduler, zip, or cycle:PERIOD:SHOTS:OTHERWISE, as cycle:4:8:2",
    )
    add_out(parser, "runs/export", "folder of the files")
    parser.add_argument("--c-only", action="store_true", help="no ONNX file, which needs onnx")
    parser.add_argument(
        "--modes",
        nargs="+",
        metavar="SHOTS=MODE",
        help="camera mode of each number of samples, for a cycle, as 8=3 2=1",
    )
    add_trust(parser)
    add_json(parser)


def export(arguments: Namespace) -> int:
    """Write a scheduler as C and ONNX, or a cycle as a sequence of camera modes."""
    cycle = re.fullmatch(CYCLE, arguments.policy)
    if cycle is not None:
        return export_cycle(arguments, *map(int, cycle.groups()))
    if arguments.modes:
        raise ConfigError("modes are of a cycle; a trained scheduler takes none")
    from agents.deploy import export_policy
    from agents.policies import load_policy

    policy = load_policy(arguments.policy, trust=arguments.trust)
    found = export_policy(policy, arguments.out, onnx=not arguments.c_only)
    cost = found["cost"]
    print(f"In {arguments.out}: {', '.join(found['files'])}.")
    print(
        f"A choice: {cost['weight_bytes']} bytes of weights, {cost['working_bytes']} of stack, "
        f"{cost['multiply_accumulates']} multiply-accumulates, {cost['activations']} activations."
    )
    if cost["microseconds"] is None:
        print("No C compiler is here: the C files were neither compiled nor timed.")
    else:
        print(f"On one core of this machine: {cost['microseconds']:.2f} microseconds.")
    write_numbers(arguments, found)
    return DONE


def export_cycle(arguments: Namespace, period: int, shots: int, otherwise: int) -> int:
    """Write a cycle as the table of Analog Devices' ToF SDK."""
    from agents.deploy import mode_switching, modes_of_shots
    from agents.policies import CyclePolicy

    policy = CyclePolicy(period, shots=shots, otherwise=otherwise)
    table = mode_switching(policy, modes_of_shots(arguments.modes or []))
    write_json(arguments.out / SEQUENCE, table)
    print(f"{arguments.out / SEQUENCE}: {policy}")
    write_numbers(arguments, table)
    return DONE


COMMANDS = (
    Command("export", "write a scheduler for a camera: C99 and ONNX", export_arguments, export),
)
"""Commands of this file."""
