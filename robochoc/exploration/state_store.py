"""The states of a team by number, in the order in which they were found, in about 200 bytes each.

Many states have the same robots' states, or the same messages in transit. Each of these parts is stored once, and a
state is a combination of their numbers.
"""

from __future__ import annotations

from array import array
from collections.abc import Hashable
from typing import Generic, TypeVar

from robochoc.exploration.team_state import Delivery, TeamState

Part = TypeVar("Part", bound=Hashable)
_BITS = 40
"""The bits of the number of a part in the key of a state."""
_MASK = (1 << _BITS) - 1


class _Numbers(Generic[Part]):
    """The numbers of different things, from 0 on."""

    def __init__(self) -> None:
        self.things: list[Part] = []
        self._numbers: dict[Part, int] = {}

    def number(self, thing: Part) -> int:
        """Return the number of `thing`, the next one if it is new."""
        number = self._numbers.setdefault(thing, len(self.things))
        if number == len(self.things):
            self.things.append(thing)
        return number


class StateStore:
    """The states of a team, each with the step that has led to it first, and the steps that were explored from it."""

    def __init__(self) -> None:
        self._robots, self._queues = _Numbers[tuple[int, ...]](), _Numbers[Hashable]()
        self._rest = _Numbers[tuple[int, int, bool | None]]()
        self._deliveries = _Numbers[Delivery]()
        self._numbers: dict[int, int] = {}
        self._keys: list[int] = []
        self._before, self._steps = array("q"), array("q")
        self._first_after, self._after = array("q"), array("q")

    def __len__(self) -> int:
        """Return the number of states."""
        return len(self._keys)

    def key(self, state: TeamState) -> int:
        """Return the key of a state, which need not be in the store."""
        robots, queues, losses, stage, lossless = state
        rest = self._rest.number((losses, stage, lossless))
        return (rest << _BITS | self._robots.number(robots)) << _BITS | self._queues.number(queues)

    def number(self, key: int) -> int | None:
        """Return the number of the state with this key, or None if it is not in the store."""
        return self._numbers.get(key)

    def add(self, key: int, before: int = -1, delivery: Delivery | None = None) -> int:
        """Return the number of the state with this key. Add it after the state `before` if it is not in the store."""
        number = self._numbers.setdefault(key, len(self._keys))
        if number == len(self._keys):
            self._keys.append(key)
            self._before.append(before)
            self._steps.append(-1 if delivery is None else self._deliveries.number(delivery))
        return number

    def state(self, number: int) -> TeamState:
        """Return the state with this number."""
        key = self._keys[number]
        robots, queues = self._robots.things[key >> _BITS & _MASK], self._queues.things[key & _MASK]
        return TeamState(robots, queues, *self._rest.things[key >> 2 * _BITS])  # type: ignore[arg-type]

    def path(self, number: int) -> list[Delivery]:
        """Return the steps that have led to a state first."""
        path = []
        while self._steps[number] >= 0:
            path.append(self._deliveries.things[self._steps[number]])
            number = self._before[number]
        return path[::-1]

    def explored(self, after: list[int]) -> None:
        """Store the numbers of the states after the next state, in the order of their numbers."""
        self._first_after.append(len(self._after))
        self._after.extend(after)

    @property
    def explored_count(self) -> int:
        """The number of states of which `explored` was called: the first ones."""
        return len(self._first_after)

    def after(self, number: int) -> array[int]:
        """Return the numbers of the states after an explored state."""
        end = self._first_after[number + 1] if number + 1 < len(self._first_after) else len(self._after)
        return self._after[self._first_after[number] : end]
