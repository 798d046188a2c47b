"""Prices of relations over boxes of values, for `verification/real_bound.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from robochoc.model.constraint import INFINITE, Constraint, Relation
from robochoc.model.expression.bounds import Interval

ROWS = 20
"""The number of rows of a relation that take as long as the evaluation of a cost."""


class PriceTable(NamedTuple):
    """A relation: the prices of its listed rows, and of all others. None: they are forbidden."""

    variables: Sequence[str]
    prices: Mapping[tuple[int, ...], int | None]
    other: int | None

    def least(self, box: Mapping[str, Interval], counts: Mapping[str, int]) -> int | None:
        """Return the least price of a row in `box`, whose variables have `counts` values. None: all are forbidden."""
        parts = [box[name] for name in self.variables]
        inside = [
            price
            for row, price in self.prices.items()
            if all(low <= value <= high for value, (low, high) in zip(row, parts, strict=True))
        ]
        if len(inside) < math.prod(counts[name] for name in self.variables):
            inside.append(self.other)
        return min((price for price in inside if price is not None), default=None)


def price_table(
    constraint: Constraint, relation: Relation, unit: int, domains: Mapping[str, Sequence[range]]
) -> PriceTable:
    """Return a relation with its possible rows, over its distinct variables."""

    def price(cost: float) -> int | None:
        return None if cost == INFINITE else int(cost) * unit

    listed, other = relation.prices
    prices: dict[tuple[int, ...], int | None] = {}
    for row, cost in listed.items():
        values = dict(zip(constraint.parameters, row, strict=True))
        is_possible = all(
            values[term] == value
            and (value == term if isinstance(term, int) else count_in(domains[term], (value, value)))
            for term, value in zip(constraint.parameters, row, strict=True)
        )
        if is_possible:
            prices[tuple(values[name] for name in constraint.variables)] = price(cost)
    return PriceTable(constraint.variables, prices, price(other))


def count_in(ranges: Sequence[range], part: tuple[float, float]) -> int:
    """Return the number of values in an interval."""
    low, high = part
    return sum(max(0, int(min(high, one[-1]) - max(low, one[0])) + 1) for one in ranges if one)
