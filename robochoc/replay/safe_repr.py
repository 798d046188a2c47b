"""A `repr` of any attribute of a protocol: bounded in length, depth and size. It never raises."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import islice

from robochoc.protocols.order import PriorityOrder
from robochoc.replay.value_text import cut
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiled_core import attributes_of

MAX_DEPTH = 3
MAX_ENTRIES = 12
"""The maximum number of items shown in a collection."""
MAX_LENGTH = 200
"""The maximum number of characters."""
_CONTEXT = (LocalProblem, PriorityOrder, AgentProblem)
"""Types of shared objects, which are not part of the state of objects that refer to them."""


def safe_repr(thing: object) -> str:
    """Return `thing` in at most `MAX_LENGTH` characters."""
    try:
        if isinstance(thing, PriorityOrder):
            return cut(" > ".join(thing.names), MAX_LENGTH)
        return cut(_repr.repr(thing), MAX_LENGTH)
    except Exception as error:  # noqa: BLE001 - the `repr` of a third-party object may raise anything
        return f"<{type(thing).__name__} cannot be shown: {type(error).__name__}>"


class _Repr(reprlib.Repr):
    """A `repr` that shows objects by their fields, subclasses as collections, and large bytes by their size."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = MAX_DEPTH
        self.maxdict = self.maxlist = self.maxtuple = self.maxset = self.maxfrozenset = self.maxdeque = MAX_ENTRIES
        self.maxstring = self.maxother = MAX_LENGTH

    def repr_int(self, number: int, level: int) -> str:
        return repr(number) if number.bit_length() < MAX_LENGTH else self.repr_float(float(number), level)

    def repr_float(self, number: float, _: int) -> str:
        return f"{number:g}"

    def repr_bytes(self, content: bytes, _: int) -> str:
        return f"<{len(content):,} bytes>"

    def repr_bool(self, flag: bool, _: int) -> str:  # noqa: FBT001 - as the others
        return str(flag)

    def repr_NoneType(self, nothing: None, _: int) -> str:  # noqa: N802 - the type's name
        return str(nothing)

    def repr_instance(self, thing: object, level: int) -> str:
        collection = _as_builtin(thing)
        if collection is not None:
            return self.repr1(collection, level)
        shape = getattr(thing, "shape", None)
        if isinstance(shape, tuple):  # a numpy array, recognised without importing numpy
            return f"<array of {' x '.join(map(str, shape))}>"
        if callable(thing):
            return getattr(thing, "__name__", type(thing).__name__)
        return self._fields_of(type(thing).__name__, _fields(thing), level)

    def _fields_of(self, name: str, fields: Iterable[tuple[str, object]], level: int) -> str:
        if level <= 0:
            return f"{name}(...)"
        own = ((field, value) for field, value in fields if not isinstance(value, _CONTEXT))
        shown = [f"{field.lstrip('_')}={self.repr1(value, level - 1)}" for field, value in islice(own, MAX_ENTRIES)]
        return f"{name}({', '.join(shown)})"


def _as_builtin(thing: object) -> dict[object, object] | list[object] | set[object] | None:
    """Return a collection of another type as a built-in collection; None if `thing` is not a collection."""
    if isinstance(thing, Mapping):
        return dict(islice(thing.items(), MAX_ENTRIES + 1))
    if isinstance(thing, AbstractSet):
        return set(thing)
    if isinstance(thing, Sequence) and not hasattr(type(thing), "_fields"):
        return list(islice(thing, MAX_ENTRIES + 1))
    return None


def _fields(thing: object) -> Iterable[tuple[str, object]]:
    """Return the fields of a named tuple, a struct, or an object with a `__dict__`."""
    names = getattr(type(thing), "_fields", getattr(type(thing), "__struct_fields__", None))
    if isinstance(names, tuple):
        return ((name, getattr(thing, name)) for name in names)
    return attributes_of(thing).items()


_repr = _Repr()
