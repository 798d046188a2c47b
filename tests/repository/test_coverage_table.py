"""The table of `make coverage`."""

from __future__ import annotations

import json

from tests.support.coverage_by_package import below_least, packages, table


def summary(lines: int, of_lines: int, branches: int, of_branches: int) -> dict[str, object]:
    counts = {"covered_lines": lines, "num_statements": of_lines, "percent_covered": 12.5}
    return {"summary": {**counts, "covered_branches": branches, "num_branches": of_branches}}


REPORT = json.dumps(
    {
        "files": {
            "/somewhere/robochoc/api.py": summary(3, 3, 0, 0),
            "robochoc/protocols/satisfaction/abt.py": summary(10, 10, 1999, 2000),
            "robochoc/protocols/heuristics/any.py": summary(5, 10, 0, 0),
        }
    }
)


def test_lines_and_branches_by_package() -> None:
    assert table(packages(REPORT)).splitlines() == [
        "package          lines  reached  branches  reached",
        "protocols           20    75.0%     2,000    99.9%",
        "robochoc             3   100.0%         0   100.0%",
        "all                 23    78.2%     2,000    99.9%",
    ]


def test_almost_all_is_less_than_all() -> None:
    found = packages(REPORT)
    assert below_least(found, {"protocols": 99.9, "robochoc": 100}) == []
    assert below_least(found, {"protocols": 100}) == [
        "protocols: tests reach 99.9 % of the branches, and 100 % are asked for"
    ]
