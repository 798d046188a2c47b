"""The cost array of a constraint for all combinations of values, for protocols that compute with tables.

A robot may have several variables, of which a constraint contains some. A table has an entry for each combination that
the constraint distinguishes, however many values the robots have.

Costs are floats, since a violated hard constraint costs `inf`; integers up to 2^53 are exact (`exact_costs.py`). Tables
have at most `MAX_TUPLES` entries.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import Value
from robochoc.solver.shared_constraint import Axis, SharedConstraint, refuse_large

Array = NDArray[np.float64]


MIN_ENTRIES = 256
"""The number of entries from which a constraint is evaluated for all combinations at once."""


class CostTable(NamedTuple):
    """The costs of the constraint called `key`: one axis for each robot in `agents`, the last axis for this robot.

    Equal constraints share one array, which must not be modified.

    Attributes:
        key: The constraint's name in explanations.
        agents: The other robots, in priority order.
        places: For each axis, the indices of the robot's variables in the constraint, among its interface variables.
        charges: The costs. The indices on an axis are the codes of the robot's values: values that agree on `places`
            have the same code, and codes follow the order of the values. Withdrawal has a code of its own.
        codes: For each axis, the code of each of the robot's values.
    """

    key: str
    agents: tuple[str, ...]
    places: tuple[tuple[int, ...], ...]
    charges: Array
    codes: tuple[Sequence[int], ...]

    def joined(self) -> Array:
        """Return the costs with one index for each value of each robot, in the order of the values.

        If the constraint distinguishes all values, this is `charges`. Otherwise, the array is created at each call.

        Raises:
            TooLargeError: if the array is too large.
        """
        shape = tuple(map(len, self.codes))
        if shape == self.charges.shape:  # codes are numbered from 0, so they are the indices of the values
            return self.charges
        refuse_large(self.key, math.prod(shape))
        joined: Array = self.charges[np.ix_(*self.codes)]
        joined.flags.writeable = False
        return joined

    def distinct_codes(self) -> list[Sequence[int] | None]:
        """Return the `codes`, and None for each axis on which the indices are those of the values."""
        return [None if len(one) == size else one for one, size in zip(self.codes, self.charges.shape, strict=True)]

    def after(self, other: CostTable) -> CostTable:
        """Return the sum of `other` and this table, both over the same robots, over the variables that one names.

        Raises:
            TooLargeError: if the table is too large.
        """
        axes = [_common_axis(first, second) for first, second in zip(other.codes, self.codes, strict=True)]
        codes, firsts, seconds = zip(*axes, strict=True)
        refuse_large(self.key, math.prod(map(len, firsts)))
        charges: Array = other.charges[np.ix_(*firsts)] + self.charges[np.ix_(*seconds)]
        places = tuple([tuple(sorted({*some, *more})) for some, more in zip(other.places, self.places, strict=True)])
        return CostTable(self.key, self.agents, places, charges, codes)


def _common_axis(first: Sequence[int], second: Sequence[int]) -> tuple[list[int], list[int], list[int]]:
    """Return codes of all values that `first` or `second` distinguishes, and for each of them the code in both."""
    found: dict[tuple[int, int], int] = {}
    codes = [found.setdefault(pair, len(found)) for pair in zip(first, second, strict=True)]
    return codes, [one for one, _ in found], [other for _, other in found]


def cost_table(constraint: SharedConstraint, domains: Mapping[str, Sequence[Value]]) -> tuple[int, CostTable]:
    """Return the number of checks, and the table of `constraint` over `domains` and this robot's values.

    Raises:
        TooLargeError: if the table is too large.
    """
    equal = constraint.seen, tuple([tuple(domains[agent]) for agent in constraint.agents])
    found = constraint.evaluations.tables.get(equal)
    if found is None:
        axes = constraint.axes(domains)
        evaluated, charges = _charges(constraint, axes)
        charges.flags.writeable = False
        places, codes, _ = zip(*axes, strict=True)
        table = CostTable(constraint.key, constraint.agents, places, charges, codes)
        found = constraint.evaluations.tables[equal] = evaluated * len(constraint.codes), table
    checks, table = found
    return checks, table._replace(key=constraint.key, agents=constraint.agents)


def _charges(constraint: SharedConstraint, axes: Sequence[Axis]) -> tuple[int, Array]:
    """Return the number of combinations of the others' values, and the costs on `axes`."""
    charges: Array = np.zeros([len(one.parts) for one in axes], np.float64)
    if charges.size >= MIN_ENTRIES and fill_at_once(charges, constraint, axes):
        counts = constraint.counts_when_absent
        return math.prod([sum(counts or None not in part for part in one.parts) for one in axes[:-1]]), charges
    evaluated = 0
    for place, others in constraint.combinations(axes[:-1]):
        evaluated += 1
        charges[place] = constraint.distinct_costs(others)
    return evaluated, charges


def fill_at_once(charges: Array, constraint: SharedConstraint, axes: Sequence[Axis]) -> bool:
    """Store the costs in `charges`, block by block; return False if they must be evaluated one by one.

    A block contains the combinations in which the same robots have withdrawn.
    """
    withdrawn = [[at for at, part in enumerate(one.parts) if None in part] for one in axes]
    present = [[at for at, part in enumerate(one.parts) if None not in part] for one in axes]
    absent = [place for place, parts in enumerate(withdrawn) if parts and constraint.counts_when_absent]
    partly = any(None in part and any(one is not None for one in part) for one in axes for part in one.parts)
    if partly or charges.size < MIN_ENTRIES << len(absent):
        return False
    for many in range(len(absent) + 1):
        for gone in itertools.combinations(absent, many):
            kept = [withdrawn[place] if place in gone else present[place] for place in range(len(axes))]
            columns = [[one.parts[at] for at in indices] for one, indices in zip(axes, kept, strict=True)]
            found = constraint.cost_array(columns, gone)
            if found is None:
                return False
            charges[np.ix_(*kept)] = found
    return True
