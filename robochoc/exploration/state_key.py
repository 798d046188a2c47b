"""A canonical, hashable key of a robot's state: equal keys, equal behaviour.

The key contains everything that a protocol object contains, in the order in which it is iterated (sets, whose order
means nothing, are sorted). It does not contain the robot's problem, which never changes, and the number of its checks.
Two objects with equal content have the same key, whether or not they are the same object.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from hashlib import blake2b
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from robochoc.protocols.protocol import Protocol
from robochoc.solver.local_problem import LocalProblem

_ATOMS = (int, str, bytes, float, bool, type(None))
_NAMED = (type, BuiltinFunctionType, ModuleType)
_NOT_STATE = frozenset({"problem", "outbox", "checks_at_send"})
"""Attributes of a protocol that are no state: the problem, and what is empty between two steps."""


def state_key(protocol: Protocol) -> bytes:
    """Return a key of the protocol object's state."""
    state = {name: part for name, part in vars(protocol).items() if name not in _NOT_STATE}
    state["undeclared"] = protocol.problem.allows_undeclared
    return content_key(state, (id(protocol),))


def content_key(content: object, path: tuple[int, ...] = ()) -> bytes:
    """Return a key of anything that copies can be made of. `path`: the `id`s of the objects that contain it."""
    return blake2b(repr(_canonical(content, path)).encode(), digest_size=16).digest()


def _canonical(thing: object, path: tuple[int, ...]) -> object:
    """Return `thing` as nested tuples. `path`: the `id`s of the objects that contain it."""
    kind = type(thing)
    if kind in _ATOMS:
        return thing
    if isinstance(thing, _NAMED):
        return thing.__name__
    if isinstance(thing, FunctionType):
        return _function_key(thing)
    if isinstance(thing, LocalProblem):
        return "problem"
    if id(thing) in path:
        return "containing", len(path) - path.index(id(thing))
    return kind.__name__, *_parts(thing, partial(_canonical, path=(*path, id(thing))))


def _function_key(function: FunctionType) -> tuple[str, int]:
    """Return a key of `function` in this process. Raises `TypeError` for a function with variables of its own."""
    if function.__closure__:
        raise TypeError(
            f"{function.__qualname__} uses variables of another function: store a method or a class instead"
        )
    return function.__qualname__, id(function.__code__)


def _parts(thing: Any, canonical: Any) -> list[object]:  # noqa: ANN401 - anything that a protocol contains
    if isinstance(thing, set | frozenset):
        return sorted(map(canonical, thing), key=repr)
    if isinstance(thing, list | tuple):
        return [canonical(part) for part in thing]
    if isinstance(thing, Mapping):
        return [(canonical(key), canonical(part)) for key, part in thing.items()]
    if isinstance(thing, MethodType):
        return [thing.__name__, canonical(thing.__self__)]
    if isinstance(thing, np.ndarray):
        return [thing.dtype.str, thing.shape, thing.tobytes()]
    if is_dataclass(thing):  # without what a frozen object has computed once
        parts = [getattr(thing, field.name) for field in fields(thing)]
    else:
        _, arguments, *content = thing.__reduce_ex__(5)
        state, items, pairs = (*content, None, None, None)[:3]
        parts = [arguments, state, *(items or ()), *(pairs or ())]
    return [canonical(part) for part in parts]
