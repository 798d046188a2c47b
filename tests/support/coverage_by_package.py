"""The table of `make coverage`: lines and branches that tests have reached, by package.

`python -m tests.support.coverage_by_package REPORT` reads the JSON report of coverage.py. It ends with status 1 if the
tests of a package reach fewer of its branches than `LEAST` requires.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

LEAST: dict[str, float] = {
    "protocols": 100.0,
    "generators": 98.0,
    "services": 98.0,
    "verification": 96.0,
    "view": 96.0,
    "flight": 95.0,
    "model": 95.0,
    "authority": 94.0,
    "replay": 93.0,
    "system": 93.0,
    "journal": 91.0,
    "sniffer": 91.0,
    "communication": 90.0,
    "run": 90.0,
    "cli": 89.0,
    "modelling": 88.0,
    "solver": 87.0,
    "robots": 86.0,
    "ros": 86.0,
    "vehicles": 86.0,
    "formats": 84.0,
    "maps": 84.0,
}
"""The share of branches, in percent, that tests have to reach in a package."""


def packages(report: str) -> dict[str, Counter[str]]:
    """Return what the report counts, by package; what stands loose at the top of the package is "robochoc"."""
    found: dict[str, Counter[str]] = {}
    for name, file in json.loads(report)["files"].items():
        parts = Path(name).parts
        below = parts[parts.index("robochoc") + 1 :]
        counts = {key: value for key, value in file["summary"].items() if isinstance(value, int)}
        found.setdefault(below[0] if len(below) > 1 else "robochoc", Counter()).update(counts)
    return dict(sorted(found.items()))


def share(counts: Counter[str], kind: str, of: str) -> float:
    """Return the percentage of `of` that was reached, rounded down: only all of them are 100.0."""
    return counts[kind] * 1000 // counts[of] / 10 if counts[of] else 100.0


def table(found: dict[str, Counter[str]]) -> str:
    """Return a line for each package, and one for all."""
    lines = [f"{'package':<14}{'lines':>8}{'reached':>9}{'branches':>10}{'reached':>9}"]
    for package, counts in {**found, "all": sum(found.values(), Counter())}.items():
        of_lines, of_branches = (
            share(counts, kind, of)
            for kind, of in (("covered_lines", "num_statements"), ("covered_branches", "num_branches"))
        )
        numbers = f"{counts['num_statements']:>8,}{of_lines:>8.1f}%{counts['num_branches']:>10,}{of_branches:>8.1f}%"
        lines.append(f"{package:<14}{numbers}")
    return "\n".join(lines)


def below_least(found: dict[str, Counter[str]], least: dict[str, float]) -> list[str]:
    """Return a line for each package whose branches were reached too seldom."""
    return [
        f"{package}: tests reach {reached} % of the branches, and {minimum:g} % are asked for"
        for package, minimum in least.items()
        if (reached := share(found.get(package, Counter()), "covered_branches", "num_branches")) < minimum
    ]


def main() -> int:
    """Print the table, and what is below its minimum."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path, metavar="REPORT", help="the JSON report of coverage.py")
    found = packages(parser.parse_args().report.read_text(encoding="utf-8"))
    print(table(found))  # noqa: T201 - for make
    failed = below_least(found, LEAST)
    print(*failed, sep="\n", end="\n" if failed else "", file=sys.stderr)  # noqa: T201 - the same
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
