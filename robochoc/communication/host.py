"""The host connects a protocol, which is pure, to a runtime, which transports envelopes.

The host decodes and encodes messages, stamps envelopes with the clock of non-concurrent constraint checks (NCCC;
Meisels et al. 2002: c = max(c, c of the message), plus one for each check; each message has a timestamp, the value of c
when the message was written), counts messages and checks, and reports events to an observer. Every runtime uses the
host, so the same run has the same counts in every runtime.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from functools import cache
from typing import Any, Self, cast, get_args

import msgspec

from robochoc.communication.message_dropper import MessageDropper
from robochoc.journal.events import Bounded, Concluded, Decided, Heard, Observer, Received, Sent, Settled
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.chance import Chance
from robochoc.protocols.dynamic import DynamicProtocol
from robochoc.protocols.key_stream import KeyStream
from robochoc.protocols.message import Envelope, Message, encode
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import equip
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.errors import RobochocError

_MOST_SHARED = 1 << 22
"""The maximum size of a message cache, in bytes."""
_SIZE_OF_A_MESSAGE = 256
"""The approximate size of a message without its content, in bytes."""


_UNUSABLE = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)
"""Errors raised by a protocol that cannot use a message: explicit refusals and failed computations."""


class BadMessageError(RobochocError, ValueError):
    """Raised if the content of an envelope is not a message of the protocol, or the robot cannot use the message."""


class MessageCache:
    """The most recent messages in this process that receivers may share (`Message.shareable`), by content.

    Messages that are no longer in the cache are decoded again. The result is the same.
    """

    def __init__(self) -> None:
        self._messages: dict[bytes, Message] = {}
        self._contents: dict[int, bytes] = {}
        """The content of each message in the cache, by the message's `id`."""
        self._size = 0

    def get(self, content: bytes) -> Message | None:
        """Return the message with this content, or None if it is not in the cache."""
        return self._messages.get(content)

    def content(self, message: Message) -> bytes:
        """Return the content of `message`, and add it to the cache: a robot may send the message that it received."""
        content = self._contents.get(id(message))
        if content is None:
            content = encode(message)
            self._keep(content, message)
        return content

    def _keep(self, content: bytes, message: Message) -> None:
        """Add `message`, and remove the oldest messages while the cache is too large."""
        messages = self._messages
        if content in messages:
            return
        messages[content] = message
        self._contents[id(message)] = content
        self._size += len(content) + _SIZE_OF_A_MESSAGE
        while self._size > _MOST_SHARED and len(messages) > 1:
            oldest = next(iter(messages))
            del self._contents[id(messages.pop(oldest))]
            self._size -= len(oldest) + _SIZE_OF_A_MESSAGE


