"""Write `docs/licences.md`: the licence of every package that is installed, and who brings it.

With everything installed, that of the extras `docs` and `s3`, too: `python docs/licences_table.py`
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, distribution
from pathlib import Path

from packaging.requirements import Requirement

PAGE = Path(__file__).with_name("licences.md")
COPYLEFT = re.compile(r"\b(A?GPL|LGPL|MPL|EUPL|CDDL|EPL)|General Public|Mozilla Public", re.I)
WHY = {
    "certifi": "MPL-2.0, of files: a list of certificates, used as it is",
    "hypothesis": "MPL-2.0, of files: tests alone use it, as it is",
    "pathspec": "MPL-2.0, of files: mypy alone uses it, as it is",
    "pygame-ce": "LGPL-2.1, of a library: only `shotenv play` imports it, as it is",
    "tqdm": "MPL-2.0 of some files, the rest MIT: used as it is",
}
"""Why each package whose licence asks for more than a notice goes with MIT use of this one."""
SHORT = {
    "BSD License": "BSD",
    "3-Clause BSD License": "BSD-3-Clause",
    "Apache Software License": "Apache-2.0",
    "Apache License 2.0": "Apache-2.0",
    "Apache 2.0": "Apache-2.0",
    "GNU Library or Lesser General Public License (LGPL)": "LGPL",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "MIT License": "MIT",
    "The MIT License": "MIT",
}
HEAD = """# Licences of what is installed

shotenv itself is under the MIT licence. It contains no code of the packages below: they are
installed beside it, each under its own licence, and imported as they are.
`python docs/licences_table.py` makes this page from what the packages say of themselves, as
installed with Python 3.11 on Linux, with torch's build for processors. The build for GPUs, which
the default index serves there, also brings NVIDIA's CUDA packages under NVIDIA's own terms.

"Brought by" is the extra of shotenv whose installation brings a package (by way of others, too),
*shotenv* where every one does; `dev` is only for work on shotenv.
"""


def key(name: str) -> str:
    """Name of a package as indices compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licence_of(package: Distribution) -> str:
    """What a package says of its licence, in one line: an expression, else classifiers or text."""
    about = package.metadata
    if expression := about.get("License-Expression"):
        return expression
    classified = [
        line.rsplit("::", 1)[1].strip()
        for line in about.get_all("Classifier") or ()
        if line.startswith("License ::") and not line.endswith("OSI Approved")
    ]
    lines = (about.get("License") or "").strip().splitlines()
    # A long text is the licence itself; its first line is its name.
    found = " and ".join(classified) or (lines[0].strip() if lines else "not told")
    return SHORT.get(found, found)


def project() -> tuple[list[str], dict[str, list[str]]]:
    """Requirements of shotenv itself, and those of each extra."""
    about = tomllib.loads((PAGE.parents[1] / "pyproject.toml").read_text())["project"]
    return about["dependencies"], about["optional-dependencies"]


def wanted(name: str, extra: str) -> Iterator[Requirement]:
    """Requirements of an installed package with an extra ("" for none), on this machine."""
    for line in distribution(name).requires or ():
        requirement = Requirement(line)
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            yield requirement


def brought_by(lines: Iterable[str]) -> set[str]:
    """Names of all packages that these requirements bring, directly or not."""
    waiting, seen = [Requirement(line) for line in lines], set()
    while waiting:
        one = waiting.pop()
        for extra in ("", *one.extras):
            if key(one.name) == "shotenv":
                waiting += map(Requirement, project()[1].get(extra, ()))
            elif (key(one.name), extra) not in seen:
                seen.add((key(one.name), extra))
                waiting += wanted(one.name, extra)
    return {name for name, _ in seen}


def rows() -> list[tuple[str, str, str, str]]:
    """Name, version, licence and extras of each package, in alphabetical order."""
    own, extras = project()
    base = brought_by(own)
    # `all` and `dev` have nothing of their own but tools.
    brings = {e: brought_by(extras[e]) - base for e in sorted(extras) if e not in ("all", "dev")}
    found = []
    for name in sorted(base.union(*brings.values(), brought_by(extras["dev"]))):
        package = distribution(name)
        by = ", ".join(f"`{extra}`" for extra, names in brings.items() if name in names)
        who = "*shotenv*" if name in base else by or "`dev`"
        version = package.version.partition("+")[0]  # without the build of torch
        found.append((package.metadata["Name"], version, licence_of(package), who))
    return found


def page() -> str:
    """The whole page."""
    every = rows()
    copyleft = [row for row in every if COPYLEFT.search(row[2])]
    unexplained = [name for name, *_ in copyleft if key(name) not in WHY]
    if unexplained:
        raise SystemExit(f"{', '.join(unexplained)} has a copyleft licence; say why it fits in WHY")
    lines = [
        HEAD,
        "## Licences that ask for more than a notice\n",
        "None of these is changed or contained in shotenv, so that MIT use of shotenv is free of "
        "them; who hands one of them on keeps to its licence.\n",
        "| package | licence | brought by | why it fits |",
        "|---|---|---|---|",
        *(f"| {n} | {licence} | {by} | {WHY[key(n)]} |" for n, _, licence, by in copyleft),
        "\n## All packages\n",
        "| package | version | licence | brought by |",
        "|---|---|---|---|",
        *(f"| {' | '.join(row)} |" for row in every),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
