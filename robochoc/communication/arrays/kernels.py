"""The compiled cycles of DSA and MGM (`_kernels.c`), with the same results as numpy."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robochoc.communication.arrays.array_types import Integers
from robochoc.communication.arrays.compiled import start_of
from robochoc.communication.arrays.layout import ArrayLayout, RobotGroup
from robochoc.system.posix import usable_processors

LARGEST_VALUE_SIZE = 2
"""The largest size in bytes of values for which there are compiled functions."""
ROWS_PER_THREAD = 50_000
"""The fewest rows for which another thread saves time."""


def _structure(fields: str) -> type[ctypes.Structure]:
    """Return a structure of 64-bit fields, as in `_kernels.c`."""
    return type("Fields", (ctypes.Structure,), {"_fields_": [(name, ctypes.c_int64) for name in fields.split()]})


_Block = _structure("arity starts bases others strides rows")
_Group = _structure("first size blocks_count blocks fixed charges")
_Team = _structure("bits states steps starts degrees robots neighbours")


class CycleAccount:
    """The cost of a team's values, and the sizes of messages, as counted by each thread.

    Each thread has a row: the bytes of all messages, the size of the largest message, and for the fixed costs and the
    constraints of each arity the violated constraints, and the low and high halves of the other costs.
    """

    def __init__(self, threads: int, most_arity: int) -> None:
        self.rows = np.zeros((threads, 2 + 3 * (most_arity + 1)), np.int64)

    @property
    def bytes(self) -> int:
        """The number of bytes of all messages."""
        return int(self.rows[:, 0].sum())

    @property
    def largest(self) -> int:
        """The size of the largest message in bytes."""
        return int(self.rows[:, 1].max())

    @property
    def sums(self) -> list[tuple[int, int]]:
        """The number of violated constraints and the other costs, by the number of robots that count each cost - 1."""
        totals = self.rows[:, 2:].sum(axis=0).reshape(-1, 3).tolist()
        return [(broken, low + (high << 32)) for broken, low, high in totals]


class Kernels:
    """The compiled functions for one run.

    Args:
        library: The functions in C.
        layout: The team.
        states: The states of the robots' random numbers, which are changed.
        steps: The steps of the robots' random numbers.
    """

    def __init__(
        self,
        library: ctypes.CDLL,
        layout: ArrayLayout,
        states: NDArray[np.uint64],
        steps: NDArray[np.uint64],
    ) -> None:
        self._library = library
        self._functions: dict[str, Callable[..., int]] = {}
        self._layout = layout
        self._in_use: list[object] = []
        """The arrays and structures whose addresses are stored."""
        self._types = f"_{layout.costs.kind}_t_{layout.kind}_t"
        self._groups = [self._group(group) for group in layout.groups]
        arrays = (states, steps, layout.starts, layout.degrees, layout.robots, layout.neighbours)
        team = _Team(layout.costs.bits, *map(self._address, arrays))
        self._in_use.append(team)
        self._team = ctypes.addressof(team)
        arities = (block.others.shape[1] for group in layout.groups for block in group.blocks)
        self._most_arity = max(arities, default=0)
        self._threads = max(1, min(usable_processors(), layout.many // ROWS_PER_THREAD))
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._unused = self._account()

    def value_costs(self, values: Integers) -> tuple[list[Integers], CycleAccount]:
        """Return the cost of each value of robots with neighbours, by group, and the cost of the current values."""
        account, found = self._account(), []
        for group, fields in zip(self._layout.groups, self._groups, strict=True):
            total = np.empty((group.active, group.size), self._layout.costs.kind)
            self._call("value_costs", group.active, account, fields, start_of(values), start_of(total))
            found.append(total)
        return found, account

    def dsa(
        self, values: Integers, sideways: int, probability: float, probability_of_gain: float
    ) -> tuple[Integers, CycleAccount]:
        """Return the values after a cycle of DSA, and the cost of the values before it."""
        account, after = self._account(), values.copy()
        chance = (sideways, float(probability), float(probability_of_gain))
        for group, fields in zip(self._layout.groups, self._groups, strict=True):
            self._call("dsa", group.active, account, fields, start_of(values), start_of(after), *chance)
        return after, account

    def best_unilateral(self, values: Integers, rest: int) -> tuple[Integers, Integers, CycleAccount]:
        """Return the best unilateral moves, their gains, and the cost of `values` before the moves.

        The gains are sent in messages of `rest` bytes and two numbers.
        """
        account, targets = self._account(), values.copy()
        gains = np.zeros(self._layout.many, self._layout.costs.kind)
        addresses = (start_of(values), start_of(targets), start_of(gains), rest)
        for group, fields in zip(self._layout.groups, self._groups, strict=True):
            self._call("best_unilateral", group.active, account, fields, *addresses)
        return targets, gains, account

    def move_winners(self, values: Integers, targets: Integers, gains: Integers) -> None:
        """Set the robots that gain most among their neighbours to their `targets`."""
        addresses = (start_of(values), start_of(targets), start_of(gains))
        self._call("move_winners", self._layout.many, self._unused, *addresses)

    def _account(self) -> CycleAccount:
        return CycleAccount(self._threads, self._most_arity)

    def _call(self, name: str, many: int, account: CycleAccount, *words: float) -> None:
        """Call the function `name` for `many` rows, with the rows shared by the threads."""
        function = self._functions.get(name)
        if function is None:
            function = self._functions[name] = getattr(self._library, name + self._types)
            kinds = [ctypes.c_int64 if isinstance(word, int) else ctypes.c_double for word in words]
            function.argtypes = [ctypes.c_int64, *kinds, *[ctypes.c_int64] * 3]
        if self._pool is None:
            self._check(function(self._team, *words, start_of(account.rows), 0, many))
            return
        bounds = (many * number // self._threads for number in range(self._threads + 1))
        parts = zip(map(start_of, account.rows), pairwise(bounds), strict=True)
        for failed in self._pool.map(lambda part: function(self._team, *words, part[0], *part[1]), parts):
            self._check(failed)

    @staticmethod
    def _check(failed: int) -> None:
        if failed:
            raise MemoryError

    def _group(self, group: RobotGroup) -> int:
        """Return the address of the structure of a group."""
        blocks = (_Block * len(group.blocks))()
        for fields, block in zip(blocks, group.blocks, strict=True):
            fields.arity = block.others.shape[1]
            fields.starts = self._address(np.concatenate([[0], np.cumsum(block.lengths)]))
            fields.bases = 0 if block.bases is None else self._address(block.bases)
            fields.others = self._address(block.others)
            fields.strides = self._address(np.array(block.strides, np.int64))
            fields.rows = self._address(block.rows)
        costs = (0 if costs is None else self._address(costs) for costs in (group.fixed, group.charges))
        fields = _Group(group.first, group.size, len(group.blocks), ctypes.addressof(blocks), *costs)
        self._in_use += [blocks, fields]
        return ctypes.addressof(fields)

    def _address(self, array: Integers) -> int:
        self._in_use.append(array)
        return start_of(array)
