"""Feedback from a source: robots that report over a ROS, or a recording of what they have reported."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from itertools import starmap

from robochoc.flight.mission import Leg, MissionBuilder
from robochoc.flight.reports import Report
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.closed_loop import TOGETHER_S, Feedback
from robochoc.robots.inbox import MessageInbox, weight_of
from robochoc.robots.source import REPORTS, ReceivedMessage, Source, SourceError
from robochoc.ros.report_decoder import ReportDecoder
from robochoc.ros.waypoint_types import short_kind

CLOCK = "/clock"
CLOCK_KIND = "rosgraph_msgs/Clock"
_BILLION = 1_000_000_000
_SECONDS = range(1 << 31)
PATIENCE_S = 10.0
"""The default time to wait for reports of a live source after a decision, in seconds."""
_NOTES_MAX = 12
_SLICE_S = 0.2
"""The interval between calls of `idle`, and the longest time that a look at what has come may take, in seconds."""


class SourceFeedback(Feedback):
    """Reports from `source`, decoded by `decoder`.

    After each decision a live source has `patience_s` seconds for a report that changes something; then the run is
    over. While it is busy, that time does not pass. A recording is read to its end, as fast as possible: the clock is
    that of its messages.

    With `sim_time` decisions have the time that comes on `/clock`. Raises `SourceError` if none comes in `patience_s`.
    """

    def __init__(
        self, source: Source, decoder: ReportDecoder, patience_s: float = PATIENCE_S, *, sim_time: bool = False
    ) -> None:
        self._source = source
        self._decoder = decoder
        self._patience_s = patience_s
        self._deadline: float | None = None
        self._kept: Report | None = None
        self._now_ns: int | None = None
        self._sim = SimClock() if sim_time else None
        self._early = MessageInbox()
        self._last = math.inf
        self._idle_s = time.monotonic()
        source.assign(decoder.namespaces)
        source.listen(with_clock(decoder.topics) if sim_time else decoder.topics)
        if not source.live:
            self._kept = self._pull(None)

    @property
    def notes(self) -> list[str]:
        """Sentences about places in another frame, and about topics of a recording that could not be used."""
        frames = [
            f"places on {topic} are in the frame '{frame}', and were passed over (--frame says which is ours)"
            for topic, frame in self._decoder.other_frames.items()
        ]
        others = [*filter(None, starmap(self._unused, self._source.others.items()))]
        more = [f"and {len(others) - _NOTES_MAX:,} more topics were passed over"] * (len(others) > _NOTES_MAX)
        return [*frames, *others[:_NOTES_MAX], *more]

    def _unused(self, topic: str, kind: str) -> str:
        """Return why a topic was not used that looks like a report; empty for others."""
        wanted = self._decoder.topics.get(topic)
        if wanted:
            return on_one_line(f"{topic} holds {kind}, not {wanted}, and was passed over")
        if REPORTS.get(topic.rpartition("/")[2]) == short_kind(kind):
            return on_one_line(f"{topic} is of no drone of this team, and was passed over")
        return ""

    def now_ns(self) -> int:
        """Return the wall clock's time, or that of the recording, or that on `/clock`."""
        if self._sim is not None:
            return self._sim_ns(self._sim)
        return time.time_ns() if self._source.live or self._now_ns is None else self._now_ns

    def _sim_ns(self, clock: SimClock) -> int:
        """Return the time of a simulation: the newest that has come. Waits for the first. Raises `SourceError`.

        Other messages may come all the time meanwhile. They are kept, as an inbox does.
        """
        deadline = time.monotonic() + self._patience_s
        while self._source.live and time.monotonic() < deadline:
            received = self._source.next(0 if clock.now_ns is not None else _SLICE_S)
            if received is not None and not clock.update(received):
                self._early.put(received, weight_of(received.fields))
            if clock.now_ns is None:
                self._idle_now_and_then(received)
            elif received is None:
                break
        if clock.now_ns is None:
            when = f"within {self._patience_s:g} s" if self._source.live else "before its first report"
            problem = f"no time came on {CLOCK} of {self._source.place or 'the source'} {when}"
            raise SourceError(on_one_line(f"{problem}; start the simulation, or leave out --use-sim-time"))
        return clock.now_ns

    def on_decision(self, builder: MissionBuilder, leg: Leg, left_s: float | None) -> None:  # noqa: ARG002 - the decision was published
        """Take note of a decision: reports are awaited from now on."""
        limits = [left_s, self._patience_s if self._source.live else None]
        wait_s = min((limit for limit in limits if limit is not None), default=None)
        now = time.monotonic()
        self._deadline = None if wait_s is None else now + wait_s
        self._last = math.inf if left_s is None else now + left_s

    def next(self, until_s: float | None) -> Report | None:
        """Return the next report; see `Feedback.next`."""
        soon = None
        if until_s is not None and self._source.live:
            soon = time.monotonic() + min(max(until_s - time.time(), 0), TOGETHER_S)
        report, self._kept = self._kept or self._pull(soon), None
        if report is not None and until_s is not None and report.at_s > until_s:
            self._kept = report
            return None
        self._published(report)
        return report

    def poll(self) -> Report | None:
        """Return a report of a live source that has come; see `Feedback.poll`."""
        if self._kept is None and self._source.live:
            self._kept = self._pull(time.monotonic() + _SLICE_S, wait=False)
        report, self._kept = (self._kept, None) if self._source.live else (None, self._kept)
        self._published(report)
        return report

    def _published(self, report: Report | None) -> None:
        """Publish a report where it is to be."""
        if report is not None:
            for publisher in self.publishers:
                publisher.report(self._stamped(report))

    def _stamped(self, report: Report) -> Report:
        """Return `report` with the time of the simulation, if there is one."""
        now_ns = self._sim.now_ns if self._sim else None
        return report if now_ns is None else replace(report, at_s=now_ns / 1e9)

    def _ends(self, soon: float | None) -> float | None:
        """Return until when reports are awaited: no longer than `soon`."""
        if self._deadline is not None and self._source.is_busy:
            self._deadline = min(time.monotonic() + self._patience_s, self._last)
        return min((each for each in (self._deadline, soon) if each is not None), default=None)

    def _idle_now_and_then(self, received: ReceivedMessage | None) -> None:
        """Call `idle` where nothing was received, and now and then where messages come all the time."""
        now = time.monotonic()
        if received is None or now - self._idle_s >= _SLICE_S:
            self._idle_s = now
            self.idle()

    def _pull(self, soon: float | None, *, wait: bool = True) -> Report | None:
        """Return the next report of the source before `soon`, and before the wait is over; None if there is none.

        Without `wait`, return None as soon as nothing has come, and `soon` at the latest.
        """
        while True:
            deadline = self._ends(soon) if wait else soon
            left_s = _SLICE_S if deadline is None else min(_SLICE_S, deadline - time.monotonic())
            if left_s <= 0:
                return None
            received = self._early.get(0) or self._source.next(left_s if wait else 0)
            if received is None and not wait:
                return None
            if self._source.live and wait:
                self._idle_now_and_then(received)
            if received is None:
                if not self._source.live:
                    return None
                continue
            self._now_ns = received.at_ns
            if self._sim is not None and self._sim.update(received):
                continue
            report = self._decoder.report(received)
            if report is not None:
                return report


class SimClock:
    """The time of a simulation: the last one that came on `/clock`."""

    now_ns: int | None = None
    """In nanoseconds; None before the first message."""

    def update(self, received: ReceivedMessage) -> bool:
        """Return whether `received` came on `/clock`. What it says is the time now, unless it is no time."""
        if received.topic != CLOCK:
            return False
        found = _nanoseconds(received.fields.get("clock"))
        self.now_ns = self.now_ns if found is None else found
        return True


def _nanoseconds(value: object) -> int | None:
    """Return a time in nanoseconds; None for what is none. A rosbridge sends seconds and nanoseconds apart."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value if value // _BILLION in _SECONDS else None
    match value:
        case {"secs": int(seconds), "nsecs": int(rest)} | {"sec": int(seconds), "nanosec": int(rest)} if (
            seconds in _SECONDS and 0 <= rest < _BILLION
        ):
            return seconds * _BILLION + rest
        case _:
            return None


def with_clock(topics: Mapping[str, str]) -> dict[str, str]:
    """Return `topics` and that of the clock."""
    return {**topics, CLOCK: CLOCK_KIND}
