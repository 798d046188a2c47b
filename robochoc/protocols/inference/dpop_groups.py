"""Tables in DPOP over the variables that constraints name, and their division into independent groups (see `dpop`).

A constraint may name some of a robot's variables only. Its table then does not distinguish all values of the robot: a
`Partition` gives the code of each value, the same for values that are not distinguished. Tables with different
partitions are joined over their common refinement, which contains only combinations that the robot really has.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.inference.dpop_tables import Places, place_type
from robochoc.protocols.message import Value

Partition = Places | None
"""The code of each value of a robot, in the order of first occurrence. None: all values are distinguished."""


NO_AXIS: Places = np.zeros(1, np.intp)
"""The partition of a robot's values for a table that does not distinguish them."""

MOST_LINKED = 10
"""The maximum number of linked variables whose subsets are examined."""


def partition_of(values: Sequence[Value], places: Sequence[int]) -> Partition:
    """Return the partition of a robot's `values` by the variables at `places`.

    Raises:
        ValueError: if a value has too few parts.
    """
    if values and len(places) == len(values[0]):
        return None
    try:
        codes = _codes(values, places)
    except IndexError:
        raise ValueError(f"a value has too few parts: it needs {max(places) + 1}") from None
    return None if len(codes) and codes.max() + 1 == len(codes) else codes


def _codes(values: Sequence[Value], places: Sequence[int]) -> Places:
    """Return the code of each value by the variables at `places`."""
    found: dict[Value, int] = {}
    return np.array(
        [found.setdefault(tuple([value[place] for place in places]), len(found)) for value in values], np.intp
    )


def distinguishes(partition: Partition) -> bool:
    """Return whether `partition` distinguishes any values."""
    return partition is None or bool(partition.any())


def code_of(partition: Partition, value: int) -> int:
    """Return the code of a value."""
    return value if partition is None else int(partition[value])


def length_of(partition: Partition, size: int) -> int:
    """Return the number of codes for a robot with `size` values."""
    return size if partition is None else int(partition.max()) + 1


def places_of(partition: Partition, size: int) -> Places:
    """Return the first value with each code, for a robot with `size` values."""
    return np.arange(size) if partition is None else np.unique(partition, return_index=True)[1]


def encoded(partition: Partition, size: int) -> bytes:
    """Return the codes of a robot's `size` values for a message."""
    return b"" if partition is None else partition.astype(place_type([size])).tobytes()


def decoded(codes: bytes, size: int) -> Partition:
    """Return the partition of a robot's `size` values in a message.

    Raises:
        ValueError: if these are not the codes of so many values, numbered in the order of first occurrence.
    """
    if not codes:
        return None
    kind = place_type([size])
    if len(codes) != size * kind.itemsize:
        raise ValueError(f"{len(codes):,} bytes are not the codes of {size:,} values")
    partition = np.frombuffer(codes, kind).astype(np.intp)
    first = np.concatenate([[-1], np.maximum.accumulate(partition)[:-1]]) + 1
    if (partition > first).any() or not 1 < length_of(partition, size) < size:
        raise ValueError(f"the codes of {size:,} values are not numbered in the order of first occurrence")
    return partition


def refined(one: Partition, other: Partition) -> Partition:
    """Return the common refinement of two partitions: values with the same code in both have the same code."""
    if one is NO_AXIS or other is NO_AXIS:
        return other if one is NO_AXIS else one
    if one is None or other is None:
        return None
    return one if one is other else _numbered(one * (int(other.max()) + 1) + other)


def is_finer(one: Partition, other: Partition) -> bool:
    """Return whether `one` distinguishes all values that `other` distinguishes."""
    if one is None or other is None:
        return one is None
    return length_of(refined(one, other), len(one)) == length_of(one, len(one))


def mapped(coarser: Partition, places: Places) -> Places | None:
    """Return the code in the partition `coarser` for each of the values `places`; None if these are 0, 1, 2, ..."""
    found = places if coarser is None else coarser[places]
    return None if np.array_equal(found, np.arange(len(found))) else found


def _numbered(codes: Places) -> Partition:
    """Return the partition with these codes, numbered in the order of first occurrence."""
    _, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
    if len(first) == len(codes):
        return None
    rank = np.empty(len(first), np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse]


