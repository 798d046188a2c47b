"""Who needs least: a sentence for each metric, for people who look for the answer first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from robochoc.experiments.statistics import by_problem, case_of
from robochoc.experiments.summary import METRICS, Rows, labels

MOST_TOLD = 3
"""Ways that a sentence names."""
_SEARCHED = ("messages", "ncccs", "bytes", "cost")
"""Ways that are the same in all of these do the same."""


def answers(rows: Rows, metrics: Sequence[str]) -> list[str]:
    """Return sentences that say which ways to run need least, and which do the same.

    Args:
        rows: The results of several ways to run.
        metrics: The metrics to tell of.
    """
    told = [line for metric in metrics if (line := _least(rows, metric))]
    return [*told, *_twins(rows)] if len(labels(rows)) > 1 else []


def _least(rows: Rows, metric: str) -> str:
    """Return in how many cases each way needs least; empty where all need the same.

    A case is a problem, and a value of the parameter of runs; it counts with the median of its runs. Higher utilities
    are better.
    """
    ways = labels(rows)
    needs = {way: by_problem(rows, way, metric) for way in ways}
    upwards = {row["digest"] for row in rows if metric == "cost" and row["maximises"]}
    wins: Counter[str] = Counter()
    cases = list(dict.fromkeys(case for values in needs.values() for case in values))
    for case in cases:
        values = {way: found[case] for way, found in needs.items() if case in found}
        best = (max if case[0] in upwards else min)(values.values())
        winners = [way for way, value in values.items() if value == best]
        if len(winners) < len(ways):
            wins.update(winners)
    if not wins:
        return ""
    named = [f"{way} in {count:,}" for way, count in wins.most_common(MOST_TOLD)]
    others = len(wins) - len(named)
    rest = f", {others} other{'s' * (others > 1)} in fewer" if others else ""
    how = "Best" if metric == "cost" else "Least"
    return f"{how} {METRICS[metric]}: {', '.join(named)} of {len(cases):,} cases{rest}."


def _run(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return *case_of(row), row["seed"], row["repetition"]


def _twins(rows: Rows) -> Iterator[str]:
    """Yield who has done the same as who in all cases."""
    did: dict[str, dict[tuple[Any, ...], tuple[Any, ...]]] = {}
    for row in rows:
        did.setdefault(str(row["label"]), {})[_run(row)] = (row["status"], *(row[name] for name in _SEARCHED))
    groups: list[list[str]] = []
    for way, cases in did.items():
        same = next((group for group in groups if did[group[0]] == cases), None)
        if same:
            same.append(way)
        else:
            groups.append([way])
    yield from (f"{' and '.join(group)} are the same in all runs." for group in groups if len(group) > 1)
