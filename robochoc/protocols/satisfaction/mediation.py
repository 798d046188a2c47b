"""A mediator's local problem (CompAPO): depth-first branch and bound for a value of each robot in its good_list.

The result satisfies all constraints among these robots, and breaks as few constraints as possible with robots outside,
whose values are fixed. Forward checking removes values of later robots; the robot with the fewest remaining values is
next; values that break the fewest constraints come first, and among these the robot's current value.

Each access to a table, for one value, is one constraint check, and is counted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import and_
from typing import NamedTuple

import msgspec

from robochoc.protocols.message import Value
from robochoc.solver.local_problem import LocalProblem


class AllowedTable(msgspec.Struct, frozen=True, array_like=True):
    """All constraints over the same robots in one table: a bit for each combination of their values, set if allowed.

    The index of the last robot's value varies fastest; bit i of the table is bit i % 8 of byte i // 8.
    """

    robots: tuple[str, ...]
    sizes: tuple[int, ...]
    allowed: bytes

    def __post_init__(self) -> None:
        """Check that the table is complete."""
        if not len({*self.robots}) == len(self.robots) == len(self.sizes) > 0 or min(self.sizes) < 1:
            raise ValueError(f"a table over {', '.join(self.robots)} has invalid domain sizes: {self.sizes}")
        if len(self.allowed) != -(-math.prod(self.sizes) // 8):
            raise ValueError(f"a table of {len(self.allowed)} bytes does not have a bit for each combination of values")

    def allows(self, places: Iterable[int]) -> bool:
        """Return whether the values with these indices (`places`) of the robots are allowed."""
        at = 0
        for place, size in zip(places, self.sizes, strict=True):
            at = at * size + place
        return bool(self.allowed[at >> 3] >> (at & 7) & 1)


def own_tables(
    problem: LocalProblem, linked: Iterable[str], domains: Mapping[str, Sequence[Value]]
) -> tuple[AllowedTable, ...]:
    """Return the constraints of `problem` with robots in `linked`, with one table for each set of robots."""
    allowed: dict[tuple[str, ...], Sequence[int]] = {}
    for lowest in linked:
        for table in problem.allowed(domains, lowest):
            others, masks = table.agents, table.joined()
            known = allowed.get(others)
            allowed[others] = [*map(and_, masks, known)] if known else masks
    return tuple([_table(problem, domains, others, masks) for others, masks in allowed.items()])


def distinct(tables: Iterable[AllowedTable]) -> list[AllowedTable]:
    """Return the first of `tables` for each set of robots: all of these robots send the same table."""
    found: dict[frozenset[str], AllowedTable] = {}
    for table in tables:
        found.setdefault(frozenset(table.robots), table)
    return list(found.values())


def sizes_in(tables: Iterable[AllowedTable], places: Mapping[str, int]) -> dict[str, int]:
    """Return the domain sizes of all robots in `tables`, whose values have the indices `places`.

    Raises:
        ValueError: if tables contradict each other or the indices.
    """
    sizes: dict[str, int] = {}
    for table in tables:
        for robot, size in zip(table.robots, table.sizes, strict=True):
            if sizes.setdefault(robot, size) != size or not 0 <= places[robot] < size:
                raise ValueError(f"messages contradict each other on the values of {robot}")
    return sizes


def _table(
    problem: LocalProblem,
    domains: Mapping[str, Sequence[Value]],
    others: tuple[str, ...],
    masks: Sequence[int],
) -> AllowedTable:
    """Return a table whose last robot is the robot of `problem`."""
    own = len(problem.values)
    bits = 0
    for row, mask in enumerate(masks):
        bits |= mask << row * own
    sizes = (*(len(domains[robot]) for robot in others), own)
    return AllowedTable((*others, problem.agent), sizes, bits.to_bytes(-(-len(masks) * own // 8), "little"))


class _Node(NamedTuple):
    """A partial assignment, the other robots' remaining domains (bitmaps), and the constraints each value breaks."""

    assigned: dict[str, int]
    left: dict[str, int]
    broken: dict[str, list[int]]
    cost: int