@mypyc_attr(allow_interpreted_subclasses=True)
class Host:
    """Drives the protocol object of one robot."""

    @classmethod
    def create(cls, protocol: type[Protocol], part: AgentProblem, order: PriorityOrder | None = None) -> Self:
        """Return a host for the robot with the problem `part`.

        `order`: the priority order in `part`, if the robots in one process share one object. Raises `UnsupportedError`
        (see `LocalProblem`).
        """
        return cls(protocol(LocalProblem(part), order or order_of(part)), part.parameters)

    def __init__(self, protocol: Protocol, parameters: RunParameters = DEFAULT_PARAMETERS) -> None:
        self.protocol = protocol
        self.name = protocol.problem.agent
        self._equip(parameters)
        self.dropper = self._dropper(parameters)
        """Decides which messages to this robot are lost, and counts these messages; None if no messages are lost."""
        self.clock = 0
        self.sent: dict[str, int] = {}
        self.bytes = self.largest = 0
        self.checks_at_send: list[int] = []
        """The value of `checks` for each message in the last step, when the message was written."""
        self._stamps: list[int] = []
        self._answers = self._step_began = 0
        self._begun = False
        self.message_cache: MessageCache | None = None
        """The messages shared by the robots in a simulation; None: each robot decodes its own messages."""
        self._decode: Callable[[bytes], Message] = message_decoder(protocol.messages).decode
        self.counted = 0
        """The number of constraint checks included in the clock: all checks, except during a step."""
        self._reported: tuple[int | None, Verdict | None] = (None, None)
        self._heard: float = math.inf
        self._bounded: int | float = 0
        self._bounds = False
        self._observer: Observer | None = None
        self._now: Callable[[], float] = lambda: 0.0
        self._then: Callable[[int], float] | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a copy that continues independently of this host, and reports to no observer."""
        twin = copy(self)
        twin.protocol, twin.dropper = deepcopy(self.protocol, memo), deepcopy(self.dropper, memo)
        twin.sent, twin._stamps = dict(self.sent), [*self._stamps]  # noqa: SLF001 - of the same class
        twin.checks_at_send = twin.protocol.checks_at_send
        twin._observer = None  # noqa: SLF001
        return twin

    def observe(
        self,
        observer: Observer,
        now: Callable[[], float],
        then: Callable[[int], float] | None = None,
        *,
        bounds: bool = False,
    ) -> None:
        """Report each event to `observer` from now on, with the timestamp `now()`.

        If time is counted in checks, `then(n)` returns the time at which the robot had done n checks. It is used as the
        time of received and sent messages. `bounds`: report lower bounds, too.
        """
        self._bounds = bounds
        self._observer = observer
        self._now = now
        self._then = then

    @property
    def checks(self) -> int:
        """The number of constraint checks so far."""
        return self.protocol.problem.checks

    @property
    def resumes(self) -> bool:
        """True if `start` resumes a search, with knowledge from earlier epochs."""
        return self._begun and isinstance(self.protocol, DynamicProtocol)

    def start(self, *, lossless: bool = True) -> list[Envelope]:
        """Start the search, or resume it after a change, and return the robot's first messages.

        `lossless`: no message of the previous epoch was lost.
        """
        protocol = self.protocol
        if self._begun and isinstance(protocol, DynamicProtocol):
            protocol.resume(lossless=lossless)
        else:
            self._begun = True
            protocol.start()
        return self._said()

    def change(self, part: AgentProblem, invalidated: Invalidated, order: PriorityOrder | None = None) -> None:
        """Start a new epoch with the changed problem `part`, and reset all counts.

        A running dynamic protocol continues with its knowledge; any other protocol is restarted. For `order` see
        `create`. Raises `UnsupportedError`.
        """
        problem, order = LocalProblem(part), order or order_of(part)
        if self._begun and isinstance(self.protocol, DynamicProtocol):
            problem.allow_undeclared()  # until the other robots know that a value was removed
            self.protocol.change(problem, order, invalidated)
            self._forget_said()
        else:
            self.protocol = type(self.protocol)(problem, order)
            self._equip(part.parameters)
            self._begun = False
        self.dropper = self._dropper(part.parameters)
        self.clock = self.bytes = self.largest = self.counted = self._step_began = 0
        self.sent = {}
        self._reported = (None, None)
        self._heard = math.inf
        self._bounded = 0

    def handle(self, packet: Sequence[Envelope]) -> list[Envelope]:
        """Pass all waiting messages to the protocol, let it process them, and return its outgoing messages.

        Raises `BadMessageError` if the protocol cannot decode or use the content of an envelope.
        """
        for envelope in packet:
            self.receive(envelope)
        return self.settle()

    def receive(self, envelope: Envelope) -> None:
        """Receive one message of a packet, which may contain more messages. Raises `BadMessageError`.

        Immediate answers are not stamped with the clocks of the messages that follow in the packet.
        """
        try:
            message = None if self.message_cache is None else self.message_cache.get(envelope.content)
            if message is None:
                message = self._decode(envelope.content)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            raise BadMessageError(f"{envelope.sender} sent {self.name} an invalid message: {error}") from error
        if envelope.clock > self.clock:  # noqa: PLR1730 - faster
            self.clock = envelope.clock
        try:
            self.protocol.receive(envelope.sender, message)
        except _UNUSABLE as error:
            raise _refusal(f"{envelope.sender} sent {self.name} a message ({type(message).__name__})", error) from None
        self._tick()
        if self._observer:
            kind = type(message).__name__
            self._observer(
                Received(
                    t=self._time(self._step_began),
                    sender=envelope.sender,
                    receiver=self.name,
                    type=kind,
                    clock=self.clock,
                )
            )

    def catch_up(self, clock: int) -> None:
        """Advance the clock to `clock`, and shift the stamps of the answers to the last message by the same amount."""
        late = clock - self.clock
        self.clock = clock
        for place in range(self._answers, len(self._stamps)):
            self._stamps[place] += late

    def settle(self) -> list[Envelope]:
        """Let the protocol settle after a whole packet, and return its messages. Raises `BadMessageError`."""
        try:
            self.protocol.settle()
        except _UNUSABLE as error:
            raise _refusal(f"{self.name} has received messages", error) from None
        return self._said()

    def handle_lossy(
        self, packet: Sequence[Envelope], missing: Callable[[Envelope], int | None], *, lost: bool
    ) -> list[Envelope] | None:
        """Handle a packet like `handle`, in a search that may lose messages, and return the robot's messages.

        Only a protocol that tolerates loss is notified of missing messages. Any other protocol may raise any error
        after a message is lost, and cannot continue then.

        Args:
            packet: The messages that have arrived.
            missing: Returns the number of messages from the same sender that were lost right before a message; None if
                the message itself is lost.
            lost: True if a message in this search is or may be lost, to this robot or to others.

        Returns:
            The robot's messages, or None if the protocol cannot continue.

        Raises:
            BadMessageError: as in `handle`, if no loss explains the error.
        """
        bears = self.protocol.traits.bears_loss
        try:
            for envelope in packet:
                many = missing(envelope)
                if many is None:
                    continue
                for _ in range(many if bears else 0):
                    self.protocol.miss(envelope.sender)
                self.receive(envelope)
            return self.settle()
        except Exception:
            if bears or not lost:
                raise
            return None

    def go_on(self) -> list[Envelope] | None:
        """Let the protocol continue without the missing messages. Return its messages, or None if it cannot."""
        return self._said() if self.protocol.go_on() else None

    def metrics(self) -> Metrics:
        """Return this robot's counts so far. `ncccs` is the value of this robot's clock."""
        lost = 0 if self.dropper is None else self.dropper.count
        return Metrics(dict(self.sent), self.bytes, self.clock, self.checks, largest=self.largest, lost_messages=lost)

    def _dropper(self, parameters: RunParameters) -> MessageDropper | None:
        loss = parameters.message_loss
        return MessageDropper(loss, parameters.seed, self.name) if loss else None

    def _equip(self, parameters: RunParameters) -> None:
        """Pass the settings and a random generator to the protocol."""
        protocol = self.protocol
        equip(protocol, parameters.settings)
        protocol.chance = Chance(parameters.seed, self.name)
        protocol.secret = KeyStream(parameters.seed, self.name)

    def _said(self) -> list[Envelope]:
        """Count the checks in a finished step, and return the protocol's messages in envelopes."""
        self._tick()
        protocol = self.protocol
        self.checks_at_send = protocol.checks_at_send
        envelopes = self._envelopes() if self.checks_at_send else []
        self._step_began = self.counted
        if self._observer:
            self._report_state(self._observer)
            self._observer(Settled(t=self._now(), robot=self.name, clock=self.clock, checks=self.counted))
        return envelopes

    def _envelopes(self) -> list[Envelope]:
        """Encode and count all messages in the outbox. A message sent to several robots in a row is encoded once."""
        found = []
        last: Message | None = None
        content, kind, size = b"", "", 0
        fields: dict[str, object] = {}
        cache, observer, name, sent = self.message_cache, self._observer, self.name, self.sent
        for (receiver, message), clock, checks in zip(
            self.protocol.outbox, self._stamps, self.checks_at_send, strict=True
        ):
            if message is not last:
                last, kind = message, type(message).__name__
                content = cache.content(message) if cache is not None and message.shareable else encode(message)
                size = len(content)
                if size > self.largest:  # noqa: PLR1730 - faster
                    self.largest = size
                if observer:
                    fields = msgspec.structs.asdict(message)
            sent[kind] = sent.get(kind, 0) + 1
            self.bytes += size
            found.append(Envelope(name, receiver, content, clock))
            if observer:
                observer(
                    Sent(
                        t=self._time(checks),
                        sender=name,
                        receiver=receiver,
                        type=kind,
                        content=fields,
                        bytes=size,
                        clock=clock,
                    )
                )
        self._forget_said()
        return found

    def _tick(self) -> None:
        """Advance the clock by one for each new check, and stamp the messages written since the last call."""
        protocol = self.protocol
        stamps, checks_at_send = self._stamps, protocol.checks_at_send
        checks = protocol.problem.checks
        self._answers = answered = len(stamps)
        if len(checks_at_send) > answered:
            before = self.clock - self.counted
            stamps += [before + done for done in checks_at_send[answered:]]
        if checks != self.counted:
            self.clock += checks - self.counted
            self.counted = checks

    def _time(self, checks: int) -> float:
        """Return the time at which the robot had done this number of checks."""
        return self._now() if self._then is None else self._then(checks)

    def _forget_said(self) -> None:
        self.protocol.outbox.clear()
        self.protocol.checks_at_send = []
        self._stamps.clear()

    def _report_state(self, observer: Observer) -> None:
        """Report a value, a verdict or a best assignment that is new since the last report."""
        best: Any = self.protocol.incumbent  # with the type `Incumbent`, mypyc would convert its cost to a float
        if best is not None and best.cost < self._heard:
            self._heard = best.cost
            observer(Heard(t=self._now(), robot=self.name, cost=best.cost, values=best.values))
        if self._bounds:
            self._report_bound(observer)
        state = self.protocol.value, self.protocol.verdict
        value, verdict = self._reported
        self._reported = state
        if state[0] != value:
            assignment = self.protocol.assignment
            observer(Decided(t=self._now(), robot=self.name, assignment=assignment, clock=self.clock))
        if state[1] is not None and state[1] is not verdict:
            observer(Concluded(t=self._now(), robot=self.name, verdict=str(state[1])))

    def _report_bound(self, observer: Observer) -> None:
        """Report a lower bound that is higher than all previous ones."""
        bound: Any = self.protocol.findings.bound
        if bound is not None and self._bounded < bound < math.inf:
            self._bounded = bound
            observer(Bounded(t=self._now(), robot=self.name, bound=bound))


def _refusal(what: str, error: Exception) -> BadMessageError:
    """Return the error for an unusable message, described by `what`, with the traceback of the protocol's `error`.

    Protocols check a message where they use it, so that no check is made twice. A bug in the protocol causes the same
    error as an unusable message; the traceback shows the difference.
    """
    text = f"{what} that cannot be used: {type(error).__name__}: {error}"
    return BadMessageError(text).with_traceback(error.__traceback__)


def may_be_shared(messages: object) -> bool:
    """Return whether receivers may share any of the messages of a protocol."""
    return any(kind.shareable for kind in get_args(messages) or (messages,))


@cache
def message_decoder(messages: object) -> msgspec.msgpack.Decoder[Message]:
    """Return the decoder for a protocol's `messages`. Decoders are cached because their construction is slow."""
    return msgspec.msgpack.Decoder(cast("type[Message]", messages))


def order_of(part: AgentProblem) -> PriorityOrder:
    """Return the priority order of the team's robots, with its pseudo-tree if the robots know it."""
    known = part.known
    return PriorityOrder(known.order, known.links, known.rank)
