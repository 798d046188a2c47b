"""The conversation in an ended run, summarised as a small number of moments that the page plays back."""

from __future__ import annotations

import os
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple

from robochoc.app.sketch.sketch import Value
from robochoc.app.texts import catalogue, say
from robochoc.journal.entries import JournalEntry
from robochoc.journal.events import Began, Decided, Received, Sent, Settled
from robochoc.journal.reader import Follower
from robochoc.sniffer.growing_file import GrowingFile, open_to_read
from robochoc.sniffer.live_trace import entries_of, next_entries, sorted_by_time
from robochoc.sniffer.sentences import JournalSentences, ValueLabel
from robochoc.system.lazy_dataclass import dataclass

MOST_MOMENTS = 200
"""If there are twice as many moments, pairs of moments are joined."""
MOST_READ = 300_000
"""The maximum number of messages and decisions played. More would be slow to read and sort, and unreadable."""
MOST_BYTES = 32 << 20
"""The maximum number of bytes read from the journal."""
WORDS_SAVED = 3
"""The number of messages in a moment that are available in words."""
MOST_LETTERS = 300
MOST_LINKS = 200
"""The maximum number of pairs of robots in one moment, for readability."""


class MessageWords(NamedTuple):
    """A message in words."""

    sender: str
    receiver: str
    kind: str
    words: str


def in_words(sent: Sent, spoken: JournalSentences) -> MessageWords:
    """Return a message as words to everyone, without its sender's name. Long texts are shortened."""
    if (key := f"message.{sent.type}") in catalogue():
        return MessageWords(sent.sender, sent.receiver, sent.type, say(key))
    words = spoken.sentence(sent).removeprefix(f"{sent.sender} says: ").removeprefix(f"{sent.sender} says ")
    short = words if len(words) <= MOST_LETTERS else f"{words[: MOST_LETTERS - 1]}…"
    return MessageWords(sent.sender, sent.receiver, sent.type, short)


@dataclass
class Moment:
    """One or more successive messages, and the resulting values.

    Attributes:
        count: The number of messages.
        last_messages: The last messages, in words.
        links: The number of messages, by sender and receiver.
        values: The values that changed since the previous moment, by robot and `ROBOT.DECISION`.
        begins: True if a run or an epoch begins at this moment, so that earlier decisions are void.
    """

    count: int = 0
    last_messages: tuple[MessageWords, ...] = ()
    links: Counter[tuple[str, str]] = field(default_factory=Counter)
    values: dict[str, dict[str, Value]] = field(default_factory=dict)
    begins: bool = False

    def joined(self, later: Moment) -> Moment:
        """Return this moment joined with the next one."""
        links = Counter(dict((self.links + later.links).most_common(MOST_LINKS)))
        last_messages = (*self.last_messages, *later.last_messages)[-WORDS_SAVED:]
        values = later.values if later.begins else self.values | later.values
        return Moment(self.count + later.count, last_messages, links, values, begins=self.begins or later.begins)

    def after(self, before: Mapping[str, Mapping[str, Value]]) -> dict[str, Mapping[str, Value]]:
        """Return the values of all robots at the end of this moment, given the values `before` it."""
        return dict(self.values) if self.begins else {**before, **self.values}