class Outline(NamedTuple):
    """A table before it is made: the maximum cost in it, and the partition of each robot's values on its axes."""

    dearest: int
    axes: Mapping[str, Partition]

    def shape(self, sizes: Mapping[str, int]) -> list[int]:
        """Return the shape for robots with these `sizes` of their domains."""
        return [length_of(partition, sizes[name]) for name, partition in self.axes.items()]


class Input(NamedTuple):
    """A table to be joined, without this robot's axis; and the partition of this robot's values on that axis."""

    outline: Outline
    own: Partition

    @property
    def is_whole(self) -> bool:
        """True if the table distinguishes all values of the robots on its axes."""
        return (self.own is None or self.own is NO_AXIS) and all(axis is None for axis in self.outline.axes.values())


class Group(NamedTuple):
    """Tables that are joined and minimised over this robot's values.

    Attributes:
        inputs: The indices of the tables.
        parts: The independent parts of this robot's values (`Parts`) that the tables depend on.
        values: For each index on this robot's axis in the join, its value. The group determines only its `parts`.
        charges: The private cost of each of these values.
        result: The table that results.
    """

    inputs: tuple[int, ...]
    parts: frozenset[int]
    values: Places
    charges: Sequence[float]
    result: Outline


class Parts:
    """The independent parts of a robot's values: the finest sets of variables whose values can be chosen separately.

    Sets of variables are independent if the robot's values are all combinations of the sets' values, and the private
    costs are sums of costs for each set.

    Attributes:
        codes: For each part, the code of each value.
        cheapest: The first value with the least private cost.
    """

    def __init__(self, values: Sequence[Value], charges: Sequence[float]) -> None:
        self._charges = np.array(charges, np.float64)
        columns = [_codes(values, [place]) for place in range(len(values[0]))]
        self.codes = [_codes(values, part) for part in _independent(columns, self._charges)]
        self.cheapest = int(self._charges.argmin())

    def touched(self, own: Partition) -> frozenset[int]:
        """Return the parts that a table depends on, given the partition of the robot's values on its axis."""
        every = range(len(self.codes))
        if own is None or own is NO_AXIS:
            return frozenset(every if own is None else ())
        return frozenset([part for part in every if len(every) == 1 or self._depends(own, part)])

    def _depends(self, own: Places, part: int) -> bool:
        rest = _joint([codes for number, codes in enumerate(self.codes) if number != part])
        return len(np.unique(rest * (int(own.max()) + 1) + own)) > len(np.unique(rest))

    def values_of(self, parts: frozenset[int], own: Partition) -> tuple[Places, NDArray[np.float64]]:
        """Return the cheapest value with each code of `own`, and its cost beyond that of the cheapest of all.

        Only values that equal the `cheapest` value outside `parts` are considered. Ties go to the first value.
        """
        others = [codes == codes[self.cheapest] for part, codes in enumerate(self.codes) if part not in parts]
        values = np.flatnonzero(np.logical_and.reduce(others)) if others else np.arange(len(self._charges))
        charges = self._charges[values] - self.least
        if own is NO_AXIS:
            own = np.zeros(len(self._charges), np.intp)
        if own is not None:
            order = np.argsort(charges, kind="stable")
            first = np.sort(order[np.unique(own[values][order], return_index=True)[1]])
            values, charges = values[first], charges[first]
        return values, charges

    @property
    def least(self) -> float:
        """The cost that the `charges` of groups do not contain."""
        least = float(self._charges[self.cheapest])
        return least if least < math.inf else 0.0

    def value(self, chosen: Iterable[tuple[Group, int]]) -> int:
        """Return the value whose parts are as in the values that the groups have chosen."""
        matches = np.ones(len(self._charges), bool)
        wanted = dict.fromkeys(range(len(self.codes)), self.cheapest)
        for group, value in chosen:
            wanted.update(dict.fromkeys(group.parts, value))
        for part, value in wanted.items():
            matches &= self.codes[part] == self.codes[part][value]
        return int(matches.argmax())


