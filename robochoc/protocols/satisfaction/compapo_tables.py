"""The constraints that robots of CompAPO tell a mediator, as tables: they are made, put together and checked here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from robochoc.model.message import Value
from robochoc.solver.compiled import LocalProblem


class Table(msgspec.Struct, frozen=True, array_like=True):
    """All constraints over the same robots in one table: a bit for each combination of their values, set if allowed.

    The place of the last robot's value runs fastest; bit i of the table is bit i % 8 of byte i // 8.
    """

    robots: tuple[str, ...]
    sizes: tuple[int, ...]
    allowed: bytes

    def __post_init__(self) -> None:
        """Check that the table is complete."""
        if not len({*self.robots}) == len(self.robots) == len(self.sizes) > 0 or min(self.sizes) < 1:
            raise ValueError("a table does not say how many values each of its robots has")
        if len(self.allowed) != -(-math.prod(self.sizes) // 8):
            raise ValueError("a table does not have a bit for each combination of values")

    def allows(self, places: Iterable[int]) -> bool:
        """Return whether the values at these `places` of the robots are allowed."""
        at = 0
        for place, size in zip(places, self.sizes, strict=True):
            at = at * size + place
        return bool(self.allowed[at >> 3] >> (at & 7) & 1)


def own_tables(
    problem: LocalProblem, linked: Iterable[str], domains: Mapping[str, Sequence[Value]]
) -> tuple[Table, ...]:
    """Return the constraints of `problem` with the robots `linked`, those over the same robots in one table."""
    allowed: dict[tuple[str, ...], dict[tuple[int, ...], int]] = {}
    for lowest in linked:
        for others, masks in problem.allowed(domains, lowest):
            known = allowed.get(others)
            allowed[others] = {p: mask & known[p] for p, mask in masks.items()} if known else masks
    return tuple([_table(problem, domains, others, masks) for others, masks in allowed.items()])


def distinct(tables: Iterable[Table]) -> list[Table]:
    """Return the first of `tables` over the same robots each: all of these robots tell the same."""
    found: dict[frozenset[str], Table] = {}
    for table in tables:
        found.setdefault(frozenset(table.robots), table)
    return list(found.values())


def sizes_in(tables: Iterable[Table], places: Mapping[str, int]) -> dict[str, int]:
    """Return the sizes of the domains of all robots in `tables`, whose values are at these `places`.

    Raises:
        ValueError: if a table and a value do not go together, or two tables.
    """
    sizes: dict[str, int] = {}
    for table in tables:
        for robot, size in zip(table.robots, table.sizes, strict=True):
            if sizes.setdefault(robot, size) != size or not 0 <= places[robot] < size:
                raise ValueError(f"what is told of the values of {robot} does not agree")
    return sizes


def _table(
    problem: LocalProblem,
    domains: Mapping[str, Sequence[Value]],
    others: tuple[str, ...],
    masks: Mapping[tuple[int, ...], int],
) -> Table:
    """Return a table whose last robot is the one of `problem`."""
    own = len(problem.values)
    bits = 0
    for row, place in enumerate(sorted(masks)):
        bits |= masks[place] << row * own
    sizes = (*(len(domains[robot]) for robot in others), own)
    return Table((*others, problem.agent), sizes, bits.to_bytes(-(-len(masks) * own // 8), "little"))
