"""The costs of a constraint for all combinations of values, as an array: for protocols that compute with tables.

Costs are floats, as a broken hard constraint costs `inf`; integers up to 2^53 are exact in them (`exact.py`). A table
has at most as many entries as a constraint may have tuples of values to be tried on (`MAX_TUPLES`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.model.message import Value
from robochoc.solver.shared_constraint import OtherValues, SharedConstraint

Array = NDArray[np.float64]


class CostTable(NamedTuple):
    """The costs of the constraint called `key`: an axis for each of `agents`, then one for the own values.

    Axes are in the order of `agents`, places on an axis in the order of the values that were given for the robot.
    """

    key: str
    agents: tuple[str, ...]
    charges: Array


def cost_table(
    constraint: SharedConstraint, domains: Mapping[str, Sequence[Value]], size: int
) -> tuple[int, CostTable]:
    """Return how many checks it takes, and the table of `constraint` over `domains` and the `size` own values.

    Raises:
        UnsupportedError: when that is too large.
    """
    combinations = [*constraint.combinations(domains, size)]
    charges = np.zeros([*(len(domains[agent]) for agent in constraint.agents), size], np.float64)
    seen: set[OtherValues] = set()
    for place, others in combinations:
        seen.add(others)
        charges[place] = constraint.costs(others)
    return len(seen) * size, CostTable(constraint.key, constraint.agents, charges)
