"""The master across machines, as in Figure 3: it "launches its communication interface listening on the network".

The master runs the router and is a participant like the robots. It registers robots (without access to their files),
closes the team when all robots are present, sends each robot its task, orders the start, detects quiescence by four
counters, collects the decision, lets every robot check its constraints against the decision, and ends the run.

A robot counts as lost when its liveliness token has been missing for longer than the patience.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Self

from robochoc.authority.admission import Admission
from robochoc.authority.identity import Identity
from robochoc.communication.control import EpochMessage, Events, Pause, RobotFailed
from robochoc.communication.master_loop import TICK_S, MasterLoop
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.checked_snapshots import CheckedSnapshots
from robochoc.communication.network.control_messages import (
    Accepted,
    Adopt,
    Bye,
    CheckRequest,
    ControlMessage,
    DirectoryRequest,
    DomainAnswer,
    DomainRequest,
    Heartbeat,
    Joined,
    JournalRequest,
    Leave,
    LostFrames,
    Objection,
    Promised,
    Register,
    RegistrationDenied,
    Revoked,
    StandbyRequest,
    Standing,
    StartSearch,
    TeamDecision,
    ToRobot,
    Welcome,
)
from robochoc.communication.network.facilitator import DirectoryFacilitator, RequestHandler
from robochoc.communication.network.frame_loss import TO_MASTER, LossTracker
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item, PresenceChanged, WakeUp
from robochoc.communication.network.journal_server import Publication
from robochoc.communication.network.master_connection import MasterConnection
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.master_votes import MasterVotes, NoMajorityError, SupersededError
from robochoc.communication.network.masters import HEARTBEAT_S, SILENCE_S
from robochoc.communication.network.members import Member, NetworkMembers, RegistrationRefusedError
from robochoc.communication.network.profile import Profile
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.standbys import Standbys
from robochoc.communication.search_result import Progress, RobotsLostError, SearchResult
from robochoc.communication.session import is_past
from robochoc.journal.events import Observer
from robochoc.protocols.traits import Traits
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line


class Registrar:
    """Registers robots in `members`: checks profiles, welcomes robots, and adds them to the directory.

    Args:
        members: The registered robots.
        connection: The master's connection. Frames from and to a new incarnation are numbered from 1.
        facilitator: The directory of robots.
        events: Receives registrations and refusals.
        settings: The settings of the run. A welcome contains some of them.
        watched: True if robots are to report their events.
        votes: Knows the mission of robots that know several masters.
    """

    def __init__(
        self,
        members: NetworkMembers,
        connection: MasterConnection,
        facilitator: DirectoryFacilitator,
        events: MasterEvents,
        settings: NetworkSettings,
        watched: bool,  # noqa: FBT001 - passed on by the master
        votes: MasterVotes,
    ) -> None:
        self._members = members
        self._connection = connection
        self._facilitator = facilitator
        self._events = events
        self._settings = settings
        self._watched = watched
        self._votes = votes

    def register(self, name: str, profile: Profile, incarnation: str, standing: Standing | None) -> bool:
        """Register and welcome a robot, or refuse it. Return whether the robot is new."""
        known = self._members.robots.get(name)
        try:
            self._join_mission(standing)
            member = self._members.register(name, profile, incarnation, admitted=self._connection.policy.is_robot(name))
        except RegistrationRefusedError as refusal:
            self._deny(name, incarnation, str(refusal))
            return False
        if member is not known:
            self._connection.framing.forget(name)
            if unfit := self._facilitator.enter(profile):
                self._events.refuse(name, "be in the directory", unfit)
            self._events.registered(name)
        self._welcome(name, incarnation)
        return member is not known

    def _join_mission(self, standing: Standing | None) -> None:
        """Consider the standing of a robot. If another master closed its team, only the team's robots may register.

        Raises `RegistrationRefusedError`.
        """
        before = self._votes.mission
        if why := self._votes.admit(standing, closed=self._members.closed):
            raise RegistrationRefusedError(why)
        if self._votes.mission != before:
            for name, incarnation in self._members.expect(self._votes.team).items():
                self._deny(name, incarnation, "it is not a member of the team")

    def _deny(self, name: str, incarnation: str, why: str) -> None:
        self._events.refuse(name, "register", why)
        self._connection.send(name, RegistrationDenied(incarnation, why))

    def welcome_again(self) -> None:
        """Welcome again robots that have not answered a welcome since they registered or returned."""
        for name, incarnation in self._members.to_welcome().items():
            self._welcome(name, incarnation)

    def _welcome(self, name: str, incarnation: str) -> None:
        settings = self._settings
        welcome = Welcome(incarnation, self._connection.framing.run, settings.filters, self._watched, settings.private)
        self._connection.send(name, welcome)


REGISTRY_S = 0.5
"""The interval for reading the Authority's registry for new enrolments and revocations, in seconds."""
REPORTS_S, FAREWELL_S, AGAIN_S = 10.0, 5.0, 0.5
HELD_S = 15.0
"""The longest delay of a frame while all links are up, in seconds.

zenoh detects after `transport.HEARTBEAT_S` (5 s) that the last frame from a sender is missing, requests the frame, and
waits 10 s for a busy machine that does not answer. So the master waits longer than this for reports after a verdict,
and before it decides that messages are lost.
"""


