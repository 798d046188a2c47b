"""The conversation of a run that is over, in few moments: what the page plays back."""

from __future__ import annotations

import os
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple

from robochoc.app.sketch.sketch import Value
from robochoc.journal.entries import JournalEntry
from robochoc.journal.events import Began, Decided, Received, Sent, Settled
from robochoc.journal.reader import Follower
from robochoc.sniffer.growing_file import GrowingFile, open_to_read
from robochoc.sniffer.live_trace import entries_of, next_entries, sorted_by_time
from robochoc.sniffer.spoken import Called, Spoken

MOST_MOMENTS = 200
"""With twice as many, every two become one."""
MOST_READ = 300_000
"""Messages and what was decided. What comes after them is not played: it would take long to read and to sort, and
nobody could follow it."""
MOST_BYTES = 32 << 20
"""Of the journal."""
WORDS_KEPT = 3
"""Of the messages of one moment, so many are kept in words."""
MOST_LETTERS = 300
MOST_LINKS = 200
"""Pairs of robots of one moment. With more, nobody sees them apart."""


class Said(NamedTuple):
    """A message in words."""

    sender: str
    receiver: str
    kind: str
    words: str


def in_words(sent: Sent, spoken: Spoken) -> Said:
    """Return a message in words, without the name of its sender; long ones are cut."""
    words = spoken.sentence(sent).removeprefix(f"{sent.sender} says: ").removeprefix(f"{sent.sender} says ")
    short = words if len(words) <= MOST_LETTERS else f"{words[: MOST_LETTERS - 1]}…"
    return Said(sent.sender, sent.receiver, sent.type, short)


@dataclass
class Moment:
    """One or more messages, one after the other, and what came of them.

    Attributes:
        count: How many messages they are.
        said: The last of them, in words.
        links: How many went from whom to whom.
        values: The new values of those who have changed them since the moment before, by `ROBOT.DECISION`.
        begins: Whether a run, or an epoch, begins in it: what was decided before is void.
    """

    count: int = 0
    said: tuple[Said, ...] = ()
    links: Counter[tuple[str, str]] = field(default_factory=Counter)
    values: dict[str, dict[str, Value]] = field(default_factory=dict)
    begins: bool = False

    def joined(self, later: Moment) -> Moment:
        """Return this moment and the one after it as one."""
        links = Counter(dict((self.links + later.links).most_common(MOST_LINKS)))
        said = (*self.said, *later.said)[-WORDS_KEPT:]
        values = later.values if later.begins else self.values | later.values
        return Moment(self.count + later.count, said, links, values, begins=self.begins or later.begins)

    def after(self, before: Mapping[str, Mapping[str, Value]]) -> dict[str, Mapping[str, Value]]:
        """Return the values of all robots at its end. `before`: those at the end of the moment before."""
        return dict(self.values) if self.begins else {**before, **self.values}


