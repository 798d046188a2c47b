"""The messages between ACE's process and its parent: msgpack, each after its length. Needs no parent's imports."""

from __future__ import annotations

import re
import struct
from array import array
from typing import Literal

import msgspec

BEST = "best"
"""The file in the solver's folder with ACE's output while it minimises: the solutions, by decreasing cost."""

LENGTH = struct.Struct("!Q")

_VALUES = re.compile(rb"<values>([^<]*)</values>")

Strategy = Literal["default", "static"]
"""ACE's search strategy: its default (weighted degrees, restarts), or a static variable order."""


def codes_of(output: bytes, width: int) -> array[int]:
    """Return the codes of all solutions in ACE's output, `width` codes for each. Raises `ValueError`."""
    numbers = array("i", map(int, b" ".join(_VALUES.findall(output)).split()))
    if len(numbers) % width:
        raise ValueError("values are missing in ACE's answer")
    return numbers


class EncodedTable(msgspec.Struct, frozen=True, array_like=True):
    """An `encoding.CodeTable` whose rows are at the index `rows` in the `rows` of the task."""

    scope: tuple[int, ...]
    allowed: bool
    rows: int


class AceTask(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Solve this network: return all solutions up to `limit`, or only their number, or a cheapest solution.

    Attributes:
        domains: The codes of each variable.
        tables: The tables.
        rows: The rows of the tables.
        different: Scopes in which all values differ.
        limit: The maximum number of solutions.
        count_only: True if only the number is returned.
        strategy: ACE's search strategy.
        costs: Positions of variables, with units: the cost is the sum of their codes times the units.
        formulas: XCSP3 predicates over `x0`, `x1`, ...
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


class AceExport(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Write this network as an XCSP3 document; `names` are the names of the variables, and codes are values."""

    names: list[str]
    task: AceTask


class AceSolutions(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """`found` solutions, `complete` if there are no others; `solutions` contains their codes, four bytes each.

    If costs are minimised: at most one solution, `complete` if none is cheaper.
    """

    found: int
    complete: bool
    solutions: bytes


class AceExported(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The XCSP3 document."""

    xml: bytes


class AceFailed(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """An error; `java_missing` if the cause is missing Java."""

    why: str
    java_missing: bool = False


ToAce = AceTask | AceExport
FromAce = AceSolutions | AceExported | AceFailed
