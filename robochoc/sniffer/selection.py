"""A selection of messages of a trace by robots, types, numbers, and conversation. All parts must match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robochoc.sniffer.patterns import matching, unmatched
from robochoc.sniffer.trace import Trace


class NothingSelectedError(ValueError):
    """A part of a selection that matches nothing in the journal; the message lists what there is."""


@dataclass(frozen=True)
class Selection:
    """A selection of messages: both robots must match `robots`, and the type must match `kinds`.

    `robots` and `kinds` are names or patterns. `first` and `last` are numbers of messages, from 0 on, both included.
    `run` is the number of a run, from 1 on: the conversation. Empty or None parts do not restrict the selection.
    """

    robots: Sequence[str] = ()
    kinds: Sequence[str] = ()
    first: int = 0
    last: int | None = None
    run: int | None = None

    @property
    def whole(self) -> bool:
        """Whether everything is selected."""
        return self == Selection()

    def of(self, trace: Trace) -> range | list[int]:
        """Return the numbers of the selected messages, in order. Raises `NothingSelectedError`."""
        count = len(trace.messages.t)
        numbers = range(min(self.first, count), count if self.last is None else min(self.last + 1, count))
        if count and not numbers:
            upto = "on" if self.last is None else f"to {self.last}"
            raise NothingSelectedError(f"there is no message from {self.first} {upto}, only 0 to {count - 1}")
        if not (self.robots or self.kinds or self.run is not None):
            return numbers
        robots = _places(trace.robots, self.robots, "robot")
        kinds = _places(trace.kinds, self.kinds, "type of message")
        if self.run is not None and not 1 <= self.run <= len(trace.runs):
            raise NothingSelectedError(f"there is no conversation {self.run}, only 1 to {len(trace.runs)}")
        of = trace.messages
        return [
            number
            for number in numbers
            if of.sender[number] in robots
            and of.receiver[number] in robots
            and of.kind[number] in kinds
            and (self.run is None or of.run[number] == self.run - 1)
        ]


def _places(names: Sequence[str], patterns: Sequence[str], what: str) -> set[int]:
    if not patterns:
        return set(range(len(names)))
    lost = unmatched(names, patterns)
    if lost:
        known = ", ".join(sorted(names)[:12]) + (", ..." if len(names) > 12 else "")  # noqa: PLR2004 - a line's worth
        raise NothingSelectedError(f"no {what} is called {lost[0]!r}; there are {known or 'none'}")
    meant = set(matching(names, patterns))
    return {place for place, name in enumerate(names) if name in meant}
