"""Feedback from a source: live or recorded reports of robots, and the clock of a simulation."""

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
_TOPICS_MAX = 3
"""The maximum number of expected topics in a note."""
_NOTES_MAX = 12
_SLICE_S = 0.2
"""The interval between calls of `idle`, and the longest time of `poll`, in seconds."""


class SourceFeedback(Feedback):
    """Reports from `source`, decoded by `decoder`.

    A run ends if a live source sends no report that changes the problem within `patience_s` seconds after a decision.
    This time does not pass while the source is busy. A recording is read to its end as fast as possible; the times of
    its messages are the present time.

    With `sim_time`, decisions have the time on `/clock`. Raises `SourceError` if no time arrives within `patience_s`.
    """

    def __init__(
        self, source: Source, decoder: ReportDecoder, patience_s: float = PATIENCE_S, *, sim_time: bool = False
    ) -> None:
        self._source = source
        self._decoder = decoder
        self._patience_s = patience_s
        self._deadline: float | None = None
        self._pending: Report | None = None
        self._now_ns: int | None = None
        self._sim = SimClock() if sim_time else None
        self._early = MessageInbox()
        self._last = math.inf
        self._idle_s = time.monotonic()
        source.assign(decoder.namespaces)
        source.listen(with_clock_topic(decoder.topics) if sim_time else decoder.topics)
        if not source.live:
            self._pending = self._next_report(None)

    @property
    def notes(self) -> list[str]:
        """Notes on places in other frames, and on unused topics in a recording."""
        frames = [
            f"places on {topic} are in the frame '{frame}', and were ignored (set the team's frame by --frame)"
            for topic, frame in self._decoder.other_frames.items()
        ]
        others = [*filter(None, starmap(self._unused_note, self._source.others.items()))]
        more = [f"and {len(others) - _NOTES_MAX:,} more topics were ignored"] * (len(others) > _NOTES_MAX)
        return [*frames, *others[:_NOTES_MAX], *more]

    def _unused_note(self, topic: str, kind: str) -> str:
        """Return the reason why a topic that looks like a report was ignored; empty for other topics."""
        expected = self._decoder.topics.get(topic)
        if expected:
            return on_one_line(f"{topic} has the type {kind}, not {expected}, and was ignored")
        token = topic.rpartition("/")[2]
        if REPORTS.get(token) == short_kind(kind):
            known = [one for one in self._decoder.topics if one.endswith(f"/{token}")]
            listed = ", ".join([*known[:_TOPICS_MAX], *["..."] * (len(known) > _TOPICS_MAX)])
            return on_one_line(f"{topic} does not belong to a drone of this team, and was ignored (expected: {listed})")
        return ""

    def check(self) -> None:
        """Raise `SourceError` if the source lacks a sink."""
        self._source.check()

    def now_ns(self) -> int:
        """Return the present time according to the wall clock, the recording, or `/clock`."""
        if self._sim is not None:
            return self._sim_ns(self._sim)
        return time.time_ns() if self._source.live or self._now_ns is None else self._now_ns

    def _sim_ns(self, clock: SimClock) -> int:
        """Return the newest time of the simulation, after waiting for the first one. Raises `SourceError`.

        Other messages that arrive during the wait are stored in an inbox.
        """
        deadline = time.monotonic() + self._patience_s
        while self._source.live and time.monotonic() < deadline:
            received = self._source.next(0 if clock.now_ns is not None else _SLICE_S)
            if received is not None and not clock.update(received):
                self._early.put(received, weight_of(received.fields))
            if clock.now_ns is None:
                self._idle_if_due(received)
            elif received is None:
                break
        if clock.now_ns is None:
            when = f"within {self._patience_s:g} s" if self._source.live else "before its first report"
            problem = f"no time received on {CLOCK} of {self._source.place or 'the source'} {when}"
            raise SourceError(on_one_line(f"{problem}; start the simulation, or omit --use-sim-time"))
        return clock.now_ns

    def on_decision(self, builder: MissionBuilder, leg: Leg, left_s: float | None) -> None:  # noqa: ARG002 - the decision was published
        """Start the wait for reports."""
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
        report, self._pending = self._pending or self._next_report(soon), None
        if report is not None and until_s is not None and report.at_s > until_s:
            self._pending = report
            return None
        self._publish(report)
        return report

    def poll(self) -> Report | None:
        """Return an available report from a live source; see `Feedback.poll`."""
        if self._pending is None and self._source.live:
            self._pending = self._next_report(time.monotonic() + _SLICE_S, wait=False)
        report, self._pending = (self._pending, None) if self._source.live else (None, self._pending)
        self._publish(report)
        return report

    def _publish(self, report: Report | None) -> None:
        """Publish a report, if there is one, with all publishers."""
        if report is not None:
            for publisher in self.publishers:
                publisher.report(self._with_sim_time(report))

    def _with_sim_time(self, report: Report) -> Report:
        """Return `report` with the time of the simulation, if simulated time is used."""
        now_ns = self._sim.now_ns if self._sim else None
        return report if now_ns is None else replace(report, at_s=now_ns / 1e9)

    def _end_of_wait(self, soon: float | None) -> float | None:
        """Return the end of the wait for reports, at most `soon`; None if the wait is unlimited."""
        if self._deadline is not None and self._source.is_busy:
            self._deadline = min(time.monotonic() + self._patience_s, self._last)
        return min((each for each in (self._deadline, soon) if each is not None), default=None)

    def _idle_if_due(self, received: ReceivedMessage | None) -> None:
        """Call `idle` if no message was received, and at intervals if messages arrive continually."""
        now = time.monotonic()
        if received is None or now - self._idle_s >= _SLICE_S:
            self._idle_s = now
            self.idle()

    def _next_report(self, soon: float | None, *, wait: bool = True) -> Report | None:
        """Return the next report from the source before `soon` and the end of the wait; None if no report arrives.

        Without `wait`, return None as soon as no message is available, at `soon` at the latest.
        """
        while True:
            deadline = self._end_of_wait(soon) if wait else soon
            left_s = _SLICE_S if deadline is None else min(_SLICE_S, deadline - time.monotonic())
            if left_s <= 0:
                return None
            received = self._early.get(0) or self._source.next(left_s if wait else 0)
            if received is None and not wait:
                return None
            if self._source.live and wait:
                self._idle_if_due(received)
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
    """The time of a simulation, from the last message on `/clock`."""

    now_ns: int | None = None
    """The time in nanoseconds; None before the first message."""

    def update(self, received: ReceivedMessage) -> bool:
        """Set the time from a message on `/clock`, unless it is invalid; return False for other topics."""
        if received.topic != CLOCK:
            return False
        found = _nanoseconds(received.fields.get("clock"))
        self.now_ns = self.now_ns if found is None else found
        return True


def _nanoseconds(value: object) -> int | None:
    """Return a time in nanoseconds; None if invalid. A rosbridge sends seconds and nanoseconds separately."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value if value // _BILLION in _SECONDS else None
    match value:
        case {"secs": int(seconds), "nsecs": int(rest)} | {"sec": int(seconds), "nanosec": int(rest)} if (
            seconds in _SECONDS and 0 <= rest < _BILLION
        ):
            return seconds * _BILLION + rest
        case _:
            return None


def with_clock_topic(topics: Mapping[str, str]) -> dict[str, str]:
    """Return `topics` and the clock topic."""
    return {**topics, CLOCK: CLOCK_KIND}
