"""The control messages of a master across machines: their handling, and the detection of lost robots.

A robot counts as lost when its liveliness token has been missing for longer than the patience.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from typing import Self

from robochoc.authority.admission import Admission
from robochoc.authority.identity import Identity
from robochoc.communication.control import EpochMessage, Events, RobotFailed
from robochoc.communication.master_loop import TICK_S, MasterLoop
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.checked_snapshots import CheckedSnapshots
from robochoc.communication.network.control_messages import (
    Accepted,
    Bye,
    ControlMessage,
    DirectoryRequest,
    DomainAnswer,
    Heartbeat,
    Joined,
    JournalRequest,
    LostFrames,
    Objection,
    Promised,
    Register,
    Revoked,
    Spent,
    StandbyRequest,
    Standing,
    ToRobot,
)
from robochoc.communication.network.facilitator import DirectoryFacilitator, RequestHandler
from robochoc.communication.network.frame_loss import TO_MASTER, LossTracker
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item, PresenceChanged, WakeUp
from robochoc.communication.network.journal_server import Publication
from robochoc.communication.network.master_connection import MasterConnection
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.master_votes import MasterVotes, NoMajorityError
from robochoc.communication.network.masters import HEARTBEAT_S, SILENCE_S
from robochoc.communication.network.members import Member, NetworkMembers
from robochoc.communication.network.registrar import Registrar
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.standbys import Standbys
from robochoc.communication.robot_loop import IDLE_S
from robochoc.communication.search_result import Progress, RobotsLostError
from robochoc.journal.events import Observer
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

REGISTRY_S = 0.5
"""The interval for reading the Authority's registry for new enrolments and revocations, in seconds."""
HELD_S = 15.0
"""The longest delay of a frame while all links are up, in seconds.

zenoh detects after `transport.HEARTBEAT_S` (5 s) that the last frame from a sender is missing, requests the frame, and
waits 10 s for a busy machine that does not answer. So the master waits longer than this for reports after a verdict,
and before it decides that messages are lost.
"""


WAVE_S = IDLE_S
"""The least interval between two waves, in seconds: robots that answer each one stay far below their quotas."""


