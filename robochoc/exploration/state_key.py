"""A canonical, hashable key of a robot's state: equal keys, equal behaviour.

The key contains everything that a protocol object contains, in the order in which it is iterated (sets, whose order
means nothing, are sorted). Of the robot's problem it contains what a protocol could change or add, but not the number
of its checks, and nothing that the problem stores to be faster.
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
from robochoc.solver.shared_constraint import SharedConstraint

_ATOMS = (int, str, bytes, float, bool, type(None))
_NAMED = (type, BuiltinFunctionType, ModuleType)
_NOT_STATE = frozenset({"problem", "outbox", "checks_at_send"})
"""Attributes outside the state of a protocol: its problem, which has a key of its own, and lists that are empty between
two steps."""
_SAME_PROBLEM = frozenset({"checks", "_domain", "_part", "_rank", "_places", "_made_filters", "_table"})
"""Attributes of a problem outside the state: the number of checks, what all copies share, and caches."""


def state_key(protocol: Protocol) -> bytes:
    """Return a key of the protocol object's state."""
    state = {name: part for name, part in vars(protocol).items() if name not in _NOT_STATE}
    problem = _problem_parts(protocol.problem)
    return content_key((state, problem), (id(protocol), id(protocol.problem)))


def _problem_parts(problem: LocalProblem) -> dict[str, object]:
    return {name: part for name, part in vars(problem).items() if name not in _SAME_PROBLEM}


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
    if isinstance(thing, SharedConstraint):  # without its caches, which copies share
        return "constraint", thing.key
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
    return [canonical(part) for part in _attributes(thing)]


def _attributes(thing: Any) -> list[object]:  # noqa: ANN401 - anything that a protocol contains
    if isinstance(thing, LocalProblem):
        return [_problem_parts(thing)]
    if is_dataclass(thing):  # without what a frozen object has computed once
        return [getattr(thing, field.name) for field in fields(thing)]
    _, arguments, *content = thing.__reduce_ex__(5)
    state, items, pairs = (*content, None, None, None)[:3]
    return [arguments, state, *(items or ()), *(pairs or ())]
