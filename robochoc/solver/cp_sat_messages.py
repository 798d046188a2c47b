"""The messages between the process of OR-Tools and its parent: msgpack, each after its length."""

from __future__ import annotations

import struct

import msgspec

LENGTH = struct.Struct("!Q")


class CpSatTable(msgspec.Struct, frozen=True, array_like=True):
    """A table: the code tuples `rows`, that the variables at the places `scope` may have, or may not."""

    scope: tuple[int, ...]
    allowed: bool
    rows: tuple[tuple[int, ...], ...]


class CpSatComparison(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The sum of `terms` (places of variables with factors) compared by `sign` ("le", "eq", "ne") with `bound`."""

    terms: tuple[tuple[int, int], ...]
    sign: str
    bound: int


class CpSatJunction(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """A conjunction (`every`) or disjunction of `parts`."""

    every: bool
    parts: tuple[CpSatComparison | CpSatJunction, ...]


class CpSatTask(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Find one solution; with `costs`, one with the least sum of these codes.

    A cost is the place of a variable, and the unit of its codes. `domains` holds each variable's codes, `deadline` the
    end of the time on the monotonic clock, which all processes of a machine share (None: there is no limit).
    """

    domains: tuple[tuple[int, ...], ...]
    tables: tuple[CpSatTable, ...]
    costs: tuple[tuple[int, int], ...] = ()
    deadline: float | None = None
    formulas: tuple[CpSatComparison | CpSatJunction, ...] = ()


class CpSatAnswer(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The codes of a solution, if one was found; whether nothing is better (or there is none); a bound on its cost."""

    codes: tuple[int, ...] | None
    proven: bool
    bound: int = 0


class CpSatFailed(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """It went wrong; `missing`: because OR-Tools is not there."""

    why: str
    missing: bool = False


FromCpSat = CpSatAnswer | CpSatFailed