class _RestrictedTable:
    """A table restricted to the mediator's robots: the values of robots outside are fixed.

    `inside` are the robots whose values the mediator chooses. `hard`: all robots in the table are inside.
    """

    def __init__(self, table: AllowedTable, members: Mapping[str, int], places: Mapping[str, int]) -> None:
        self._allowed = table.allowed
        self._strides: dict[str, int] = {}
        self._base = 0
        stride = math.prod(table.sizes)
        for robot, size in zip(table.robots, table.sizes, strict=True):
            stride //= size
            if robot in members:
                self._strides[robot] = stride
            else:
                self._base += stride * places[robot]
        self.inside = tuple(self._strides)
        self.hard = len(self.inside) == len(table.robots)

    def mask(self, robot: str, assigned: Mapping[str, int], left: int) -> int:
        """Return the values of `robot` in `left` that are allowed when all other robots inside are assigned."""
        base = self._base + sum(
            [stride * assigned[name] for name, stride in self._strides.items() if name != robot], start=0
        )
        stride = self._strides[robot]
        mask = 0
        for value in _values(left):
            bit = base + stride * value
            if self._allowed[bit >> 3] >> (bit & 7) & 1:
                mask |= 1 << value
        return mask


class Mediation:
    """One mediator's problem. `checks` counts its constraint checks."""

    def __init__(self, tables: Sequence[AllowedTable], members: Mapping[str, int], places: Mapping[str, int]) -> None:
        """Select the tables that contain at least one of `members`.

        Args:
            tables: all constraints of the members.
            members: the robots whose values are chosen, in priority order, with their domain sizes.
            places: the current values of the members and of all other robots in tables, as indices in their domains.
        """
        self.checks = 0
        self._members = members
        self._places = places
        self._restricted = [_RestrictedTable(table, members, places) for table in tables]
        self._of: dict[str, list[_RestrictedTable]] = {name: [] for name in members}
        for table in self._restricted:
            for name in table.inside:
                self._of[name].append(table)
        self._least = len(tables) + 1
        """The number of constraints that the best assignment so far breaks."""

    def best(self) -> dict[str, int] | None:
        """Return the best assignment of the members; None if their constraints allow no assignment."""
        found: dict[str, int] | None = None
        open_nodes = [iter([node] if (node := self._root()) else [])]
        while open_nodes and self._least:
            child = next(open_nodes[-1], None)
            if child is None:
                open_nodes.pop()
            elif child.left:
                open_nodes.append(self._children(child))
            elif child.cost < self._least:
                found, self._least = child.assigned, child.cost
        return found

    def _root(self) -> _Node | None:
        """Return the empty assignment; None if a robot has no value left."""
        node: _Node | None = _Node({}, {name: (1 << size) - 1 for name, size in self._members.items()}, {}, 0)
        for table in self._restricted:
            if node is not None and len(table.inside) == 1:
                node = self._pruned(node, table, table.inside[0])
        return node

    def _children(self, node: _Node) -> Iterator[_Node]:
        """Yield `node` extended by each value of the next robot, except those that cannot improve on the best."""
        robot = min(node.left, key=lambda name: node.left[name].bit_count())
        prices = node.broken.get(robot)
        current = self._places[robot]
        left = {name: values for name, values in node.left.items() if name != robot}
        rest = sum(
            [
                min(broken[value] for value in _values(left[name]))
                for name, broken in node.broken.items()
                if name in left
            ]
        )
        priced = [(prices[value] if prices else 0, value != current, value) for value in _values(node.left[robot])]
        for price, _, value in sorted(priced):
            cost = node.cost + price
            if cost + rest >= self._least:
                return
            child: _Node | None = _Node({**node.assigned, robot: value}, {**left}, node.broken, cost)
            for table in self._of[robot]:
                ahead = [name for name in table.inside if name in left]
                if child is not None and len(ahead) == 1:
                    child = self._pruned(child, table, ahead[0])
            if child is not None:
                yield child

    def _pruned(self, node: _Node, table: _RestrictedTable, robot: str) -> _Node | None:
        """Return `node` after forward checking with a table in which only `robot` is open; None if no value is left."""
        left = node.left[robot]
        self.checks += left.bit_count()
        mask = table.mask(robot, node.assigned, left)
        if table.hard:
            node.left[robot] = mask
            return node if mask else None
        if mask == left:
            return node
        prices = list(node.broken.get(robot) or [0] * self._members[robot])
        for value in _values(left & ~mask):
            prices[value] += 1
        return node._replace(broken={**node.broken, robot: prices})


def allows(table: AllowedTable, places: Mapping[str, int]) -> bool:
    """Return whether `table` allows these values."""
    bit = 0
    for robot, size in zip(table.robots, table.sizes, strict=True):
        bit = bit * size + places[robot]
    return bool(table.allowed[bit >> 3] >> (bit & 7) & 1)


def _values(mask: int) -> Iterator[int]:
    """Yield the indices of the bits in `mask`."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low
