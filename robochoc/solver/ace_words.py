"""What the solver's process and its parent say to each other: msgpack, each word after its length."""

from __future__ import annotations

import struct
from typing import Literal

import msgspec

LENGTH = struct.Struct("!Q")

Strategy = Literal["default", "static"]
"""How ACE searches: as it does by itself (weighted degrees, restarts), or in the order of the variables."""


class TableForm(msgspec.Struct, frozen=True, array_like=True):
    """A table, as in `encoding.Table`; its rows are those at the place `rows` of the task."""

    scope: tuple[int, ...]
    allowed: bool
    rows: int


class Task(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Solve this network: all solutions up to `limit`, or only their number.

    `domains` holds each variable's codes, `different` scopes on which all differ.
    """

    domains: list[list[int]]
    tables: list[TableForm]
    rows: list[list[list[int]]]
    different: list[list[int]]
    limit: int | None
    count_only: bool
    strategy: Strategy


class Export(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Write this network as an XCSP3 document; variables are called `names`, and codes are values."""

    names: list[str]
    task: Task


class Solved(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """`found` solutions, `complete` if there are no others; `solutions` are their codes, four bytes each."""

    found: int
    complete: bool
    solutions: bytes


class Exported(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """The document."""

    xml: bytes


class Broken(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """It went wrong; `java_missing`: because there is no Java to run ACE with."""

    why: str
    java_missing: bool = False


ToSolver = Task | Export
FromSolver = Solved | Exported | Broken
