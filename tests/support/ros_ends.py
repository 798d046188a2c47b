"""What a closed loop is connected to: a source with given messages, a sink that keeps what it gets, and a clock."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.problem import Team
from robochoc.robots.closed_loop import drones_of
from robochoc.robots.sink import Fields, Sink
from robochoc.robots.source import ReceivedMessage, Source
from robochoc.ros.publisher import SinkPublisher

SECOND = 1_000_000_000


class WaitedClock:
    """A clock that goes on while somebody waits, and then only."""

    def __init__(self) -> None:
        self.waited_s = 0.0

    def monotonic(self) -> float:
        return self.waited_s

    time = monotonic

    def time_ns(self) -> int:
        return round(self.waited_s * SECOND)


class Tape(Source):
    """A source that gives what it was given: messages, or the second until which nothing comes.

    With a `clock` it is live: when nothing comes any more, the clock goes on.
    """

    def __init__(self, *messages: ReceivedMessage | float, clock: WaitedClock | None = None) -> None:
        super().__init__("tape")
        self.messages = list(messages)
        self.live = clock is not None
        self.clock = clock
        self.topics: Mapping[str, str] = {}
        self.busy_s = 0.0

    @property
    def is_busy(self) -> bool:
        return self.clock is not None and self.clock.waited_s < self.busy_s

    def listen(self, topics: Mapping[str, str]) -> None:
        self.topics = topics

    def next(self, wait_s: float) -> ReceivedMessage | None:
        first = self.messages[0] if self.messages else None
        if isinstance(first, ReceivedMessage):
            self.messages.pop(0)
            return first
        if self.clock:
            self.clock.waited_s += wait_s
            if first is not None and self.clock.waited_s >= first:
                self.messages.pop(0)
        return None

    def close(self) -> None:
        """Nothing to leave."""


class KeptSink(Sink):
    """A sink that keeps what it gets."""

    def __init__(self, *, live: bool = False) -> None:
        super().__init__("kept")
        self.live = live
        self.advertised: list[dict[str, str]] = []
        self.original: dict[str, str] = {}
        self.said: list[tuple[str, str, Fields, int]] = []
        """Topics, types, fields and times."""

    def explain(self, original: Mapping[str, str]) -> None:
        self.original = {**original}

    def advertise(self, topics: Mapping[str, str]) -> None:
        self.advertised.append({**topics})

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        assert kind
        self.said.append((topic, kind, fields, at_ns))

    def close(self) -> None:
        raise AssertionError("only who has opened a sink closes it")

    def topics(self) -> list[str]:
        return [topic for topic, *_ in self.said]


def publishers(team: Team, *sinks: Sink) -> list[SinkPublisher]:
    """Return publishers of the waypoints of `team` to `sinks`."""
    return [SinkPublisher(team.name, drones_of(team), sink, "map") for sink in sinks]
