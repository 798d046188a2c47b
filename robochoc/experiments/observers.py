"""Observers of a run, which record the cost over time, the load of each robot, and the journal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from operator import itemgetter

from robochoc.communication.search_result import Progress
from robochoc.experiments.task import CostPoint, RobotLoad
from robochoc.journal.events import AnyEvent, Decided, Given, Heard, Improved, Sent
from robochoc.journal.recorder import JournalRecorder, improvements
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.run.options import Options
from robochoc.run.recording import journal_header, objective_to_record

MOST_POINTS = 10_000
"""The most points on a curve. The cost rarely falls so often, but large costs can."""


class CostOverTime:
    """An observer that records when the team's assignment became cheaper than before, and the effort until then.

    The recorded points correspond to the `Improved` events of a journal.
    """

    def __init__(self, team: Team, options: Options) -> None:
        self._objective = objective_to_record(team, options)
        self._messages = 0
        self._clock = 0
        self._seen: list[tuple[float, int, int, AnyEvent]] = []

    def __call__(self, event: AnyEvent) -> None:
        """Process one event."""
        match event:
            case Sent():
                self._messages += 1
                self._clock = max(self._clock, event.clock)
            case Given() if self._objective is not None:
                self._seen.append((0, self._messages, self._clock, event))
            case Decided() | Heard() if self._objective is not None:
                self._clock = max(self._clock, getattr(event, "clock", 0))
                self._seen.append((event.t, self._messages, self._clock, event))
            case _:
                pass

    def note_sent(self, progress: Progress) -> None:
        """Record the number of messages sent, for a runtime without an event for each message."""
        self._messages = max(self._messages, progress.messages)

    def points(self) -> list[CostPoint]:
        """Return the recorded points in order; empty if nothing is minimised."""
        return list(self._points())[:MOST_POINTS]

    def _points(self) -> Iterator[CostPoint]:
        if self._objective is None or not self._seen:
            return
        seen = sorted(self._seen, key=itemgetter(0))
        moments = iter(seen)
        messages, clock = 0, 0
        for event in improvements((one[3] for one in seen), self._objective()):
            if isinstance(event, Improved):
                yield CostPoint(messages, clock, event.t, str(event.cost))
            else:
                _, messages, clock, _ = next(moments)


class RobotLoads:
    """An observer that counts the messages and bytes sent by each robot."""

    def __init__(self) -> None:
        self._messages: Counter[str] = Counter()
        self._bytes: Counter[str] = Counter()

    def __call__(self, event: AnyEvent) -> None:
        """Process one event."""
        if isinstance(event, Sent):
            self._messages[event.sender] += 1
            self._bytes[event.sender] += event.bytes

    def loads(self) -> list[RobotLoad]:
        """Return the load of each robot that sent a message, sorted by name."""
        return [RobotLoad(name, count, self._bytes[name]) for name, count in sorted(self._messages.items())]


LARGEST_JOURNAL = 256 * 2**20
"""The maximum size of a stored journal, in bytes. Larger journals are discarded."""


def journal_of(team: Team, options: Options) -> JournalRecorder:
    """Return an observer that writes the run's journal in memory."""
    return JournalRecorder(journal_header(team, options), objective_to_record(team, options))


def journal_bytes(journal: JournalRecorder, outcome: Outcome) -> bytes:
    """Return the journal of a finished run, or an empty value if it is too large."""
    journal.outcome = outcome
    content = journal.content()
    return content if len(content) <= LARGEST_JOURNAL else b""