def divided(parts: Parts, inputs: Sequence[Input], sizes: Mapping[str, int]) -> list[Group]:
    """Divide tables into groups that this robot's values do not connect.

    A table that does not depend on this robot's values is added to a group whose result contains all its axes. If there
    is none, it forms a group of its own, with one index on the axis of this robot.

    Args:
        parts: The independent parts of this robot's values.
        inputs: The tables.
        sizes: The sizes of the other robots' domains.
    """
    drafts: list[tuple[frozenset[int], list[int]]] = []
    free: list[int] = []
    for number, one in enumerate(inputs):
        here = parts.touched(one.own)
        if not here:
            free.append(number)
            continue
        linked = [draft for draft in drafts if not here.isdisjoint(draft[0])]
        numbers = [*itertools.chain.from_iterable(draft[1] for draft in linked), number]
        drafts = [draft for draft in drafts if draft not in linked]
        drafts.append((here.union(*(draft[0] for draft in linked)), numbers))
    free.sort(key=lambda number: -math.prod(inputs[number].outline.shape(sizes)))
    if not drafts:
        drafts.append((frozenset(), free[:1]))
        del free[:1]
    found = [(here, numbers, _joined_axes([inputs[number] for number in numbers])) for here, numbers in drafts]
    for number in free:
        axes = inputs[number].outline.axes
        home = next((numbers for _, numbers, onto in found if _contains(onto, axes)), None)
        if home is None:
            found.append((frozenset(), [number], dict(axes)))
        else:
            home.append(number)
    groups: list[Group] = []
    for here, numbers, axes in found:
        values, charges = parts.values_of(here, _joint_partition([inputs[number].own for number in numbers]))
        if not groups:
            charges = charges + parts.least
        dearest = int(charges[np.isfinite(charges)].max(initial=0))
        dearest += sum(inputs[number].outline.dearest for number in numbers)
        groups.append(Group(tuple(sorted(numbers)), here, values, charges.tolist(), Outline(dearest, axes)))
    return groups


def _joint_partition(partitions: Sequence[Partition]) -> Partition:
    """Return the common refinement of `partitions`."""
    return functools.reduce(refined, partitions, cast("Partition", NO_AXIS))


def _joined_axes(inputs: Sequence[Input]) -> dict[str, Partition]:
    """Return the axes of the join of some tables."""
    axes: dict[str, Partition] = {}
    for one in inputs:
        for name, partition in one.outline.axes.items():
            axes[name] = refined(axes[name], partition) if name in axes else partition
    return axes


def _contains(onto: Mapping[str, Partition], axes: Mapping[str, Partition]) -> bool:
    """Return whether a table with the axes `onto` distinguishes everything that one with `axes` distinguishes."""
    return all(name in onto and is_finer(onto[name], partition) for name, partition in axes.items())


def _independent(columns: Sequence[Places], charges: NDArray[np.float64]) -> list[list[int]]:
    """Divide a robot's variables into independent sets. `columns`: for each variable, the code of each value.

    Of more than `MOST_LINKED` variables that are not independent of all others, no smaller sets are looked for.
    """
    left = list(range(len(columns)))
    found = []
    for place in range(len(columns)):
        if len(left) > 1 and _are_independent(columns, [place], charges):
            found.append([place])
            left.remove(place)
    while left:
        others = left[1:] if len(left) <= MOST_LINKED else []
        subsets = itertools.chain.from_iterable(
            itertools.combinations(others, count) for count in range(1, len(others))
        )
        parts = ([left[0], *chosen] for chosen in subsets)
        part = next((part for part in parts if _are_independent(columns, part, charges)), left)
        found.append(part)
        left = [place for place in left if place not in part]
    return sorted(found)


def _are_independent(columns: Sequence[Places], some: Sequence[int], charges: NDArray[np.float64]) -> bool:
    """Return whether the variables `some` are independent of all others."""
    here = _joint([columns[place] for place in some])
    there = _joint([column for place, column in enumerate(columns) if place not in some])
    rows, row = int(here.max()) + 1, int(there.max()) + 1
    if rows * row != len(charges) or not np.isfinite(charges).all():
        return False
    table = np.empty((rows, row))
    table[here, there] = charges
    return bool((table - table[:1] == table[:, :1] - table[0, 0]).all())


def _joint(columns: Sequence[Places]) -> Places:
    """Return the code of each value by several columns of codes."""
    joint = np.zeros_like(columns[0])
    for column in columns:
        joint = np.unique(joint * (int(column.max()) + 1) + column, return_inverse=True)[1]
    return joint
