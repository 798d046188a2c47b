"""A robot in a run across machines: it registers with the master, and searches when the master orders the start.

The robot knows only its own file. The names, the order and the interfaces of the team come from the master, in
`SearchTask`. This module contains the loop around the search; the search is in `searcher.py`. All frames waiting in the
inbox form one packet. The robot ends when the master orders it, or if the master is absent for longer than its
patience.
"""

from __future__ import annotations

import math
import secrets
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from queue import Empty
from typing import NamedTuple

from robochoc.authority.identity import Identity
from robochoc.authority.keyring import UnknownPeerError
from robochoc.communication.control import CounterWave, GoOn, Pause, RobotFailed, TakeSnapshot
from robochoc.communication.filters import NotGenuineError
from robochoc.communication.host import BadMessageError
from robochoc.communication.network.control_messages import (
    Adopt,
    Bye,
    CheckRequest,
    ControlMessage,
    Copies,
    DirectoryAnswer,
    DomainAnswer,
    DomainRequest,
    Heartbeat,
    Joined,
    JournalAnswer,
    Lead,
    Leave,
    LostFrames,
    Objection,
    Propose,
    ProtocolMessage,
    Recall,
    Register,
    RegistrationDenied,
    Revoked,
    SearchTask,
    StandbyAnswer,
    StartSearch,
    ToMaster,
    ToPeer,
    Welcome,
)
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Opened
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item, PresenceChanged, WakeUp
from robochoc.communication.network.masters import Masters
from robochoc.communication.network.profile import profile_of, ranges_of, restrict_to_team
from robochoc.communication.network.quotas import Backlog
from robochoc.communication.network.refusals import Refusals
from robochoc.communication.network.robot_settings import DEFAULT_SETTINGS, RobotSettings
from robochoc.communication.network.robot_votes import RobotVotes, VotesError
from robochoc.communication.network.searcher import RobotContext, Searcher
from robochoc.communication.network.secure_channel import SecureChannel
from robochoc.communication.network.transport import Transport
from robochoc.communication.robot_loop import IDLE_S
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

REGISTER_AGAIN_S = 1.0
_INCARNATION_BYTES = 8


class RunOverError(RobochocError):
    """Raised when the run is over for this robot.

    `failed`: the run was not completed. `elsewhere`: another master may complete it.
    """

    def __init__(self, why: str, *, failed: bool, elsewhere: bool = False) -> None:
        super().__init__(why)
        self.why = why
        self.failed = failed
        self.elsewhere = elsewhere


class Registration:
    """The registration of the robot `name`. It is repeated until the master answers, and after each outage.

    Attributes:
        incarnation: The name of this process of the robot. A restarted robot has another one.
        welcome: The master's answer, or None before the answer arrives.

    Args:
        name: The robot's name.
        transport: The robot's connection to the router.
        patience_s: Seconds for which the master may be absent or silent.
        register: Sends a registration for an incarnation.
    """

    def __init__(self, name: str, transport: Transport, patience_s: float, register: Callable[[str], None]) -> None:
        self.incarnation = secrets.token_hex(_INCARNATION_BYTES)
        self.welcome: Welcome | None = None
        self._name = name
        self._transport = transport
        self._patience_s = patience_s
        self._register = register
        self._registered_at = 0.0
        self._unanswered_since: float | None = None
        self._connected_at = time.monotonic()
        self._router = transport.router

    def send(self) -> None:
        """Register with the master, for the first time or again."""
        self._registered_at = time.monotonic()
        if self._unanswered_since is None:
            self._unanswered_since = self._registered_at
        self._register(self.incarnation)

    def accept(self, welcome: Welcome) -> bool:
        """Record the master's answer. Return whether it is the first answer.

        Raises `RunOverError` if the answer comes from another run.
        """
        self._unanswered_since = None
        if self.welcome is None:
            self.welcome = welcome
            return True
        if welcome.run != self.welcome.run:
            why = "the master was restarted: restart this robot as well"
            raise RunOverError(why, failed=True, elsewhere=True)
        return False

    def check_link(self) -> None:
        """Register again if necessary: after a restart of the router, and while no answer arrives.

        Raises `RunOverError` if the master is absent or silent for longer than the patience.
        """
        now = time.monotonic()
        router = self._transport.router
        if router:
            self._connected_at = now
            if router != self._router:
                self._router = router
                self.send()
        elif now - self._connected_at > self._patience_s:
            raise RunOverError(f"the master is gone: no link to it for {self._patience_s:g} s", failed=True)
        if self._unanswered_since is None:
            return
        if now - self._unanswered_since > max(self._patience_s, 2 * REGISTER_AGAIN_S):
            why = f"the master does not answer {self._name}: check that it is enrolled there, and not revoked"
            raise RunOverError(why, failed=True)
        if now - self._registered_at >= REGISTER_AGAIN_S:
            self.send()


