"""Run the benchmarks and write their rows to `benchmarks/results.json`."""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path

import benchmarks
from benchmarks.rows import printed

BENCHMARKS = (
    "stepping",
    "playing",
    "sensing",
    "unwrapping",
    "rendering",
    "networks",
    "scaling",
    "together",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=benchmarks.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        default=BENCHMARKS,
        help=f"some of {', '.join(BENCHMARKS)}; all of them by default",
    )
    parser.add_argument(
        "--json",
        type=Path,
        default=Path(__file__).parent / "results.json",
        help="where the rows are written: name, ratio, bound, goal, holds, note",
    )
    arguments = parser.parse_args()
    # Not by `choices`: with none named, argparse takes the default for one name and refuses it.
    for name in arguments.names:
        if name not in BENCHMARKS:
            parser.error(f"NAME is {name!r}; expected one of {', '.join(BENCHMARKS)}")
    rows = []
    for name in arguments.names:
        print(f"{name} ...", flush=True)
        found = importlib.import_module(f"benchmarks.{name}").run()
        for row in found:
            print(printed(row), flush=True)
        rows += found
    arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    print(f"Numbers: {arguments.json}")


if __name__ == "__main__":
    main()
