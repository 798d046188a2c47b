"""The extents of terms: how deep and how large they are, written out. Both are limited where a term is made."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Protocol

from robochoc.modelling.places import ModelError

MAX_DEPTH = 200
MAX_TERMS = 1_000_000


class Extent(NamedTuple):
    """How deep a term is, and how many terms are in it; one that stands there twice counts twice."""

    depth: int
    terms: int


ALONE = Extent(0, 1)
"""The extent of a variable or a constant."""


class _Extended(Protocol):
    @property
    def extent(self) -> Extent: ...


def extent_of(arguments: Iterable[_Extended]) -> Extent:
    """Return the extent of a term of `arguments`. Raises `ModelError` if it is too deep, or too large."""
    depth, terms = 0, 1
    for one in arguments:
        depth = max(depth, one.extent.depth)
        terms += one.extent.terms
    if depth >= MAX_DEPTH:
        hint = "let a variable stand for a part of it, or make a Python function of it"
        raise ModelError(f"a term of more than {MAX_DEPTH} levels", hint)
    if terms > MAX_TERMS:
        hint = "a term that stands in itself several times doubles at each step: let a variable stand for it"
        raise ModelError(f"a term that, written out, has more than {MAX_TERMS:,} terms", hint)
    return Extent(depth + 1, terms)