CHECK_S = 0.25
"""The interval at which a waiting robot checks the link, in seconds."""
AT_ONCE = 10_000
"""The largest number of frames in one packet."""
_UNUSABLE = (FrameRefusedError, NotGenuineError, UnknownPeerError, BadMessageError)


class Ending(NamedTuple):
    """The end of the run, as seen by this robot.

    Attributes:
        why: The reason sent by the master, or the reason why the robot ended by itself.
        failed: True if the run was not completed.
        assignment: The values that the robot has decided on.
        elsewhere: True if another master may complete the run.
    """

    why: str
    failed: bool
    assignment: dict[str, int]
    elsewhere: bool = False


class NetworkRobot:
    """The robot `own`, connected by `transport`.

    Args:
        own: The compiled robot.
        identity: The robot's certificate and key.
        transport: The robot's connection to the router.
        protocol_named: Finds the protocol that the master requests; raises `LookupError`.
        settings: The owner's settings of the robot.
        votes: The robot's votes for masters (None: they are stored in memory).
        masters: The masters that the robot knows (None: only the one that it is connected to).
    """

    def __init__(
        self,
        own: CompiledRobot,
        identity: Identity,
        transport: Transport,
        protocol_named: Callable[[str], type[Protocol]],
        settings: RobotSettings = DEFAULT_SETTINGS,
        votes: RobotVotes | None = None,
        masters: Masters | None = None,
    ) -> None:
        self._votes = votes or RobotVotes()
        self._masters = masters or Masters([""], settings.patience_s)
        self._own = own
        self._robot = own.robot
        self._transport = transport
        self._protocol_named = protocol_named
        self._settings = settings
        self._channel = SecureChannel(own.robot.name, identity)
        patience_s = math.inf if self._masters.several else settings.patience_s  # `Masters` has its own
        self._registration = Registration(own.robot.name, transport, patience_s, self._register)
        self._searcher: Searcher | None = None
        self._ahead: list[tuple[str, Opened]] = []
        """Frames for an epoch whose task this robot has not yet received."""
        self._kept = Backlog()
        self._lost_frames: set[tuple[int, str]] = set()
        """The epochs and senders of reported frame losses. Each pair is reported once."""
        self._refusals = Refusals(lambda who, what, why: self._send_to_master(Objection(who, what, why)))

    def run(self) -> Ending:
        """Register, and participate until the end."""
        self._masters.start()
        try:
            self._registration.send()
            while True:
                self._turn(self._items())
        except RunOverError as over:
            self._remember_values()
            why = on_one_line(over.why, LONGEST_REASON)
            values = None if over.failed else self._votes.decided(self._robot.name)
            elsewhere = over.elsewhere and self._masters.several
            return Ending(why, over.failed, self._decided if values is None else values, elsewhere)
        except VotesError as unusable:
            self._fail(RobotFailed(on_one_line(str(unusable), LONGEST_REASON)))
            return Ending(str(unusable), failed=True, assignment={})
        except UnsupportedError as refusal:
            why = on_one_line(str(refusal), LONGEST_REASON)
            self._fail(RobotFailed(why, unsupported=True, elsewhere=isinstance(refusal, TooLargeError)))
            return Ending(why, failed=True, assignment={})
        except Exception as error:  # noqa: BLE001 - the master has to know of any error
            where = traceback.extract_tb(error.__traceback__)[-1]
            why = on_one_line(f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})", LONGEST_REASON)
            self._fail(RobotFailed(why))
            return Ending(why, failed=True, assignment={})

    @property
    def _decided(self) -> dict[str, int]:
        return self._searcher.assignment if self._searcher else {}

    def _remember_values(self) -> None:
        """Store the robot's values for the next master."""
        if self._registration.welcome is not None:
            self._votes.remember(self._registration.welcome.run, self._decided)

    # The loop

    def _items(self) -> list[Item]:
        """Wait a short time for frames, and return all frames that have arrived."""
        restless = self._searcher is not None and self._searcher.is_restless
        items = []
        with suppress(Empty):
            items.append(self._transport.inbox.get(timeout=IDLE_S if restless else CHECK_S))
            while len(items) < AT_ONCE:
                items.append(self._transport.inbox.get_nowait())
        return items

    def _turn(self, items: list[Item]) -> None:
        packet: list[Envelope] = []
        for item in items:
            match item:
                case FrameArrived(sender, content):
                    self._read(sender, content, packet)
                case FramesLost(sender, frames) if sender == MASTER:
                    raise UnsupportedError(f"{frames:,} frames from the master to {self._robot.name} were lost")
                case FramesLost(sender, frames) if self._registration.welcome:
                    self._report_lost_frames(sender, frames)
                case FramesLost() | PresenceChanged() | WakeUp():
                    pass
        self._check_master()
        if self._searcher:
            self._searcher.receive(packet)
        if items:
            return
        if self._searcher and self._searcher.is_restless:
            self._searcher.report_idle()
        else:
            self._registration.check_link()

    def _check_master(self) -> None:
        """Look for another master if the present one is silent. Raises `RunOverError`."""
        if self._masters.other_listens():
            raise RunOverError("the master is silent, and another one listens", failed=True, elsewhere=True)
        if self._masters.is_over:
            raise RunOverError(self._masters.failure, failed=True)

    def _report_lost_frames(self, sender: str, frames: int) -> None:
        """Report lost frames to the master, once per search. The master decides whether the run can continue."""
        loss = (self._searcher.epoch if self._searcher else 0, sender)
        if loss not in self._lost_frames:
            self._lost_frames.add(loss)
            self._send_to_master(LostFrames(sender, frames))

    # Frames

    def _send_to_master(self, message: ToMaster) -> None:
        self._transport.send(MASTER, self._channel.frame(message))

    def _send(self, receiver: str, message: ToPeer) -> None:
        frame = self._channel.sealed_frame(receiver, message)
        if frame is not None:
            self._transport.send(receiver, frame)

    def _read(self, sender: str, content: bytes, packet: list[Envelope]) -> None:
        try:
            self._handle(sender, self._channel.read(sender, content), packet)
        except _UNUSABLE as refused:
            self._object(sender, str(refused))

    def _handle(self, sender: str, opened: Opened, packet: list[Envelope]) -> None:
        """Handle a frame for this epoch. A frame for the next epoch is stored until its key cards have arrived.

        A frame is accepted only if it can be used. Otherwise an unusable frame would use up the number of a valid one.

        Raises:
            BadMessageError: if the frame contains no protocol message, or a message that is not allowed now.
            FrameRefusedError: if its epoch is not the next one, or too many frames are stored for the next epoch.
            NotGenuineError: if the filters detect a change in the message.
            UnknownPeerError: if the sender's key card is not known.
        """
        message, epoch = opened.message, self._searcher.epoch if self._searcher else 0
        if not isinstance(message, ToPeer):
            self._channel.accept(sender, opened.number)
            if not isinstance(message, RegistrationDenied | Leave):
                self._masters.hear()
            self._obey(message)
        elif message.epoch > epoch:
            self._keep(sender, opened, message, epoch)
        else:
            message = self._channel.unsealed(sender, opened.number, message)
            if isinstance(message, ProtocolMessage) and self._searcher and message.epoch == epoch:
                self._searcher.check(message.content)
            self._channel.accept(sender, opened.number)
            self._handle_message(sender, message, packet)

    def _keep(self, sender: str, opened: Opened, message: ToPeer, epoch: int) -> None:
        """Store a frame for the next epoch. Raises `FrameRefusedError`."""
        if message.epoch > epoch + 1:
            raise FrameRefusedError(f"it is of epoch {message.epoch}, but the present epoch is {epoch}")
        if not self._kept.accept(sender, len(message.content)):
            raise FrameRefusedError(f"too many frames of {sender} are stored for epoch {message.epoch}")
        self._channel.accept(sender, opened.number)
        self._ahead.append((sender, opened))

    def _handle_message(self, sender: str, message: ToPeer, packet: list[Envelope]) -> None:
        searcher = self._searcher
        if searcher is None or message.epoch != searcher.epoch:
            return
        if isinstance(message, Copies):
            searcher.learn(sender, message.content)
            return
        envelope = Envelope(sender, self._robot.name, message.content, message.clock)
        if searcher.admit(envelope):
            packet.append(envelope)

    def _object(self, sender: str, why: str) -> None:
        """Report a refused frame to the master."""
        if self._registration.welcome is not None:
            self._refusals.note(sender, f"a frame to {self._robot.name}", why)

    # The master's orders

    def _obey(self, order: ControlMessage) -> None:
        match order:
            case Welcome():
                self._enter(order)
            case RegistrationDenied(incarnation, why) if incarnation == self._registration.incarnation:
                self._masters.note_refusal(why)
                raise RunOverError(f"the master does not admit {self._robot.name}: {why}", failed=True, elsewhere=True)
            case DomainRequest(variables):
                asked = {one.name: one.domain for one in self._robot.variables if one.name in variables}
                answer = DomainAnswer(
                    {name: ranges_of(asked[name]) for name in variables if name in asked},
                    tuple(name for name, domain in asked.items() if domain.symbols),
                    {name: domain.real.places for name, domain in asked.items() if domain.real},
                )
                self._send_to_master(answer)
            case Revoked(name):
                self._channel.revoke(name)
            case Leave(why, failed, elsewhere):
                self._send_to_master(Bye())
                self._masters.note_refusal(why)
                raise RunOverError(why, failed=failed, elsewhere=elsewhere)
            case Lead() if self._registration.welcome:
                self._remember_values()
                self._send_to_master(self._votes.promise(order, private=self._registration.welcome.private))
            case Propose():
                self._remember_values()
                self._send_to_master(self._votes.accept(order))
            case Heartbeat() | StandbyAnswer():
                pass
            case RegistrationDenied() | DirectoryAnswer() | JournalAnswer():
                pass
            case _:
                self._obey_in_search(order)

    def _obey_in_search(self, order: ControlMessage) -> None:
        searcher = self._searcher
        match order:
            case SearchTask():
                self._take_task(order)
            case StartSearch(epoch) if searcher and epoch == searcher.epoch:
                self._settings.stage("searching")
                searcher.start(time.monotonic())
            case CounterWave(number) if searcher:
                searcher.report_counters(number)
            case GoOn() if searcher:
                searcher.go_on()
            case Pause() if searcher:
                searcher.pause()
            case _ if searcher:
                self._obey_about_answers(order, searcher)
            case _:
                self._refuse_order(order)

    def _obey_about_answers(self, order: ControlMessage, searcher: Searcher) -> None:
        """Obey an order about the robot's values, at a snapshot or at the end of the search."""
        match order:
            case TakeSnapshot(number):
                searcher.report_snapshot(number)
            case Recall(epoch) if epoch == searcher.epoch:
                searcher.recall(order)
            case CheckRequest(epoch, values, snapshot) if epoch == searcher.epoch:
                self._send_to_master(searcher.check_constraints(values, snapshot))
            case Adopt(epoch, number, why) if epoch == searcher.epoch:
                searcher.adopt(number, published=bool(why))
                if why and not self._votes.several:  # else a majority must accept the decision first
                    self._settings.decided(on_one_line(why, LONGEST_REASON), searcher.assignment)
            case _:
                self._refuse_order(order)

    def _refuse_order(self, order: ControlMessage) -> None:
        self._object(MASTER, f"{type(order).__name__} is not expected now")

    def _register(self, incarnation: str) -> None:
        self._send_to_master(Register(profile_of(self._robot), incarnation, self._votes.standing))

    def _enter(self, welcome: Welcome) -> None:
        """Join the run. Welcomes are repeated after an outage; a restarted master sends a welcome to another run."""
        if welcome.incarnation != self._registration.incarnation:
            return
        if self._registration.accept(welcome):
            self._channel.start_run(welcome.run, welcome.filters)
            self._settings.stage("registered, waiting for the others")
        self._send_to_master(Joined(welcome.incarnation, self._channel.card))

    def _take_task(self, task: SearchTask) -> None:
        """Start a new epoch."""
        welcome = self._registration.welcome
        if welcome is None:
            return
        for fault in self._channel.admit(task.cards):
            self._object(MASTER, fault)
        try:
            protocol = self._protocol_named(task.protocol)
        except LookupError as unknown:
            raise UnsupportedError(f"{self._robot.name}: {unknown}") from None
        observed = (welcome.observed and not welcome.private) or self._settings.sniffed  # events contain values
        context = RobotContext(self._send_to_master, self._send, self._settings.set_rank, observed, welcome.private)
        own = self._own.relinked(restrict_to_team(self._robot, task.interfaces), self._settings.compiled)
        self._searcher = Searcher(own, task, protocol, context)
        self._searcher.prepare()
        ahead, self._ahead = self._ahead, []
        self._kept.clear()
        for sender, opened in ahead:
            try:
                self._handle(sender, opened, [])
            except _UNUSABLE as refused:
                self._object(sender, str(refused))

    # The end

    def _fail(self, message: RobotFailed) -> None:
        """Report to the master why this robot cannot continue, and wait a short time for a `Leave`."""
        if self._registration.welcome is None:
            return
        self._send_to_master(message)
        until = time.monotonic() + self._settings.patience_s
        while time.monotonic() < until and self._transport.router:
            for item in self._items():
                if isinstance(item, FrameArrived) and item.sender == MASTER and self._is_leave(item.content):
                    self._send_to_master(Bye())
                    return

    def _is_leave(self, content: bytes) -> bool:
        try:
            opened = self._channel.read(MASTER, content)
        except FrameRefusedError:
            return False
        self._channel.accept(MASTER, opened.number)
        return isinstance(opened.message, Leave)
