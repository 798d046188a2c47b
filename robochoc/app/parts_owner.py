"""Objects with attached parts, such as a team with its runs. The parts live as long as their owner."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self, TypeVar

T = TypeVar("T")


class PartsOwner:
    """An object to which other modules attach parts. Each part is created at the first request."""

    def __init__(self) -> None:
        self._parts: dict[Any, Any] = {}

    def part(self, make: Callable[[Self], T]) -> T:
        """Return the part that `make` creates, which is the same object in all calls."""
        if make not in self._parts:
            self._parts[make] = make(self)
        found: T = self._parts[make]
        return found