class Tape:
    """The moments of a conversation. There are at most `2 * MOST_MOMENTS`, however much is said.

    Args:
        robots: The robots of the team. What others do is none of its conversation.
        label: What the code of a variable's value stands for.
        called: The same in words.

    Attributes:
        moments: The moments, the first one first.
        messages: How many messages they are together.
        is_whole: Whether this is all that was said; otherwise it is the beginning.
    """

    def __init__(self, robots: Collection[str], label: Callable[[str, int], Value], called: Called) -> None:
        self.moments = [Moment()]
        self.messages = 0
        self.is_whole = True
        self._robots = frozenset(robots)
        self._label = label
        self._spoken = Spoken(called)
        self._last: deque[Sent] = deque(maxlen=WORDS_KEPT)
        self._size = 1
        self._settled: dict[str, int] = {}

    def take(self, entry: JournalEntry) -> None:
        """Take in what has happened next."""
        match entry:
            case Sent():
                if entry.sender in self._robots and entry.receiver in self._robots:
                    self._sent(entry)
            case Decided() if entry.robot in self._robots:
                values = {name: self._label(name, value) for name, value in entry.assignment.items()}
                self.moments[-1].values[entry.robot] = values
            case Began():
                self._begin()
                self._spoken.follow(entry)
            case _:
                self._spoken.follow(entry)

    def end(self) -> None:
        """Note that this was all."""
        self._close()
        now: dict[str, Mapping[str, Value]] = {}
        for number, moment in enumerate(self.moments):
            before, now = now, moment.after(now)
            robots = before.keys() | now.keys() if moment.begins else moment.values.keys()
            self._settled |= {robot: number for robot in robots if before.get(robot) != now.get(robot)}

    def _begin(self) -> None:
        """Begin a run, or an epoch: its robots have not decided anything."""
        self._close()
        if self.moments[-1].count:
            self._next()
        self.moments[-1].values.clear()
        self.moments[-1].begins = True

    def _sent(self, sent: Sent) -> None:
        if self.moments[-1].count >= self._size:
            self._next()
        moment = self.moments[-1]
        moment.count += 1
        moment.links[sent.sender, sent.receiver] += 1
        self._last.append(sent)
        self.messages += 1

    def _close(self) -> None:
        """Put the last messages into words, while it is known who speaks of what."""
        if self._last:
            moment = self.moments[-1]
            said = (*moment.said, *(in_words(sent, self._spoken) for sent in self._last))
            moment.said = said[-WORDS_KEPT:]
            moment.links = Counter(dict(moment.links.most_common(MOST_LINKS)))
            self._last.clear()

    def _next(self) -> None:
        self._close()
        if len(self.moments) >= 2 * MOST_MOMENTS:
            pairs = zip(self.moments[::2], self.moments[1::2], strict=True)
            self.moments = [earlier.joined(later) for earlier, later in pairs]
            self._size *= 2
        self.moments.append(Moment())

    def values_at(self, number: int) -> dict[str, Value]:
        """Return all values at the end of the moment of this number."""
        now: dict[str, Mapping[str, Value]] = {}
        begun = max((place for place in range(number + 1) if self.moments[place].begins), default=0)
        for moment in self.moments[begun : number + 1]:
            now |= moment.values
        return {name: value for values in now.values() for name, value in values.items()}

    def unsettled_at(self, number: int) -> frozenset[str]:
        """Return who will have other values after the moment of this number, once all is told: see `end`."""
        return frozenset(robot for robot, last in self._settled.items() if last > number)

    def messages_at(self, number: int) -> int:
        """Return how many messages were sent by the end of the moment of this number."""
        return sum(moment.count for moment in self.moments[: number + 1])

    def said_at(self, number: int, most: int) -> list[Said]:
        """Return the last messages in words at the end of the moment of this number, the last one first."""
        said: list[Said] = []
        for moment in reversed(self.moments[: number + 1]):
            said += reversed(moment.said)
            if len(said) >= most:
                break
        return said[:most]


def recorded(file: Path, tape: Tape, wanted: Callable[[], bool] = lambda: True) -> Tape:
    """Return `tape` with the conversation of a journal that is whole, or broke off, in the order of its times.

    Args:
        file: The journal.
        tape: Takes it in.
        wanted: Whether somebody still waits for it; asked now and then.

    Raises:
        OSError: when it cannot be read.
        JournalError: when it is none.
    """
    descriptor = open_to_read(file)
    try:
        growing = GrowingFile(descriptor)
        growing.widen(MOST_BYTES)
        tape.is_whole = growing.end == growing.size
        _read(growing, tape, wanted)
    finally:
        os.close(descriptor)
    tape.end()
    return tape


def _read(file: GrowingFile, tape: Tape, wanted: Callable[[], bool]) -> None:
    here = file.again()
    for header in next_entries(Follower(BufferedReader(here)), here, file.end)[:1]:
        tape.take(header)
    for piece in sorted_by_time(_first(file, tape)):
        for event in piece:
            tape.take(event)
        if not wanted():
            tape.is_whole = False
            return


def _first(file: GrowingFile, tape: Tape) -> Iterator[Sequence[JournalEntry]]:
    """Yield what is played of a file, up to a bound: nothing else is worth sorting."""
    read = 0
    for piece in entries_of(file):
        if read >= MOST_READ:
            tape.is_whole = False
            return
        played = [entry for entry in piece if not isinstance(entry, Received | Settled)]
        read += len(played)
        yield played
