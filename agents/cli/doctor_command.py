"""The command that says what is installed and what is missing."""

from __future__ import annotations

from jsonargparse import Namespace

from agents.cli.command import DONE, FAILED, Command, add_json, write_numbers


def tell_findings(arguments: Namespace) -> int:
    """Say what is installed and what is missing; fails where something is."""
    from agents.cli.doctor import examine

    findings = examine()
    for finding in findings:
        print(finding)
    write_numbers(arguments, [vars(finding) for finding in findings])
    return DONE if all(finding.well for finding in findings) else FAILED


COMMANDS = (
    Command(
        "doctor",
        "say what is installed, what is missing and what mends it",
        add_json,
        tell_findings,
    ),
)
