"""The messages between the process of an external solver and its parent: msgpack, each after its length."""

from __future__ import annotations

import struct

import msgspec

LENGTH = struct.Struct("!Q")
MAX_LENGTH = 1 << 28
"""The maximum size of an answer, in bytes."""


class TaskTable(msgspec.Struct, frozen=True, array_like=True):
    """A table: `rows` are the allowed, or the forbidden, code tuples of the variables at positions `scope`."""

    scope: tuple[int, ...]
    allowed: bool
    rows: tuple[tuple[int, ...], ...]


class TaskComparison(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The sum of `terms` (positions of variables with factors) compared by `sign` ("le", "eq", "ne") with `bound`."""

    terms: tuple[tuple[int, int], ...]
    sign: str
    bound: int


class TaskJunction(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """A conjunction (`every`) or disjunction of `parts`."""

    every: bool
    parts: tuple[TaskComparison | TaskJunction, ...]


class NetworkTask(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Find one solution; with `costs`, a solution with the least sum of the codes at these positions.

    A cost is the position of a variable and the unit of its codes. `domains` has the codes of each variable. `deadline`
    is on the monotonic clock, which all processes on a machine share (None: no limit).
    """

    domains: tuple[tuple[int, ...], ...]
    tables: tuple[TaskTable, ...]
    costs: tuple[tuple[int, int], ...] = ()
    deadline: float | None = None
    formulas: tuple[TaskComparison | TaskJunction, ...] = ()


class TaskAnswer(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The codes of a solution, if found; whether it is proven (or that there is none); a lower bound on the cost."""

    codes: tuple[int, ...] | None
    proven: bool
    bound: int = 0


class TaskFailed(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """An error; `missing` if the solver's package cannot be imported."""

    why: str
    missing: bool = False


FromSolver = TaskAnswer | TaskFailed
