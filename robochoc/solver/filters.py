"""Filters: the values of another robot that are consistent with a value of this robot, without naming the values.

A filter is a bitmap over the possible values of the other robot by common knowledge: the product of its interface
variables' declared domains, in ascending order. Bit 0 of byte 0 is the first (Brito, Meisels, Meseguer and Zivan,
Constraints 14, 2009: the "filtered domain" that DisFC sends instead of the robot's value).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from robochoc.model.problem import Value
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.shared_constraint import SharedConstraint

MAX_FILTER_BITS = 65_536
"""The maximum number of bits in a filter: combinations of the declared values of a robot's interface variables."""


class Filters:
    """Computes the filters that one robot sends, and the positions of its own values in received filters.

    `constraints` has the constraints with each receiver; other robots get a full filter.

    Raises:
        UnsupportedError: if the robot has too many values for a filter.
    """

    def __init__(
        self, part: AgentProblem, values: Sequence[Value], constraints: Mapping[str, Sequence[SharedConstraint]]
    ) -> None:
        self._part = part
        self._constraints = constraints
        self._made: dict[tuple[int, str], tuple[int, bytes]] = {}
        columns = self._columns(part.robot.name)
        size = math.prod(len(column) for column in columns)
        if size > MAX_FILTER_BITS:
            raise UnsupportedError(
                f"{part.robot.name} has {size:,} combinations of interface values, more than the {MAX_FILTER_BITS:,}"
                " bits of a filter; make its domains smaller, or use another protocol"
            )
        ranks: list[dict[int | None, int]] = [{value: rank for rank, value in enumerate(column)} for column in columns]
        self.places = [_place(value, ranks) for value in values]
        """The position of each own value in filters."""

    def of(self, index: int, receiver: str) -> tuple[int, bytes]:
        """Return the number of evaluated pairs, and the filter sent to `receiver` for this robot's value at `index`."""
        made = self._made.get((index, receiver))
        if made is None:
            made = self._made[index, receiver] = self._filter(index, receiver)
        return made

    def _filter(self, index: int, receiver: str) -> tuple[int, bytes]:
        columns = self._columns(receiver)
        size = math.prod(len(column) for column in columns)
        allowed = (1 << size) - 1
        evaluated = 0
        for constraint in self._constraints.get(receiver, ()):
            pairs, row = constraint.row(index, columns)
            evaluated += pairs
            allowed &= int("".join("01"[holds] for holds in reversed(row)) or "0", 2)
        return evaluated, allowed.to_bytes((size + 7) // 8, "little")

    def _columns(self, robot: str) -> list[list[int]]:
        return [sorted(self._part.known.domains[name]) for name in self._part.interfaces[robot]]


def _place(value: Value, ranks: Sequence[Mapping[int | None, int]]) -> int:
    place = 0
    for part, rank in zip(value, ranks, strict=True):
        place = place * len(rank) + rank[part]
    return place


def allows(allowed: bytes, place: int) -> bool:
    """Return whether the filter `allowed` contains `place`; bits beyond its end are 0."""
    return place >> 3 < len(allowed) and bool(allowed[place >> 3] >> (place & 7) & 1)
