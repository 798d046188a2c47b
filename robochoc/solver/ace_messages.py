"""The messages between the solver's process and its parent: msgpack, each after its length."""

from __future__ import annotations

import re
import struct
from array import array
from typing import Literal

import msgspec

BEST = "best"
"""The file in the solver's folder that holds what ACE prints while it minimises: the solutions, cheaper and cheaper."""

LENGTH = struct.Struct("!Q")

_VALUES = re.compile(rb"<values>([^<]*)</values>")

Strategy = Literal["default", "static"]
"""ACE's search strategy: its default (weighted degrees, restarts), or the static order of the variables."""


def codes_of(output: bytes, width: int) -> array[int]:
    """Return the codes of all solutions in what ACE has printed, `width` each. Raises `ValueError`."""
    numbers = array("i", map(int, b" ".join(_VALUES.findall(output)).split()))
    if len(numbers) % width:
        raise ValueError("ACE's answer has values missing")
    return numbers


class EncodedTable(msgspec.Struct, frozen=True, array_like=True):
    """A table, as in `encoding.Table`; its rows are those at the place `rows` of the task."""

    scope: tuple[int, ...]
    allowed: bool
    rows: int


class Task(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Solve this network: all solutions up to `limit`, or only their number, or one that costs least.

    `domains` holds each variable's codes, `different` scopes on which all differ. The cost of a
    solution is the sum of the codes at the places in `costs`, each times its unit; `costs` may be empty.
    `formulas` are predicates of XCSP3 over `x0`, `x1`, ...
    """

    domains: list[list[int]]
    tables: list[EncodedTable]
    rows: list[list[list[int]]]
    different: list[list[int]]
    limit: int | None
    count_only: bool
    strategy: Strategy
    costs: list[tuple[int, int]] = []
    formulas: list[str] = []


class Export(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Write this network as an XCSP3 document; variables are called `names`, and codes are values."""

    names: list[str]
    task: Task


class Solved(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """`found` solutions, `complete` if there are no others; `solutions` are their codes, four bytes each.

    Where costs are minimised: one solution at most, `complete` if none costs less.
    """

    found: int
    complete: bool
    solutions: bytes


class Exported(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The document."""

    xml: bytes


class SolverFailed(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """It went wrong; `java_missing`: because there is no Java to run ACE with."""

    why: str
    java_missing: bool = False


ToSolver = Task | Export
FromSolver = Solved | Exported | SolverFailed
