"""Objects that several users of this process share, such as connections; the last user ends them."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Shared(Generic[Value]):
    """Shares objects by key, and counts the users of each object.

    Args:
        end: Called with an object after its last user has left.
    """

    def __init__(self, end: Callable[[Value], None]) -> None:
        self._end = end
        self._open: dict[Hashable, tuple[Value, int]] = {}

    def enter(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return the object for `key`, which `make` creates for the first user."""
        value, users = self._open[key] if key in self._open else (make(), 0)
        self._open[key] = value, users + 1
        return value

    def leave(self, key: Hashable) -> None:
        """Release the object for `key`."""
        value, users = self._open.pop(key)
        if users > 1:
            self._open[key] = value, users - 1
        else:
            self._end(value)
