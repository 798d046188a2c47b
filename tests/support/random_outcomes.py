"""Random outcomes, with a value in every field: drawn by the fields' types, so that a new field has one, too."""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from decimal import Decimal
from enum import StrEnum
from random import Random
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from robochoc.model.outcome import Outcome

SYMBOLS = ("red", "green", "blue")
VARIABLES = ("a.x", "a.y", "b.z", "C", "D3.1")
NAMES = ("a", "b", "C", "D3.1", "the start", "a word or two")


Drawn = TypeVar("Drawn")


def random_outcome(chance: Random) -> Outcome:
    """Return an outcome. Values of `symbolic` variables are codes of `symbols`, as in real ones."""
    return drawn(Outcome, chance, {"symbols": SYMBOLS, "symbolic": tuple(chance.sample(VARIABLES, 2))})


def drawn(kind: type[Drawn], chance: Random, given: Mapping[str, object] = types.MappingProxyType({})) -> Drawn:
    """Return a random object of a type. `given`: values of some fields of the class."""
    found: Drawn = _drawn(kind, chance, given)
    return found


def _drawn(kind: Any, chance: Random, given: Mapping[str, object] = types.MappingProxyType({})) -> Any:  # noqa: ANN401, C901, PLR0911 - any type
    """Return a random object of a type. `given`: values of some fields of the class."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in {Union, types.UnionType}:
        return _drawn(chance.choice(arguments), chance)
    if origin is dict or origin is Mapping:
        keys = chance.sample(VARIABLES, chance.randrange(len(VARIABLES)))
        return {key: _drawn(arguments[1], chance) for key in keys}
    if origin is tuple:
        return tuple(_drawn(arguments[0], chance) for _ in range(chance.randrange(3)))
    if kind is type(None):
        return None
    if issubclass(kind, StrEnum):
        return chance.choice(list(kind))
    if kind is str:
        return chance.choice(NAMES)
    if kind is bool:
        return chance.random() < 1 / 2
    if kind is int:
        return chance.randrange(len(SYMBOLS) + 2)
    if kind is float:
        return chance.randrange(10**9) / 10**6
    if kind is Decimal:
        return Decimal(chance.randrange(-(10**12), 10**12)).scaleb(-chance.randrange(10))
    hints = get_type_hints(kind)
    names = [one.name for one in fields(kind)] if is_dataclass(kind) else kind._fields
    return kind(**{name: given[name] if name in given else _drawn(hints[name], chance) for name in names})
