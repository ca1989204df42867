"""Plugin of pytest: in continuous integration (`CI` is set) a test that is skipped has failed.

There, all that tests need is installed. A skip then means that what the test proves is proved
nowhere, while the run looks as if it were.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any

import pytest

MAY_BE_SKIPPED: Mapping[str, str] = {
    "test_rendering_with_an_old_llvm_ends_in_an_error_and_not_in_an_abort": (
        "few machines have an LLVM library that is too old beside the one in use"
    ),
}
"""Tests that may be skipped in continuous integration, and why."""


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    """Turn the skip of a test into a failure."""
    report = yield
    name = getattr(item, "originalname", item.name)  # without the parameters in brackets
    return report if name in MAY_BE_SKIPPED else _no_skip(report)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_make_collect_report() -> Generator[None, Any, Any]:
    """Turn the skip of a whole file into a failure."""
    return _no_skip((yield))


def _no_skip(report: Any) -> Any:
    # An expected failure is reported as a skip, too, but has run.
    if "CI" in os.environ and report.skipped and not hasattr(report, "wasxfail"):
        *_, reason = report.longrepr
        report.outcome = "failed"
        report.longrepr = (
            f"{reason} - in CI nothing is skipped unless {Path(__file__).name} says why"
        )
    return report
