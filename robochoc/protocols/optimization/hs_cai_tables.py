"""Tables of lower bounds as HS-CAI joins, restricts and sends them (see `hs_cai`).

A table is over robots above, in the order of its axes, the highest first; the robot that holds it may be among them.
Costs are floats: integers below 2^53, or `inf`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.messages.branching import Number
from robochoc.protocols.optimization.messages.hs_cai import Axis

MOST_CELLS = 1 << 17
"""Of a table, and of a message with one; and so many for each own value while it is made."""


class Table(NamedTuple):
    """Costs, with an axis for each robot of `names`."""

    names: tuple[str, ...]
    costs: NDArray[np.float64]

    def at(self, places: Mapping[str, int]) -> Table:
        """Return the part of it with these robots' values at these places."""
        index = tuple([places.get(name, slice(None)) for name in self.names])
        return Table(tuple(name for name in self.names if name not in places), self.costs[index])

    def over(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the least costs with an axis for each of `names`, in this order; of length 1 where it has none."""
        gone = tuple(axis for axis, name in enumerate(self.names) if name not in names)
        left = [name for name in self.names if name in names]
        least = self.costs.min(axis=gone)
        least = least.transpose([left.index(name) for name in names if name in left])
        aligned: NDArray[np.float64] = least[tuple([slice(None) if name in left else np.newaxis for name in names])]
        return aligned


def kept_axes(axes: Sequence[Axis], most: int) -> list[Axis]:
    """Return the axes that a table may have: the lowest robots, at most `most`, and not too many cells together."""
    kept: list[Axis] = []
    for axis in sorted(axes, key=lambda axis: axis[1], reverse=True)[:most]:
        if math.prod([size for _, _, size in kept]) * axis[2] > MOST_CELLS:
            break
        kept.append(axis)
    return kept[::-1]


def least_over(axes: Sequence[Axis], own: str, charges: Sequence[Number], tables: Sequence[Table]) -> list[Number]:
    """Return the least sum of `charges` and `tables` over the own values, for each combination of values of `axes`.

    Each table is minimised by itself over robots that are not in `axes`, so the sum is a lower bound.
    """
    shape = [size for _, _, size in axes]
    names = [name for name, _, _ in axes]
    least = np.full(shape, np.inf)
    parts = [table.over([own, *names]) for table in tables]
    for index, charge in enumerate(charges):
        total = np.full(shape, float(charge))
        for part in parts:
            total = total + part[index if part.shape[0] > 1 else 0]
        least = np.minimum(least, total)
    return [number_of(cost) for cost in least.reshape(-1).tolist()]


def table_of(axes: Sequence[Axis], costs: Sequence[Number]) -> Table:
    """Return the table of a message.

    Raises:
        ValueError: if the costs are not as many as the axes say, or too many.
    """
    shape = [size for _, _, size in axes]
    if min(shape, default=1) < 1 or math.prod(shape) != len(costs) or len(costs) > MOST_CELLS:
        raise ValueError(f"{len(costs)} costs are no table of {shape}")
    return Table(tuple(name for name, _, _ in axes), np.array(costs, np.float64).reshape(shape))


def number_of(cost: float) -> Number:
    """Return a cost as an integer, or infinity."""
    return int(cost) if cost < INFINITE else INFINITE
