"""The cost array of a constraint for all combinations of values, for protocols that compute with tables.

Costs are floats, since a violated hard constraint costs `inf`; integers up to 2^53 are exact (`exact_costs.py`). Tables
have at most `MAX_TUPLES` entries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import Value
from robochoc.solver.shared_constraint import OtherValues, SharedConstraint

Array = NDArray[np.float64]


class CostTable(NamedTuple):
    """The costs of the constraint called `key`: one axis for each robot in `agents`, the last axis for this robot.

    The indices on an axis follow the order of the robot's values. Equal constraints share one array, which must not be
    modified.
    """

    key: str
    agents: tuple[str, ...]
    charges: Array


def cost_table(
    constraint: SharedConstraint, domains: Mapping[str, Sequence[Value]], size: int
) -> tuple[int, CostTable]:
    """Return the number of checks, and the table of `constraint` over `domains` and the `size` own values.

    Raises:
        UnsupportedError: if the table is too large.
    """
    equal = constraint.seen, tuple([tuple(domains[agent]) for agent in constraint.agents])
    found = constraint.evaluations.tables.get(equal)
    if found is None:
        combinations = [*constraint.combinations(domains, size)]
        charges = np.zeros([*(len(domains[agent]) for agent in constraint.agents), size], np.float64)
        seen: set[OtherValues] = set()
        for place, others in combinations:
            seen.add(others)
            charges[place] = constraint.costs(others)
        charges.flags.writeable = False
        found = constraint.evaluations.tables[equal] = len(seen) * size, charges
    checks, charges = found
    return checks, CostTable(constraint.key, constraint.agents, charges)
