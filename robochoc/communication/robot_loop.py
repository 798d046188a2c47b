"""A robot's part in a search, for every transport: queues between processes, or the network.

It stands between the host, which drives the protocol, and a runtime, which moves bytes. It confirms that the robot is
ready, hands packets of messages to the host, counts, reports to the master, and is silent once the search is over.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence

from robochoc.communication.control import Conclusion, Counters, Events, Ready, RobotMessage, Snapshot, WentOn
from robochoc.communication.dropped import Dropped
from robochoc.communication.host import Host
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.message import Envelope
from robochoc.protocols.findings import Findings

IDLE_S = 0.002
"""Seconds without a message after which a robot reports its counters.

It says when to ask, never what is true.
"""
EVENTS_AT_ONCE = 500
"""The most events in one bundle to the master."""


class RobotLoop(ABC):
    """One robot in the search `epoch`; `observed` says whether its events are wanted, `bounds`, also lower bounds.

    A runtime calls `confirm` when the robot's host is there, `begin` when the master orders the start, `admit` for each
    message and `take_in` for each packet of them, `report_idle` when nothing comes, `go_on` when the master says that
    nothing will, and `pause` at the end.
    """

    bundle_bytes: int
    """The size at which a bundle of events is closed: bytes of all its messages."""

    def __init__(self, epoch: int, *, observed: bool, bounds: bool = False) -> None:
        self.epoch = epoch
        self._observed = observed
        self._bounds = bounds
        self._host: Host | None = None
        self._events: list[AnyEvent] = []
        self._began = 0.0
        self._reset()

    def _reset(self) -> None:
        self._early: list[Envelope] = []
        self._sent = self._received = 0
        self._reported: tuple[int, int] | None = None
        self._searching = self._concluded = self._paused = self._mute = False

    # What a runtime supplies

    @abstractmethod
    def _say(self, message: RobotMessage) -> None:
        """Send a control message to the master."""

    @abstractmethod
    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        """Send messages of the protocol to other robots."""

    @abstractmethod
    def _report_end(self) -> None:
        """Tell the master what came of the search."""

    # The course of a search

    def confirm(self, host: Host) -> None:
        """Tell the master that the robot is ready to search with `host`."""
        if self._host is not host and self._observed:
            host.observe(self._events.append, self._now, bounds=self._bounds)
        self._host = host
        self._conclude(host)  # a verdict can stand in spite of a change
        self._say(Ready(self.epoch))

    def begin(self, began: float, *, lossless: bool = True) -> None:
        """Begin the search, or resume it after a change. Nothing happens before `confirm`.

        Args:
            began: When the run began, on the monotonic clock.
            lossless: No message of the epoch before was lost.
        """
        if self._host is None:
            return
        self._began = began
        self._searching = True
        self._reported = (-1, -1)
        self._send(self._host, self._host.start(lossless=lossless))
        early, self._early = self._early, []
        self.take_in(early)

    def admit(self, envelope: Envelope) -> bool:
        """Return whether `envelope` belongs to the packet at hand.

        It is kept before the start, and lost after the end.
        """
        if not (self._searching or self._paused):
            self._early.append(envelope)
        return self._searching

    def take_in(self, packet: Sequence[Envelope]) -> None:
        """Handle all messages that wait, and send the answers. Raises `BadMessageError`."""
        if packet and self._host and self._searching:
            self._received += len(packet)
            dropped = self._host.dropped
            self._send(self._host, self._host.handle(packet) if dropped is None else self._lossy(packet, dropped))
        if len(self._events) > EVENTS_AT_ONCE:
            self.report_events()

    def _lossy(self, packet: Sequence[Envelope], dropped: Dropped) -> list[Envelope]:
        """Handle what is not dropped of a packet; return what the robot says.

        Where its protocol cannot go on without what is missing, here or at another robot, it is silent from then on.
        """
        if self._host is None or self._mute:
            return []
        said = self._host.handle_lossy(packet, dropped.missing, lost=True)
        if said is None:
            self._mute = True
            dropped.refuse()
            return []
        return said

    def go_on(self) -> None:
        """Go on without the messages that the protocol waits for, and tell the master whether it does."""
        host = self._host
        said = host.go_on() if host is not None and self._searching else None
        if host is not None and said is not None:
            self._send(host, said)
        self._say(WentOn(self.epoch, said is not None))

    def pause(self) -> None:
        """Be silent, and report. What still arrives is lost."""
        self._searching, self._paused = False, True
        self._early = []
        self.report_events()
        self._report_end()

    def _send(self, host: Host, envelopes: Sequence[Envelope]) -> None:
        self._transmit(envelopes)
        self._sent += len(envelopes)
        self._conclude(host)

    def _conclude(self, host: Host) -> None:
        """Tell the master, once, that the protocol has a verdict."""
        verdict = host.protocol.verdict
        if verdict is not None and not self._concluded:
            self._concluded = True
            self._say(Conclusion(self.epoch, verdict))

    # Reports

    @property
    def is_restless(self) -> bool:
        """Return whether the master does not know the present counters yet."""
        return self._searching and self._reported != (self._sent, self._received)

    def report_counters(self, wave: int) -> None:
        """Tell the master how many messages were sent and received: in answer to `wave`, or (0) unasked."""
        self._reported = (self._sent, self._received)
        self._say(Counters(self.epoch, wave, *self._reported))

    def report_snapshot(self, number: int) -> None:
        """Tell the master what the robot has, in answer to `TakeSnapshot`. The search goes on."""
        host = self._host
        if host is not None:
            assignment, findings = self._known_to_master(host)
            lost = 0 if host.dropped is None else host.dropped.many
            self._say(Snapshot(self.epoch, number, assignment, lost, findings))

    def _known_to_master(self, host: Host) -> tuple[dict[str, int], Findings]:
        """Return what the master may know: the own values, and what is known of the whole search."""
        return host.protocol.assignment, host.protocol.findings

    def report_idle(self) -> None:
        """Send the master all reports that are due, as the robot is idle."""
        self.report_events()
        self.report_counters(0)

    def report_events(self) -> None:
        """Send the events since the last report, in bundles that the way to the master can carry."""
        events, self._events[:] = list(self._events), []
        size = start = 0
        for end, event in enumerate(events, 1):
            size += event.bytes if isinstance(event, Sent) else 0
            if size >= self.bundle_bytes or end - start == EVENTS_AT_ONCE or end == len(events):
                self._say(Events(events[start:end]))
                size, start = 0, end

    def _now(self) -> float:
        return time.monotonic() - self._began