class Tape:
    """The moments in a conversation: at most `2 * MOST_MOMENTS`, for any number of messages.

    Args:
        robots: The robots in the team. Events of other robots are ignored.
        label: Converts a variable's code to the user's value.
        called: Returns the names for values in messages.

    Attributes:
        moments: The moments, in order.
        messages: The total number of messages.
        is_whole: True if all messages are included; otherwise only the first ones are.
    """

    def __init__(self, robots: Collection[str], label: Callable[[str, int], Value], called: ValueLabel) -> None:
        self.moments = [Moment()]
        self.messages = 0
        self.is_whole = True
        self._robots = frozenset(robots)
        self._label = label
        self._spoken = JournalSentences(called)
        self._last: deque[Sent] = deque(maxlen=WORDS_SAVED)
        self._size = 1
        self._settled: dict[str, int] = {}

    def add(self, entry: JournalEntry) -> None:
        """Add the next entry of the journal."""
        match entry:
            case Sent():
                if entry.sender in self._robots and entry.receiver in self._robots:
                    self._sent(entry)
            case Decided() if entry.robot in self._robots:
                values = {name: self._label(name, value) for name, value in entry.assignment.items()}
                self.moments[-1].values[entry.robot] = values
            case Began():
                self._start_run()
                self._spoken.follow(entry)
            case _:
                self._spoken.follow(entry)

    def end(self) -> None:
        """Complete the tape after the last entry."""
        self._close()
        now: dict[str, Mapping[str, Value]] = {}
        for number, moment in enumerate(self.moments):
            before, now = now, moment.after(now)
            robots = before.keys() | now.keys() if moment.begins else moment.values.keys()
            self._settled |= {robot: number for robot in robots if before.get(robot) != now.get(robot)}

    def _start_run(self) -> None:
        """Start a run or an epoch, in which no robot has decided yet."""
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
        """Convert the last messages to words, while their context is available."""
        if self._last:
            moment = self.moments[-1]
            last_messages = (*moment.last_messages, *(in_words(sent, self._spoken) for sent in self._last))
            moment.last_messages = last_messages[-WORDS_SAVED:]
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
        """Return all values at the end of the moment `number`."""
        now: dict[str, Mapping[str, Value]] = {}
        begun = max((place for place in range(number + 1) if self.moments[place].begins), default=0)
        for moment in self.moments[begun : number + 1]:
            now |= moment.values
        return {name: value for values in now.values() for name, value in values.items()}

    def unsettled_at(self, number: int) -> frozenset[str]:
        """Return the robots whose values change after the moment `number`. Call `end` first."""
        return frozenset(robot for robot, last in self._settled.items() if last > number)

    def messages_at(self, number: int) -> int:
        """Return the number of messages up to the end of the moment `number`."""
        return sum(moment.count for moment in self.moments[: number + 1])

    def words_at(self, number: int, most: int) -> list[MessageWords]:
        """Return the last messages at the end of the moment `number`, in words, the last one first."""
        last_messages: list[MessageWords] = []
        for moment in reversed(self.moments[: number + 1]):
            last_messages += reversed(moment.last_messages)
            if len(last_messages) >= most:
                break
        return last_messages[:most]


def recorded(file: Path, tape: Tape, is_needed: Callable[[], bool] = lambda: True) -> Tape:
    """Fill `tape` with the conversation in a complete or interrupted journal, ordered by time, and return it.

    Args:
        file: The journal.
        tape: The tape to fill.
        is_needed: Returns whether the result is still needed. Called from time to time.

    Raises:
        OSError: if the journal cannot be read.
        JournalError: if the file is not a journal.
    """
    descriptor = open_to_read(file)
    try:
        growing = GrowingFile(descriptor)
        growing.widen(MOST_BYTES)
        tape.is_whole = growing.end == growing.size
        _read(growing, tape, is_needed)
    finally:
        os.close(descriptor)
    tape.end()
    return tape


def _read(file: GrowingFile, tape: Tape, is_needed: Callable[[], bool]) -> None:
    here = file.again()
    for header in next_entries(Follower(BufferedReader(here)), here, file.end)[:1]:
        tape.add(header)
    for piece in sorted_by_time(_first(file, tape)):
        for event in piece:
            tape.add(event)
        if not is_needed():
            tape.is_whole = False
            return


def _first(file: GrowingFile, tape: Tape) -> Iterator[Sequence[JournalEntry]]:
    """Yield the entries in a file that are played, up to a maximum number."""
    read = 0
    for piece in entries_of(file):
        if read >= MOST_READ:
            tape.is_whole = False
            return
        played = [entry for entry in piece if not isinstance(entry, Received | Settled)]
        read += len(played)
        yield played
