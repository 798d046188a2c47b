"""What belongs to one object, such as all runs of a team, and lives as long as that does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self, TypeVar

T = TypeVar("T")


class HasParts:
    """An object with parts that it knows nothing of. Each is made once, when it is first asked for."""

    def __init__(self) -> None:
        self._parts: dict[Any, Any] = {}

    def part(self, make: Callable[[Self], T]) -> T:
        """Return the part that `make` makes, always the same one."""
        if make not in self._parts:
            self._parts[make] = make(self)
        found: T = self._parts[make]
        return found
