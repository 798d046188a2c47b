"""Whatever a protocol keeps, in a few words: bounded in length, depth and size, and never raising.

Protocols, ours and others', may keep anything: what is not known here is shown by what it is made of.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import islice

import msgspec

from robochoc.protocols.order import PriorityOrder
from robochoc.replay.value_text import cut
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.compiled import LocalProblem

DEEPEST = 3
"""So many levels of what things are made of are shown."""
MOST = 12
"""Of a collection, so many entries."""
LONGEST = 200
_SETTING = (LocalProblem, PriorityOrder, AgentProblem)
"""What many things hold, and what says nothing of them."""


def safe_repr(thing: object) -> str:
    """`thing` in at most `LONGEST` characters."""
    try:
        if isinstance(thing, PriorityOrder):
            return cut(" > ".join(thing.names), LONGEST)
        return cut(_shown(thing, DEEPEST), LONGEST)
    except Exception as error:  # noqa: BLE001 - somebody else's object may do anything when it is looked at
        return f"a {type(thing).__name__} that cannot be shown ({type(error).__name__})"


def _shown(thing: object, depth: int) -> str:
    plain = _plain(thing)
    if plain is not None or not depth:
        return plain or "..."
    if isinstance(thing, Mapping):
        return _listed((f"{_shown(k, depth - 1)}: {_shown(v, depth - 1)}" for k, v in thing.items()), len(thing))
    fields = getattr(type(thing), "_fields", None)
    if isinstance(thing, tuple) and isinstance(fields, tuple):  # a named one
        return _named(type(thing).__name__, zip(fields, thing, strict=False), depth)
    if isinstance(thing, Sequence | AbstractSet | deque):
        parts: Iterator[str] = (_shown(part, depth - 1) for part in thing)
        if isinstance(thing, AbstractSet) and len(thing) <= MOST:
            parts = iter(sorted(parts))
        listed = _listed(parts, len(thing))
        return f"({listed})" if thing and depth < DEEPEST else listed
    return _object(thing, depth)


def _plain(thing: object) -> str | None:
    """What is not made of anything else; None where `thing` is."""
    match thing:
        case None:
            return "none"
        case bool():
            return "yes" if thing else "no"
        case int() | float():
            return _number(thing)
        case str():
            return cut(thing)
        case bytes() | bytearray() | memoryview():
            return f"{len(thing):,} bytes"
        case _:
            return None


def _number(number: float) -> str:
    return f"{number:,}" if isinstance(number, int) and number.bit_length() < LONGEST else f"{number:g}"


def _object(thing: object, depth: int) -> str:
    name = type(thing).__name__
    if isinstance(thing, msgspec.Struct):
        return _named(name, ((field, getattr(thing, field)) for field in thing.__struct_fields__), depth)
    shape = getattr(thing, "shape", None)
    if isinstance(shape, tuple):  # numpy's, which is not imported for the sake of one question
        return f"a table of {' x '.join(map(str, shape))}"
    if callable(thing):
        return getattr(thing, "__name__", name)
    own = getattr(thing, "__dict__", None)
    return _named(name, own.items(), depth) if isinstance(own, dict) else f"a {name}"


def _named(name: str, fields: Iterable[tuple[str, object]], depth: int) -> str:
    own = ((field, value) for field, value in fields if not isinstance(value, _SETTING))
    told = [f"{field.lstrip('_')} {_shown(value, depth - 1)}" for field, value in islice(own, MOST)]
    return f"{name}({', '.join(told)})" if told else name


def _listed(parts: Iterator[str], count: int) -> str:
    """The first entries, and how many more there are."""
    shown = list(islice(parts, MOST))
    if not shown:
        return "nothing"
    more = f", {count - len(shown):,} more" if count > len(shown) else ""
    return f"{', '.join(shown)}{more}"
