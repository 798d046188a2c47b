"""A robot in a run across machines: it registers with the master, and searches when that orders the start.

It knows its own file; what else it has to know (names, order, interfaces) is in the master's `Task`. The search itself
is in `searcher.py`; this is the loop around it. All frames that wait when it looks into its inbox are one packet. It
ends when the master says so, and by itself once the master is gone for longer than its patience.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from queue import Empty
from typing import NamedTuple

from robochoc.authority.identity import Identity
from robochoc.authority.keyring import UnknownPeerError
from robochoc.communication.control import Failed, GoOn, Pause, TakeSnapshot, Wave
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
    Joined,
    JournalAnswer,
    Leave,
    LostFrames,
    Objection,
    ProtocolMessage,
    Recall,
    Register,
    RegistrationDenied,
    Revoked,
    StartSearch,
    Task,
    ToMaster,
    ToPeer,
    Welcome,
)
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Opened
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item, PresenceChanged, WakeUp
from robochoc.communication.network.profile import among, profile_of, ranges_of
from robochoc.communication.network.quotas import Backlog
from robochoc.communication.network.refusals import Refusals
from robochoc.communication.network.registration import Registration, RunOverError
from robochoc.communication.network.robot_settings import DEFAULT_SETTINGS, RobotSettings
from robochoc.communication.network.searcher import RobotContext, Searcher
from robochoc.communication.network.secure_channel import SecureChannel
from robochoc.communication.network.transport import Transport
from robochoc.communication.robot_loop import IDLE_S
from robochoc.model.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.encoding import TooLargeError, UnsupportedError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

CHECK_S = 0.25
"""The interval at which a robot that waits checks the link, in seconds."""
AT_ONCE = 10_000
"""The largest number of frames in one packet."""
_UNUSABLE = (FrameRefusedError, NotGenuineError, UnknownPeerError, BadMessageError)


class Ending(NamedTuple):
    """The end of the run for this robot.

    Attributes:
        why: The reason that the master gave, or why the robot ended by itself.
        failed: The run could not be completed.
        assignment: The values that the robot has decided on.
    """

    why: str
    failed: bool
    assignment: dict[str, int]


class NetworkRobot:
    """The robot `own` at its `transport`.

    Args:
        own: The robot, compiled.
        identity: Its certificate and key.
        transport: Its connection to the router.
        protocol_named: Finds the protocol that the master asks for; raises `LookupError`.
        settings: How its owner wants it to take part.
    """

    def __init__(
        self,
        own: CompiledRobot,
        identity: Identity,
        transport: Transport,
        protocol_named: Callable[[str], type[Protocol]],
        settings: RobotSettings = DEFAULT_SETTINGS,
    ) -> None:
        self._own = own
        self._robot = own.robot
        self._transport = transport
        self._protocol_named = protocol_named
        self._settings = settings
        self._channel = SecureChannel(own.robot.name, identity)
        self._registration = Registration(own.robot.name, transport, settings.patience_s, self._register)
        self._searcher: Searcher | None = None
        self._ahead: list[tuple[str, Opened]] = []
        """Frames of an epoch that the master has not announced to this robot yet."""
        self._kept = Backlog()
        self._lost_frames: set[tuple[int, str]] = set()
        """Epochs and senders whose frame losses were reported. Each pair is reported once."""
        self._refusals = Refusals(lambda who, what, why: self._send_to_master(Objection(who, what, why)))

    def run(self) -> Ending:
        """Register, and take part until the end."""
        try:
            self._registration.send()
            while True:
                self._turn(self._items())
        except RunOverError as over:
            return Ending(
                on_one_line(over.why, LONGEST_REASON), over.failed, self._searcher.assignment if self._searcher else {}
            )
        except UnsupportedError as refusal:
            why = on_one_line(str(refusal), LONGEST_REASON)
            self._fail(Failed(why, unsupported=True, elsewhere=isinstance(refusal, TooLargeError)))
            return Ending(why, failed=True, assignment={})
        except Exception as error:  # noqa: BLE001 - whatever it was, the master has to know
            where = traceback.extract_tb(error.__traceback__)[-1]
            why = on_one_line(f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})", LONGEST_REASON)
            self._fail(Failed(why))
            return Ending(why, failed=True, assignment={})

    # The loop

    def _items(self) -> list[Item]:
        """Return all frames that have arrived. Empty if none has arrived for a while."""
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
                    raise UnsupportedError(f"{frames:,} frames of the master to {self._robot.name} were lost for good")
                case FramesLost(sender, frames) if self._registration.welcome:
                    self._report_lost_frames(sender, frames)
                case FramesLost() | PresenceChanged() | WakeUp():
                    pass
        if self._searcher:
            self._searcher.receive(packet)
        if items:
            return
        if self._searcher and self._searcher.is_restless:
            self._searcher.report_idle()
        else:
            self._registration.check_link()

    def _report_lost_frames(self, sender: str, frames: int) -> None:
        """Tell the master, once for each search: it finds out whether the run can do without these frames."""
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
        """Handle what belongs to this epoch. What belongs to the next one waits, for its key cards have not come yet.

        A frame is taken only if it can be used, so that an unusable one does not take the place of another.

        Raises:
            BadMessageError: when it holds no message of the protocol, or one that nobody may send now.
            FrameRefusedError: when it is of an epoch that is far away, or is more than is kept for the next one.
            NotGenuineError: when the filters find that it was changed.
            UnknownPeerError: when the sender's key card is not known.
        """
        message, epoch = opened.message, self._searcher.epoch if self._searcher else 0
        if not isinstance(message, ToPeer):
            self._channel.accept(sender, opened.number)
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
        """Keep a frame for the next epoch. Raises `FrameRefusedError`."""
        if message.epoch > epoch + 1:
            raise FrameRefusedError(f"it is of epoch {message.epoch}, and this is {epoch}")
        if not self._kept.accept(sender, len(message.content)):
            raise FrameRefusedError(f"it is more than is kept of {sender} for epoch {message.epoch}")
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
        """Tell the master of a frame that was refused."""
        if self._registration.welcome is not None:
            self._refusals.note(sender, f"a frame to {self._robot.name}", why)

    # The master's orders

    def _obey(self, order: ControlMessage) -> None:
        match order:
            case Welcome():
                self._enter(order)
            case RegistrationDenied(incarnation, why) if incarnation == self._registration.incarnation:
                raise RunOverError(f"the master does not take {self._robot.name}: {why}", failed=True)
            case DomainRequest(variables):
                domains = {variable.name: variable.domain for variable in self._robot.variables}
                self._send_to_master(
                    DomainAnswer({name: ranges_of(domains[name]) for name in variables if name in domains})
                )
            case Revoked(name):
                self._channel.revoke(name)
            case Leave(why, failed):
                self._send_to_master(Bye())
                raise RunOverError(why, failed=failed)
            case RegistrationDenied() | DirectoryAnswer() | JournalAnswer():
                pass
            case _:
                self._obey_in_search(order)

    def _obey_in_search(self, order: ControlMessage) -> None:
        searcher = self._searcher
        match order:
            case Task():
                self._take_task(order)
            case StartSearch(epoch) if searcher and epoch == searcher.epoch:
                self._settings.stage("searching")
                searcher.start(time.monotonic())
            case Wave(number) if searcher:
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
        """Obey an order that is about what the robots have: at a moment of the search, or at its end."""
        match order:
            case TakeSnapshot(number):
                searcher.report_snapshot(number)
            case Recall(epoch) if epoch == searcher.epoch:
                searcher.recall(order)
            case CheckRequest(epoch, values, snapshot) if epoch == searcher.epoch:
                self._send_to_master(searcher.check_constraints(values, snapshot))
            case Adopt(epoch, number, why) if epoch == searcher.epoch:
                searcher.adopt(number, published=bool(why))
                if why:
                    self._settings.decided(on_one_line(why, LONGEST_REASON), searcher.assignment)
            case _:
                self._refuse_order(order)

    def _refuse_order(self, order: ControlMessage) -> None:
        self._object(MASTER, f"{type(order).__name__} is nothing to be told now")

    def _register(self, incarnation: str) -> None:
        self._send_to_master(Register(profile_of(self._robot), incarnation))

    def _enter(self, welcome: Welcome) -> None:
        """Enter the run. A second welcome comes after an outage, and one of another run from another master."""
        if welcome.incarnation != self._registration.incarnation:
            return
        if self._registration.accept(welcome):
            self._channel.start_run(welcome.run, welcome.filters)
            self._settings.stage("registered, waiting for the others")
        self._send_to_master(Joined(welcome.incarnation, self._channel.card))

    def _take_task(self, task: Task) -> None:
        """Enter a new epoch."""
        welcome = self._registration.welcome
        if welcome is None:
            return
        for fault in self._channel.admit(task.cards):
            self._object(MASTER, fault)
        try:
            protocol = self._protocol_named(task.protocol)
        except LookupError as unknown:
            raise UnsupportedError(f"{self._robot.name}: {unknown}") from None
        observed = (welcome.observed and not welcome.private) or self._settings.sniffed  # events have values in them
        context = RobotContext(self._send_to_master, self._send, self._settings.set_rank, observed, welcome.private)
        own = self._own.relinked(among(self._robot, task.interfaces), self._settings.compiled)
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

    def _fail(self, message: Failed) -> None:
        """Tell the master why this robot cannot continue, and wait a while for its leave."""
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
