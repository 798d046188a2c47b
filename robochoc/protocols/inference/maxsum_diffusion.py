"""The rules of max-sum diffusion, and its lower bound.

A diffusion step makes the cost of each value in a robot's variable, and its least cost in a function, equal: both
become their mean, and the total cost of each assignment remains the same. Here a step includes the variable and all its
functions. If R is the cost that a function sends, and Z the sum of all R and the cost of the variable, then each of the
d functions and the variable have the least cost Z / (d + 1) afterwards. So Q, the cost that was moved to a function, is
Z / (d + 1) - R, and the variable keeps its own cost without all Q.

The sum of the least costs of all variables and functions is a lower bound of the cost of every assignment, for all Q.
A step never reduces it, since the sum of the minima of some rows is at most the minimum of their sum, which is d + 1
times the minimum of the mean. In a cycle, all variables make a step at the same time, damped: as the bound is concave
in Q, it does not fall if each function moves by at most a part 1 / k of each step, where k is the largest number of
robots in a function. That is `damping` 1/2 or more for functions of two robots, and 2/3 or more for functions of three.

Costs are integers, and Q are rounded to multiples of 1 / 65536. So the sums of both are exact, and rounding the bound
up to an integer is correct.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import add

from robochoc.model.problem import INFINITE
from robochoc.protocols.inference.maxsum_factor import Row

STEPS = 1 << 16
"""The number of steps of Q in a unit of costs."""

LARGEST = 2.0**36
"""With larger sums of costs there is no bound: sums with Q would not be exact."""


def divided(rows: Sequence[Row], z: Row) -> list[Row]:
    """Return Q for each of `rows`, which are R; `z` is the sum of all rows and the cost of the variable.

    A value whose sum is infinite stays infinite.
    """
    parts = len(rows) + 1
    return [
        [INFINITE if sum_ == INFINITE else sum_ / parts - cost for sum_, cost in zip(z, row, strict=True)]
        for row in rows
    ]


def rounded(row: Row) -> Row:
    """Return `row`, an entry of which is a multiple of 1 / `STEPS` if it is not above `LARGEST`."""
    return [entry if entry > LARGEST else round(entry * STEPS) / STEPS for entry in row]


def share_of_bound(costs: Sequence[float], q: Sequence[Row], r: Sequence[Row]) -> float | None:
    """Return the least cost of a robot's variable without all `q`, plus the least costs of its own functions.

    Args:
        costs: The costs of the variable's values, without preferences.
        q: The last Q to all functions of the variable, its own functions first.
        r: The last R of its own functions.

    Returns:
        The share of the bound, or None if costs are too large or no value is possible.
    """
    if sum(max((entry for entry in row if entry < INFINITE), default=0) for row in (costs, *q, *r)) > LARGEST:
        return None
    left = [_difference(cost, [row[place] for row in q]) for place, cost in enumerate(costs)]
    least = [min(left, default=INFINITE)]
    least += [min(map(add, row, moved)) for row, moved in zip(r, q, strict=False)]
    total = sum(least)
    return None if total == INFINITE else total


def _difference(cost: float, moved: Sequence[float]) -> float:
    return INFINITE if INFINITE in moved else cost - sum(moved)
