"""Run every benchmark and write `benchmarks/results.json`."""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path

from benchmarks.rows import printed

BENCHMARKS = ("stepping", "sensing", "rendering", "networks")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=BENCHMARKS, help=f"some of {BENCHMARKS}")
    parser.add_argument("--json", type=Path, default=Path(__file__).parent / "results.json")
    arguments = parser.parse_args()
    rows = []
    for name in arguments.names:
        rows += importlib.import_module(f"benchmarks.{name}").run()
    for row in rows:
        print(printed(row))
    arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    print(f"Numbers: {arguments.json}")


if __name__ == "__main__":
    main()