class MasterControl(MasterLoop):
    """Handles the messages of robots, observers and standby masters for `Master`, and detects lost robots.

    Args:
        admission: Decides which robots are admitted.
        identity: The master's certificate and key.
        endpoint: The address at which robots reach the master.
        members: The expected robots; later also the registered ones.
        settings: The settings of the run.
        observer: Receives all events, including refusals, which come from other threads.
        watched: True if the observer receives the robots' events too.
        progress: Receives the message count from time to time.
    """

    state: AuditedSearchState
    wave_s = WAVE_S

    def __init__(
        self,
        admission: Admission,
        identity: Identity,
        endpoint: str,
        members: NetworkMembers,
        settings: NetworkSettings = NetworkSettings(),
        *,
        observer: Observer | None = None,
        watched: bool = False,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        super().__init__(progress)
        self.endpoint = endpoint
        self.run = secrets.token_hex(8)
        self.members = members
        self.state = AuditedSearchState()
        self._settings = settings
        self._registry_read = 0.0
        self.events = MasterEvents(observer)
        connection = MasterConnection(self.run, identity, admission, endpoint, members.ways, settings, self.events)
        self._connection, self._send, self._policy = connection, connection.send, connection.policy
        self._journal_server = connection.journal_server
        self._facilitator = DirectoryFacilitator(endpoint, settings.protocol)
        self._requests = RequestHandler(self._journal_server, self._facilitator, self._send, self.events.refuse)
        self.votes = MasterVotes(self.run, identity.name)
        self._standbys = Standbys(admission, connection.send, lambda: self.spent)
        self._heartbeat_at = self._listens_since = 0.0
        self._registrar = Registrar(members, connection, self._facilitator, self.events, settings, watched, self.votes)
        self.is_superseded: Callable[[], bool] = bool
        """Returns whether a master with a higher priority leads, so that this one must not close a team."""
        self.takes_over = False
        """True if another master has closed a team, whose robots look for a master."""
        self.spent_before = Spent()
        """The effort of the search under earlier masters."""
        self.limited_since: float | None = None
        """The time from which time limits count, on the monotonic clock; None: there was no search."""
        self._dead: dict[str, str] = {}
        self._has_ended = False
        self.absent: dict[str, str] = {}
        """Robots of another master's team that did not come to this master, with the reason."""
        self.snapshots: CheckedSnapshots | None = None
        """The snapshots in the current search, if robots must check them."""
        self._frame_loss = LossTracker(members, self.events.refuse, self._lose)

    @property
    def spent(self) -> Spent:
        """The effort of the search so far, also under earlier masters."""
        if self.limited_since is None:
            return self.spent_before
        messages = self.spent_before.messages + self.state.counters.sent
        return Spent(messages, time.monotonic() - self.limited_since)

    def __enter__(self) -> Self:
        """Listen. Raises `RouterError` and `CannotConnectError`."""
        self._connection.open()
        return self

    def __exit__(self, *_error: object) -> None:
        self._connection.close()

    @property
    def is_private(self) -> bool:
        """True if robots do not disclose their values."""
        return self._settings.private

    def publish(self, publication: Publication) -> None:
        """Offer `publication`, this run's journal, to authorized sniffers. Must be called before the master listens."""
        self._connection.publish(publication)

    # The loop

    def _serve(self, patience_s: float, deadline: float | None) -> None:  # noqa: ARG002 - it is always short
        until = time.monotonic() + TICK_S
        item = self._connection.receive(max(patience_s, 0.001))
        while item is not None:
            self._handle_item(item)
            item = self._connection.receive(0) if time.monotonic() < until else None
        while self._dead:
            self._lose(*self._dead.popitem(), for_good=True)

    def _handle_item(self, item: Item) -> None:
        match item:
            case FrameArrived(sender, content):
                self._read(sender, content)
            case PresenceChanged(name, there):
                if member := self.members.robots.get(name):
                    member.note_presence(there=there)
            case FramesLost():
                self._frame_loss.note_at_master(item)
            case WakeUp():
                pass

    def _check_robots(self, now: float) -> None:
        """Find revoked robots, and robots that have been absent for too long."""
        if failure := self._policy.failure:
            raise RobotsLostError({MASTER: f"the router's process {failure}"})
        if self.votes.is_needed and now - self._heartbeat_at >= HEARTBEAT_S:
            self._heartbeat_at = now
            self._send_all(Heartbeat())
        away_s = self._settings.patience_s
        for name in [n for n, member in self.members.robots.items() if member.is_away(away_s) and not member.left]:
            self._lose(name, f"it has not been there for {away_s:g} s")
        if now - self._registry_read >= REGISTRY_S:
            self._registry_read = now
            self._registrar.welcome_again()
            self._facilitator.expire()
            self._notify_subscribers()
            self._follow_registry()

    def _notify_subscribers(self) -> None:
        """Send the directory's notices on new, removed or changed robots."""
        for subscriber, answer in self._facilitator.notices():
            self._send(subscriber, answer)

    def _follow_registry(self) -> None:
        """Admit newly enrolled robots, and exclude revoked ones. Both require restarting the router with new rules."""
        for name in self._policy.revoked(self.members.robots):
            if name not in self.state.lost:
                self.events.refuse(name, "take part", "its certificate was revoked")
                self._send_all(Revoked(name))
                self._policy.follow()
                self._lose(name, "its certificate was revoked")
        self._connection.follow_registry()

    @property
    def _transit_s(self) -> float:
        """See `MasterLoop`. Without a reported loss, zenoh may only have delayed the missing messages."""
        return self._settings.patience_s + (0 if self._frame_loss.is_reported else HELD_S)

    def _end_stalled(self) -> None:
        if not self._frame_loss.explain(self.state.unready):
            super()._end_stalled()

    # Messages

    def _send_all(self, message: ToRobot) -> None:
        for name in self.members.listening:
            self._send(name, message)

    def _read(self, sender: str, content: bytes) -> None:
        opened = self._connection.read(sender, content)
        if opened is None:
            return
        member = self.members.robots.get(sender)
        match opened.message:
            case Register(profile, incarnation, standing):
                if member and standing and self._has_left(member, incarnation, standing):
                    raise NoMajorityError(f"{sender} has left this master for another one, which begins a later term")
                if self._registrar.register(sender, profile, incarnation, standing) and self._progress:
                    elapsed_s, number = time.monotonic() - self._began, len(self.members.robots)
                    self._progress(Progress(0, elapsed_s, f"{number} robots registered"))
            case DirectoryRequest() | JournalRequest():
                self._requests.answer(sender, opened.message)
            case StandbyRequest():
                self._standbys.answer(sender, opened.message)
            case _ if member is None:
                self.events.refuse(sender, TO_MASTER, "it is not registered")
            case message:
                self._handle(sender, member, message)

    def _handle(self, name: str, member: Member, message: ControlMessage) -> None:
        match message:
            case EpochMessage():
                self._note_failure(name, self.state.handle(name, message))
            case Joined(incarnation, card):
                member.join(incarnation, card)
            case DomainAnswer(variables, symbolic, real_places):
                self._note_failure(name, self.members.show(name, variables, symbolic, real_places))
            case Events(events):
                self.events.relay_from(name, events)
            case RobotFailed(why, unsupported, elsewhere):
                refusal = TooLargeError if elsewhere else UnsupportedError
                self._note_failure(name, why, refusal if unsupported else None)
            case Objection() | LostFrames():
                self._handle_report_on_others(name, message)
            case Promised() | Accepted():
                self._note_failure(name, self.votes.note(name, message))
            case Bye():
                self._dismiss(name, member)
            case _:
                raise AssertionError(message)  # `Framing` decodes no other messages

    def _dismiss(self, name: str, member: Member) -> None:
        """Record that the robot has left after the end, or count it as lost if the run is not over."""
        if self._has_ended:
            member.left = True
        else:
            self._lose(name, "it has left before the end of the run", for_good=True)

    def _has_left(self, member: Member, incarnation: str, standing: Standing) -> bool:
        """Return whether the robot of `member` has left this master's search, and registers again."""
        is_here = bool(standing.mission) and standing.mission == self.votes.mission
        return self.members.closed and is_here and incarnation != member.incarnation

    def _handle_report_on_others(self, name: str, report: Objection | LostFrames) -> None:
        if not self.events.may_report_others(name):
            return
        if isinstance(report, LostFrames):
            self._frame_loss.note_between(name, report)
        else:
            self.events.refuse(report.who, report.what, f"{report.why} (reported by {name})")

    def _note_failure(self, name: str, why: str, refusal: type[UnsupportedError] | None = None) -> None:
        """Record that the robot `name` cannot continue, if there is a `why`. A `refusal` ends the run."""
        why = on_one_line(why, LONGEST_REASON)
        if refusal:
            raise refusal(why)
        if why:
            self._lose(name, why, for_good=True)

    def _lose(self, name: str, why: str, *, for_good: bool = False) -> None:
        """Record that the robot is lost. Before a search it may return, unless `for_good`; during a search it may not.

        Raises `RobotsLostError` unless the run survives the loss.
        """
        member = self.members.robots.get(name)
        if name in self.state.lost or (member.left if member else not for_good or self.members.closed):
            return
        self._facilitator.leave(name)
        if not self.members.closed and not for_good:
            self.members.drop_out(name)
            self.events.dropped_out(name, why)
            return
        self.events.lost(name, why)
        self.state.lose(name, why)
        self.votes.check_majority(
            [n for n, one in self.members.robots.items() if n not in self.state.lost and not one.is_away(SILENCE_S)]
        )
        if not self._settings.survive or not self.members.closed:
            raise RobotsLostError({name: why})
