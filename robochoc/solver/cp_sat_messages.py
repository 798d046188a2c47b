"""The messages between the OR-Tools process and its parent: msgpack, each after its length. Imports neither."""

from __future__ import annotations

import struct

import msgspec

LENGTH = struct.Struct("!Q")


class CpSatTable(msgspec.Struct, frozen=True, array_like=True):
    """A table: `rows` are the allowed, or the forbidden, code tuples of the variables at positions `scope`."""

    scope: tuple[int, ...]
    allowed: bool
    rows: tuple[tuple[int, ...], ...]


class CpSatComparison(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The sum of `terms` (positions of variables with factors) compared by `sign` ("le", "eq", "ne") with `bound`."""

    terms: tuple[tuple[int, int], ...]
    sign: str
    bound: int


class CpSatJunction(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """A conjunction (`every`) or disjunction of `parts`."""

    every: bool
    parts: tuple[CpSatComparison | CpSatJunction, ...]


class CpSatTask(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Find one solution; with `costs`, a solution with the least sum of the codes at these positions.

    A cost is the position of a variable and the unit of its codes. `domains` has the codes of each variable. `deadline`
    is on the monotonic clock, which all processes on a machine share (None: no limit).
    """

    domains: tuple[tuple[int, ...], ...]
    tables: tuple[CpSatTable, ...]
    costs: tuple[tuple[int, int], ...] = ()
    deadline: float | None = None
    formulas: tuple[CpSatComparison | CpSatJunction, ...] = ()


class CpSatAnswer(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The codes of a solution, if found; whether it is proven (or that there is none); a lower bound on the cost."""

    codes: tuple[int, ...] | None
    proven: bool
    bound: int = 0


class CpSatFailed(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """An error; `missing` if OR-Tools is not installed."""

    why: str
    missing: bool = False


FromCpSat = CpSatAnswer | CpSatFailed