class Master(MasterLoop):
    """The master, listening at `endpoint` (`HOST:PORT`); a context manager.

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
        self._standbys = Standbys(admission, connection.send)
        self._heartbeat_at = 0.0
        self._registrar = Registrar(members, connection, self._facilitator, self.events, settings, watched, self.votes)
        self.is_superseded: Callable[[], bool] = bool
        """Returns whether a master with a higher priority leads, so that this one must not close a team."""
        self._dead: dict[str, str] = {}
        self._has_ended = False
        self.absent: dict[str, str] = {}
        """Robots of another master's team that did not come to this master, with the reason."""
        self.snapshots: CheckedSnapshots | None = None
        """The snapshots in the current search, if robots must check them."""
        self._frame_loss = LossTracker(members, self.events.refuse, self._lose)

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

    # The course of a run

    def gather(self, deadline: float | None = None) -> bool:
        """Wait until all robots are registered. Return False if the deadline (on the monotonic clock) passes first.

        Raises `UnsupportedError` for a constraint over a variable that belongs to no neighbour of the constraint's
        robot.
        """
        until = math.inf if deadline is None else deadline  # people start the robots
        self._serve_until(lambda: self.members.complete or self._is_gathered(), until)
        if self._is_to_step_down:
            raise SupersededError("a master with a higher priority leads")
        unseen = self.members.unseen()
        while unseen and not is_past(deadline):
            for name, variables in unseen.items():
                self._send(name, DomainRequest(variables))
            self._serve_until(lambda before=unseen: self.members.unseen() != before, until)  # type: ignore[misc]
            unseen = self.members.unseen()
        self.members.closed = self.members.complete and not unseen
        invalid = next(self.members.invalid_scopes(), None) if self.members.closed else None
        if invalid:
            raise UnsupportedError(invalid)
        return self.members.closed

    def _is_gathered(self) -> bool:
        """Return whether to wait no longer for robots, because another master leads, or has led the missing robots.

        Raises:
            RobotsLostError: if robots of another master's team do not come, and the run does not survive that.
            NoMajorityError: if fewer than a majority of this team has come.
        """
        if self._is_to_step_down:
            return True
        missing = sorted(set(self.votes.team) - self.members.robots.keys())
        last = max((member.since for member in self.members.robots.values()), default=None)
        if not missing or last is None or not is_past(last + self._settings.patience_s):
            return False
        self.votes.check_team(self.members.robots)
        why = "it did not come to this master after the previous one was gone"
        if not self._settings.survive:
            raise RobotsLostError(dict.fromkeys(missing, why))
        for name in missing:
            self.events.lost(name, why)
        self.absent |= dict.fromkeys(missing, why)
        self.members.give_up(missing)
        return self.members.complete

    @property
    def _is_to_step_down(self) -> bool:
        """True if a master with a higher priority leads, and no robot here has left its run."""
        return not self.votes.mission and self.is_superseded()

    def elect(self) -> TeamDecision | None:
        """Obtain the votes of a majority of the team, if robots know several masters.

        Returns:
            The decision that this master must confirm instead of a search, because an earlier one may have published
            it, or None.

        Raises:
            NoMajorityError: if a majority does not vote for this master.
            RobotsLostError: if a robot is lost, and the run does not survive that.
        """
        if not self.votes.is_needed:
            return None
        self._send_all(self.votes.start(self.members.order))
        self._wait_for_votes(lambda: self.votes.promised)
        self.votes.check_promises()
        self.events.leads(self.votes.name, self.votes.term or 0, self.votes.reason)
        return self.votes.inherited

    def confirm(self, decision: TeamDecision) -> None:
        """Let a majority of the team accept the decision, if robots know several masters. Raises `NoMajorityError`."""
        if not self.votes.is_needed:
            return
        self._send_all(self.votes.propose(decision))
        self._wait_for_votes(lambda: self.votes.accepted)
        self.votes.check_acceptances()

    def _wait_for_votes(self, votes: Callable[[], frozenset[str]]) -> None:
        """Wait for the votes of all present robots, for a limited time."""
        away_s = self._settings.patience_s + self._settings.lease_ms / 1000
        self._serve_until(
            lambda: votes() >= set(self.members.listening) - set(self.state.lost), time.monotonic() + away_s
        )

    def search(
        self,
        protocol: str,
        traits: Traits,
        parameters: RunParameters,
        timeout: float | None = None,
        messages: int | None = None,
        *,
        checked: bool = False,
    ) -> SearchResult:
        """Let all registered robots start a search by `protocol`, for at most `timeout` seconds.

        If there is a `watch`, it receives snapshots. If `checked`, it receives only snapshots that all robots have
        checked (`snapshots`).

        Raises:
            RobotsLostError: if robots are lost and the run does not survive that, or messages are permanently lost.
            UnsupportedError: if a robot's problem is too large, or not supported by the protocol.
        """
        began = time.monotonic()
        self.events.start_search()
        deadline = None if timeout is None else began + timeout
        self._policy.open_ways(self.members.reach(writes_to_non_neighbours=traits.writes_to_non_neighbours))
        epoch, declared = self.state.epoch + 1, self.members.declared(traits)
        state = self.state = AuditedSearchState(epoch, self.members.order, messages, declared)
        state.drops = parameters.message_loss > 0
        state.lossy = state.drops and traits.bears_loss
        self.snapshots = CheckedSnapshots(state, self.members, self._send) if checked else None
        for name, task in self.members.tasks(epoch, protocol, traits, parameters).items():
            self._send(name, task)
        self._search_until(deadline)
        if self.snapshots and self.watch and not state.lost:
            self.watch.wants_snapshot(time.monotonic())  # do due work without waiting for the reports
        state.note_end(time.monotonic() - began, in_time=not (is_past(deadline) or self.is_to_stop))
        self._collect()
        return state.result(state.duration_s)

    def _ask_for_snapshot(self, number: int) -> None:
        if self.snapshots:
            self.snapshots.ask(number)
        else:
            super()._ask_for_snapshot(number)

    def _snapshot(self) -> SearchResult | None:
        return self.snapshots.advance() if self.snapshots else super()._snapshot()

    def adopt(self, number: int, why: str = "") -> None:
        """Order all robots to keep their values in a snapshot, or (with a `why`) to decide on them. See `Adopt`."""
        self._send_all(Adopt(self.state.epoch, number, why))

    def _order_start(self) -> None:
        self._send_all(StartSearch(self.state.epoch))
        self.events.start_search()

    def _collect(self) -> None:
        """End the search, and collect all reports. Raises `RobotsLostError` if the search was stuck."""
        state = self.state
        self._send_all(Pause())
        patience_s = REPORTS_S if state.verdict is None else REPORTS_S + HELD_S
        self._serve_until(lambda: not state.pending_reports, time.monotonic() + patience_s)
        for name in state.pending_reports if state.verdict is not None else ():
            self._lose(name, "it did not report at the end")
        doubts = self.events.doubted(state.doubts_about_counts)
        if state.stuck:
            raise RobotsLostError({MASTER: state.stuck + doubts})

    def checked(self, assignments: Mapping[str, Mapping[str, int]]) -> tuple[bool, float]:
        """Let every robot check its constraints against `assignments`. Not available in private runs.

        Returns:
            True if all constraints are satisfied, and the sum of their costs.

        Raises:
            RobotsLostError: if robots are lost, or do not finish the check in time.
        """
        state = self.state
        for name in self.members.order:
            self._send(name, CheckRequest(state.epoch, self.members.neighbourhood(name, assignments)))
        away_s = REPORTS_S + self._settings.patience_s + self._settings.lease_ms / 1000
        self._serve_until(lambda: not state.unchecked, time.monotonic() + away_s)
        if state.unchecked or state.lost:
            raise RobotsLostError(state.lost or {MASTER: "robots have not checked their constraints in time"})
        return state.held, state.cost

    def leave(self, why: str, *, failed: bool = False, elsewhere: bool = False, farewell_s: float = FAREWELL_S) -> None:
        """Announce the end of the run until all robots confirm it, even those that have just joined or returned.

        `elsewhere`: another master may complete the run, if robots know one.
        """
        leave, until = Leave(why, failed, elsewhere and self.votes.is_needed), time.monotonic() + farewell_s
        if elsewhere:
            self._standbys.resign()
        else:
            self._standbys.end(why, failed=failed)
        self._has_ended = True
        staying = partial(self.members.staying, FAREWELL_S, besides=self.state.lost)
        with suppress(RobotsLostError, UnsupportedError):
            # A run may end before the next check of the directory.
            self._notify_subscribers()
            self._send_all(leave)
            while (staying() or self._standbys.waiting) and not is_past(until):
                self._serve_until(lambda: not (staying() or self._standbys.waiting), time.monotonic() + AGAIN_S)
                self._send_all(leave)
            self._serve_until(lambda: not self._journal_server.lagging, time.monotonic() + FAREWELL_S)

    def lose(self, name: str, why: str) -> None:
        """Record that the process of the robot `name` has ended. May be called from any thread."""
        self._dead[name] = why
        self._connection.wake()

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

    # Control messages

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
            case DomainAnswer(variables):
                self._note_failure(name, self.members.show(name, variables))
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
