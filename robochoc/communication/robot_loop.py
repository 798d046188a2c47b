"""A robot's loop during a search, for every transport: queues between processes, or the network.

The loop connects the host, which drives the protocol, to a runtime, which transports bytes. It confirms that the robot
is ready, passes packets of messages to the host, counts messages, reports to the master, and stops at the end.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence

from robochoc.communication.control import Conclusion, Counters, Events, Ready, RobotMessage, RobotSnapshot, WentOn
from robochoc.communication.host import Host
from robochoc.communication.message_dropper import MessageDropper
from robochoc.journal.events import AnyEvent, Sent
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Envelope

IDLE_S = 0.002
"""The time without messages after which a robot reports its counters, in seconds.

The detection of quiescence is correct for any value.
"""
EVENTS_AT_ONCE = 500
"""The maximum number of events in a bundle sent to the master."""


class RobotLoop(ABC):
    """The loop of one robot in the search `epoch`. `observed`: it reports events; `bounds`: they include lower bounds.

    A runtime calls `confirm` when the robot's host exists, `start` when the master orders the start, `admit` for each
    message and `receive` for each packet of messages, `report_idle` when no messages arrive, `go_on` when the master
    reports that no more messages will arrive, and `pause` at the end.
    """

    bundle_bytes: int
    """The size at which a bundle of events is sent, in bytes of all messages."""

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

    # Implemented by runtimes

    @abstractmethod
    def _send_to_master(self, message: RobotMessage) -> None:
        """Send a control message to the master."""

    @abstractmethod
    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        """Send protocol messages to other robots."""

    @abstractmethod
    def _report_end(self) -> None:
        """Send the final report of the search to the master."""

    # The stages of a search

    def confirm(self, host: Host) -> None:
        """Report to the master that the robot is ready to search with `host`."""
        if self._host is not host and self._observed:
            host.observe(self._events.append, self._now, bounds=self._bounds)
        self._host = host
        self._conclude(host)  # a verdict may hold in spite of a change
        self._send_to_master(Ready(self.epoch))

    def start(self, began: float, *, lossless: bool = True) -> None:
        """Start the search, or resume it after a change. Has no effect before `confirm`.

        Args:
            began: The start of the run, on the monotonic clock.
            lossless: True if no message of the previous epoch was lost.
        """
        if self._host is None:
            return
        self._began = began
        self._searching = True
        self._reported = (-1, -1)
        self._send(self._host, self._host.start(lossless=lossless))
        early, self._early = self._early, []
        self.receive(early)

    def admit(self, envelope: Envelope) -> bool:
        """Return whether `envelope` belongs to the current packet.

        A message that arrives before the start is stored for later; a message that arrives after the end is dropped.
        """
        if not (self._searching or self._paused):
            self._early.append(envelope)
        return self._searching

    def receive(self, packet: Sequence[Envelope]) -> None:
        """Handle a packet of messages, and send the answers. Raises `BadMessageError`."""
        if packet and self._host and self._searching:
            self._received += len(packet)
            dropper = self._host.dropper
            self._send(
                self._host, self._host.handle(packet) if dropper is None else self._handle_lossy(packet, dropper)
            )
        if len(self._events) > EVENTS_AT_ONCE:
            self.report_events()

    def _handle_lossy(self, packet: Sequence[Envelope], dropper: MessageDropper) -> list[Envelope]:
        """Handle the messages in a packet that are not dropped, and return the robot's messages.

        If the protocol cannot continue because a message was dropped, here or at another robot, the robot stops
        sending.
        """
        if self._host is None or self._mute:
            return []
        replies = self._host.handle_lossy(packet, dropper.missing, lost=True)
        if replies is None:
            self._mute = True
            dropper.mark_lossy()
            return []
        return replies

    def go_on(self) -> None:
        """Continue without the messages that the protocol waits for, and report to the master whether it can."""
        host = self._host
        replies = host.go_on() if host is not None and self._searching else None
        if host is not None and replies is not None:
            self._send(host, replies)
        self._send_to_master(WentOn(self.epoch, replies is not None))

    def pause(self) -> None:
        """Stop, and send the final report. Messages that arrive later are dropped."""
        self._searching, self._paused = False, True
        self._early = []
        self.report_events()
        self._report_end()

    def _send(self, host: Host, envelopes: Sequence[Envelope]) -> None:
        self._transmit(envelopes)
        self._sent += len(envelopes)
        self._conclude(host)

    def _conclude(self, host: Host) -> None:
        """Report the protocol's verdict to the master, only once."""
        verdict = host.protocol.verdict
        if verdict is not None and not self._concluded:
            self._concluded = True
            self._send_to_master(Conclusion(self.epoch, verdict))

    # Reports

    @property
    def is_restless(self) -> bool:
        """True if the counters have changed since the last report to the master."""
        return self._searching and self._reported != (self._sent, self._received)

    def report_counters(self, wave: int) -> None:
        """Send the counts of sent and received messages to the master, in answer to `wave` or unasked (0)."""
        self._reported = (self._sent, self._received)
        self._send_to_master(Counters(self.epoch, wave, *self._reported))

    def report_snapshot(self, number: int) -> None:
        """Send the answer to `TakeSnapshot` to the master. The search continues."""
        host = self._host
        if host is not None:
            assignment, findings = self._known_to_master(host)
            lost = 0 if host.dropper is None else host.dropper.count
            self._send_to_master(RobotSnapshot(self.epoch, number, assignment, lost, findings))

    def _known_to_master(self, host: Host) -> tuple[dict[str, int], Findings]:
        """Return the values and findings that the master is allowed to know."""
        return host.protocol.assignment, host.protocol.findings

    def report_idle(self) -> None:
        """Send all due reports to the master, since the robot is idle."""
        self.report_events()
        self.report_counters(0)

    def report_events(self) -> None:
        """Send the events recorded since the last report, in bundles of about `bundle_bytes` at most."""
        events, self._events[:] = list(self._events), []
        size = start = 0
        for end, event in enumerate(events, 1):
            size += event.bytes if isinstance(event, Sent) else 0
            if size >= self.bundle_bytes or end - start == EVENTS_AT_ONCE or end == len(events):
                self._send_to_master(Events(events[start:end]))
                size, start = 0, end

    def _now(self) -> float:
        return time.monotonic() - self._began
