"""Who needs least: a sentence for each metric, for people who look for the answer first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from robochoc.experiments.summary import METRICS, Rows, labels
from robochoc.experiments.task import Status

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
    """Return in how many cases each way needs least; empty where all need the same."""
    found = _by_case(rows, metric)
    wins: Counter[str] = Counter()
    decided = 0
    for values in found.values():
        best = min(values.values())
        if best == math.inf:
            continue
        decided += 1
        winners = [way for way, value in values.items() if value == best]
        if len(winners) < len(labels(rows)):
            wins.update(winners)
    if not wins:
        return ""
    named = [f"{way} in {count:,}" for way, count in wins.most_common(MOST_TOLD)]
    others = len(wins) - len(named)
    rest = f", {others} other{'s' * (others > 1)} in fewer" if others else ""
    return (
        f"{'Best' if metric == 'cost' else 'Least'} {METRICS[metric]}: {', '.join(named)} of {decided:,} cases{rest}."
    )


def _by_case(rows: Rows, metric: str) -> dict[tuple[Any, ...], dict[str, float]]:
    """Return for each case what each way needs: infinitely much where it has no verdict.

    A case is a problem with a seed and a repetition, and a value of the parameter of runs. Costs of problems that
    maximise are the less the better, too, with their sign turned.
    """
    found: dict[tuple[Any, ...], dict[str, float]] = {}
    for row in rows:
        value = math.inf
        if row["status"] == Status.DONE and row[metric] is not None:
            value = -row[metric] if metric == "cost" and row["maximises"] else row[metric]
        found.setdefault(_case(row), {})[str(row["label"])] = value
    return found


def _case(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return row["digest"], row["seed"], row["repetition"], row.get("case")


def _twins(rows: Rows) -> Iterator[str]:
    """Yield who has done the same as who in all cases."""
    did: dict[str, dict[tuple[Any, ...], tuple[Any, ...]]] = {}
    for row in rows:
        did.setdefault(str(row["label"]), {})[_case(row)] = (row["status"], *(row[name] for name in _SEARCHED))
    groups: list[list[str]] = []
    for way, cases in did.items():
        same = next((group for group in groups if did[group[0]] == cases), None)
        if same:
            same.append(way)
        else:
            groups.append([way])
    yield from (f"{' and '.join(group)} are the same in all runs." for group in groups if len(group) > 1)
