"""States the best configurations in one sentence for each metric, for readers who want the answer first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from robochoc.experiments.statistics import by_problem, case_of, maximised
from robochoc.experiments.summary import METRICS, Rows, labels

MOST_TOLD = 3
"""The most ways to run named in a sentence."""
_SEARCHED = ("messages", "ncccs", "bytes", "cost")
"""The columns that must be equal for ways to run to count as identical."""


def answers(rows: Rows, metrics: Sequence[str]) -> list[str]:
    """Return sentences about the best configurations, and about configurations with equal results.

    Args:
        rows: The results of several ways to run.
        metrics: The metrics in the report.
    """
    sentences = [line for metric in metrics if (line := _least(rows, metric))]
    return [*sentences, *_twins(rows)] if len(labels(rows)) > 1 else []


def _least(rows: Rows, metric: str) -> str:
    """Return a sentence with the number of cases in which each way to run is the best, or tied.

    The sentence is empty if all ways are equal in all cases. A case is a problem with a value of the parameter of runs;
    its result is the median over its runs. Higher utilities are better. A case that no way has solved is open.
    """
    ways = labels(rows)
    needs = {way: by_problem(rows, way, metric) for way in ways}
    upwards = maximised(rows, metric)
    wins: Counter[str] = Counter()
    cases = list(dict.fromkeys(case for values in needs.values() for case in values))
    for case in cases:
        values = {way: found[case] for way, found in needs.items() if case in found}
        best = (max if case[0] in upwards else min)(values.values())
        wins.update(way for way, value in values.items() if value == best)
    if not cases or wins.total() == len(ways) * len(cases):
        return ""
    named = [f"{way} in {count:,}" for way, count in wins.most_common(MOST_TOLD)]
    others = len(wins) - len(named)
    rest = f", {others} other{'s' * (others > 1)} in no more" if others else ""
    tied = wins.total() - len(cases)
    ties = ", ties counted for each" if tied else ""
    without = len(set(map(case_of, rows))) - len(cases)
    left = f"; {without:,} open" if without else ""
    how = "Best" if metric == "cost" else "Least"
    return f"{how} {METRICS[metric]}: {', '.join(named)} of {len(cases):,} cases{rest}{ties}{left}."


def _run(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return *case_of(row), row["seed"], row["repetition"]


def _twins(rows: Rows) -> Iterator[str]:
    """Yield sentences about ways to run with identical results in all cases."""
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
