"""The journal: all events of a run, one JSON object a line, oldest first.

The first line says what was run, the last one how it ended. Statistics, pictures and golden tests are computed
from it; robots do not know that it is kept.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import msgspec

from robochoc.observers.events import AnyEvent, Began, Decided, Event, Heard, Improved, Sent, Settled
from robochoc.observers.objective import Objective
from robochoc.outcome import Metrics, Outcome
from robochoc.problem import INFINITE, natural

VERSION = 1


class BadJournal(ValueError):  # noqa: N818 - named for what was found
    """The file is no journal, or one of another version."""


class Header(Event, frozen=True, kw_only=True, tag="Journal"):
    """What was run, and the version of this format."""

    t: float = 0
    team: str
    protocol: str
    runtime: str
    seed: int
    order: str | tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET
    """The priority order, by name or as the list of robots; left out where it was the files'."""
    channel: str | msgspec.UnsetType = msgspec.UNSET
    """The channel model, where there was one: then the times of the search's events are in simulated seconds."""
    version: int = VERSION


class Ended(Event, frozen=True, kw_only=True):
    """How it ended; absent in the journal of a run that broke off."""

    t: float = 0
    outcome: Outcome


Line = AnyEvent | Header | Ended


class Recorder:
    """An observer that keeps events, and makes a journal of them.

    With an `objective`, it notes when what the robots have decided is the cheapest so far, in runs that minimise.
    """

    outcome: Outcome | None = None
    """How the run ended; None: not yet, or it broke off."""

    def __init__(self, header: Header, objective: Callable[[], Objective] | None = None) -> None:
        self._header = header
        self._objective = objective
        self._runs: list[list[AnyEvent]] = []

    def __call__(self, event: AnyEvent) -> None:
        """Take in one event. `Began` opens a run; times are compared within a run only."""
        if isinstance(event, Began) or not self._runs:  # across machines somebody may be refused before anybody begins
            self._runs.append([])
        self._runs[-1].append(event)

    def content(self) -> bytes:
        """The journal as bytes.

        Robots report their events in bundles, so each run's are put in the order of their times; events of equal
        times stay in the order in which they came, which is each robot's own.
        """
        events = (event for run in self._runs for event in self._told(run))
        lines: list[object] = [self._header, *events]
        if self.outcome:
            lines.append(Ended(outcome=self.outcome))
        encode = msgspec.json.Encoder().encode
        return b"".join(encode(line) + b"\n" for line in lines)

    def _told(self, run: Sequence[AnyEvent]) -> Iterator[AnyEvent]:
        """The events of one run in order, with improvements among them."""
        events = sorted(run, key=lambda event: event.t)
        opening = run[0]
        if self._objective is None or not isinstance(opening, Began) or opening.minimises is not True:
            return iter(events)
        return improvements(events, self._objective())


def improvements(events: Iterable[AnyEvent], objective: Objective) -> Iterator[AnyEvent]:
    """`events`, and an `Improved` after each that tells of something cheaper than ever."""
    best = INFINITE
    own: dict[str, dict[str, int]] = {}
    for event in events:
        yield event
        match event:
            case Decided():
                own[event.robot] = event.assignment
                objective.change({event.robot: event.assignment})
                cost, now = objective.cost, own
            case Heard():
                cost, now = event.cost, objective.shown(event.values)
            case _:
                continue
        if cost < best:
            best = cost
            values = {name: value for robot in sorted(now, key=natural) for name, value in now[robot].items()}
            yield Improved(t=event.t, cost=best, assignment=values)


@dataclass(frozen=True)
class Journal:
    """A journal that has been read. `outcome` is None when the run broke off."""

    header: Header
    events: tuple[AnyEvent, ...]
    outcome: Outcome | None


def is_journal(content: bytes) -> bool:
    """Whether `content` begins as a journal does."""
    return content.startswith(b'{"event":"Journal"')


def read_journal(content: bytes) -> Journal:
    """Read what `Recorder` has written. Raises `BadJournal`, with the line that is wrong."""
    events: list[AnyEvent] = []
    outcome: Outcome | None = None
    header: Header | None = None
    decode = msgspec.json.Decoder(Line).decode
    for number, line in enumerate(content.splitlines(), start=1):
        try:
            entry = decode(line)
        except msgspec.MsgspecError as error:
            raise BadJournal(f"line {number}: {error}") from error
        if number == 1:
            if not isinstance(entry, Header) or entry.version != VERSION:
                raise BadJournal(f"line 1: expected the header of a journal of version {VERSION}")
            header = entry
        elif isinstance(entry, Header):
            raise BadJournal(f"line {number}: a second header")
        elif isinstance(entry, Ended):
            outcome = entry.outcome
        else:
            events.append(entry)
    if header is None:
        raise BadJournal("it is empty")
    return Journal(header, tuple(events), outcome)


def metrics_of(events: Iterable[AnyEvent]) -> Metrics:
    """What the events say of messages, bytes, NCCCs and checks. Wall-clock time is not in them: 0."""
    total = Metrics()
    messages: Counter[str] = Counter()
    size = ncccs = 0
    checks: dict[str, int] = {}

    def run() -> Metrics:
        return Metrics(dict(messages), size, ncccs, sum(checks.values()))

    for event in events:
        match event:
            case Began():
                total += run()
                messages.clear()
                checks.clear()
                size = ncccs = 0
            case Sent():
                messages[event.type] += 1
                size += event.bytes
            case Settled():
                ncccs = max(ncccs, event.clock)
                checks[event.robot] = event.checks
            case _:
                pass
    return total + run()
