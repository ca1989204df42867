"""Measure what is not measured yet, or what is named, and write the page."""

from __future__ import annotations

import argparse
import importlib
import sys
import time
import traceback

import reliability
from reliability.page import MEASUREMENTS, PAGE, page
from reliability.rows import Progress, Row, file_of, keep, parts_of


def printed(row: Row) -> str:
    """A row in two lines."""
    found = "; ".join(f"{name}: {value}" for name, value in row.found.items())
    verdict = "holds" if row.holds else "BROKEN"
    return f"  {row.promise:2} {verdict}: {row.done} ({row.seconds:.0f} s)\n     {found}"


def measured(name: str, progress: Progress) -> bool:
    """Run one measurement and keep its rows; whether they all hold."""
    print(f"{name} ...", flush=True)
    begun = time.perf_counter()
    try:
        rows = importlib.import_module(f"reliability.{name}").measure(progress)
    except Exception:
        # The others are measured all the same: they take hours together.
        traceback.print_exc()
        return False
    seconds = time.perf_counter() - begun + sum(progress.before_s)
    print("\n".join(printed(row) for row in rows))
    print(f"{name}: {seconds:.0f} s", flush=True)
    if not progress.quick:
        keep(name, rows, seconds)
    return all(row.holds for row in rows)


def missing(*, whole: bool) -> list[str]:
    """Measurements that are not done; for a trial, which keeps nothing, all of them."""
    return [
        name
        for name in MEASUREMENTS
        if not (whole and file_of(name).is_file() and not parts_of(name).is_file())
    ]


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m reliability",
        description=reliability.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"some of {', '.join(MEASUREMENTS)}, anew, or from where it was interrupted; "
        "by default those that are not done",
    )
    parser.add_argument(
        "--quick", action="store_true", help="a trial of small size; nothing is kept"
    )
    parser.add_argument("--page", action="store_true", help="only write the page of what is kept")
    arguments = parser.parse_args()
    # Not by `choices`: with none named, argparse would refuse the empty list.
    for name in arguments.names:
        if name not in MEASUREMENTS:
            parser.error(f"NAME is {name!r}; expected one of {', '.join(MEASUREMENTS)}")
    names = [] if arguments.page else arguments.names or missing(whole=not arguments.quick)
    held = []
    for name in names:
        parts = None if arguments.quick else parts_of(name)
        held.append(measured(name, Progress(arguments.quick, parts=parts)))
    if not arguments.quick:
        PAGE.write_text(page(), encoding="utf-8")
        print(f"Page: {PAGE}")
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
