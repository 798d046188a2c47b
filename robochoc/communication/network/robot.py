"""A robot's end of a run across machines: it registers with the master, and searches when that orders the start.

It knows its own file; what else it has to know (names, order, interfaces) the master tells it in its `Task`. The loop
is that of `robot_process.py`, with letters instead of queues: all messages that wait when it looks up are one packet.
It ends when the master says so, and by itself once the master is gone for longer than its patience.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import replace
from queue import Empty
from typing import NamedTuple

from robochoc.authority.identity import Identity
from robochoc.authority.keyring import BadCard, KeyCard, KeyRing, UnknownPeer
from robochoc.communication.control import Conclusion, Counters, Events, Failed, Pause, Ready, Wave
from robochoc.communication.filters import FilterStack, NotGenuine, UnknownFilter, filter_named
from robochoc.communication.host import BadMessage, Host
from robochoc.communication.network.letters import MASTER, Letters, Opened, Refused, TooLarge
from robochoc.communication.network.post import Arrived, Item, Missed, Post, Presence, Woken
from robochoc.communication.network.profile import BadProfile, among, domain_of, profile_of, ranges_of
from robochoc.communication.network.shared import BadShared, SharedRecord, known_of, record_of
from robochoc.communication.network.words import (
    Account,
    Bye,
    Checked,
    Copies,
    Denied,
    Joined,
    Judge,
    Leave,
    Objection,
    Register,
    Revoked,
    Said,
    Search,
    Show,
    Shown,
    Task,
    Told,
    ToMaster,
    Welcome,
    Word,
)
from robochoc.communication.system import own_memory
from robochoc.message import Envelope
from robochoc.observers.events import AnyEvent
from robochoc.problem import INFINITE, Model, Robot
from robochoc.protocols.findings import NOTHING
from robochoc.protocols.protocol import Protocol
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.encoding import TooMuch, Unsupported
from robochoc.solver.explanation import held
from robochoc.solver.part import Brief, Part

IDLE_S = 0.002
"""A robot that has heard nothing for so long reports its counters. Only when to ask; never whether it is over."""
LOOK_UP_S = 0.25
"""How often a robot that waits looks whether the link is still there."""
REGISTER_AGAIN_S = 1.0
EVENTS_AT_ONCE = 500
_VISIT_BYTES = 8
_OBJECTIONS_AT_MOST = 100


class Ending(NamedTuple):
    """How the run ended for this robot: the master's words, whether it failed, and the own decision."""

    why: str
    failed: bool
    assignment: dict[str, int]


class _Over(Exception):  # noqa: N818 - not an error: the way out of the loop
    def __init__(self, why: str, *, failed: bool) -> None:
        super().__init__(why)
        self.why = why
        self.failed = failed


class NetworkRobot:
    """The robot `robot` at its `post`, with its compiled `domain` (None: it needs no
    solver for that).

    `protocol_named` finds the protocol that the master asks for; it raises `LookupError`. `patience_s` is how long the
    master may be gone. `place` is told the robot's place in the priority order before each search, and `stage` in a few
    words how far it is.
    """

    def __init__(
        self,
        robot: Robot,
        domain: CompiledDomain | None,
        identity: Identity,
        post: Post,
        protocol_named: Callable[[str], type[Protocol]],
        *,
        patience_s: float = 10.0,
        place: Callable[[int, int], None] = lambda _rank, _size: None,
        stage: Callable[[str], None] = lambda _stage: None,
    ) -> None:
        self._robot = robot
        self._domain = domain
        self._identity = identity
        self._post = post
        self._protocol_named = protocol_named
        self._patience_s = patience_s
        self._place = place
        self._stage = stage
        self._letters = Letters(robot.name)
        self._visit = secrets.token_hex(_VISIT_BYTES)
        self._ring: KeyRing | None = None
        self._filters: FilterStack | None = None
        self._welcome: Welcome | None = None
        self._registered = 0.0
        self._objections = 0
        self._connected = time.monotonic()
        self._away = False
        self._task: Task | None = None
        self._host: Host | None = None
        self._events: list[AnyEvent] = []
        self._began = 0.0
        self._early: dict[int, list[Envelope]] = {}
        self._copies: dict[int, dict[str, tuple[SharedRecord, ...]]] = {}
        self._enter_epoch(0)

    def _enter_epoch(self, epoch: int) -> None:
        self._epoch = epoch
        self._sent = self._received = 0
        self._told: tuple[int, int] | None = None
        self._searching = self._concluded = self._paused = False
        self._host = None
        self._early = {number: kept for number, kept in self._early.items() if number >= epoch}
        self._copies = {number: kept for number, kept in self._copies.items() if number >= epoch}

    def run(self) -> Ending:
        """Register, and take part until the end."""
        try:
            self._register()
            while True:
                self._turn(self._items())
        except _Over as over:
            return Ending(over.why, over.failed, self._assignment)
        except (Unsupported, TooLarge, BadMessage, UnknownPeer) as refusal:
            self._fail(str(refusal), unsupported=isinstance(refusal, Unsupported | TooLarge), refusal=refusal)
            return Ending(str(refusal), failed=True, assignment={})

    @property
    def _assignment(self) -> dict[str, int]:
        return self._host.protocol.assignment if self._host else {}

    # The loop

    def _items(self) -> list[Item]:
        """All that has come; none when nothing has for a while."""
        waiting = self._searching and self._told != (self._sent, self._received)
        items = []
        try:
            items.append(self._post.inbox.get(timeout=IDLE_S if waiting else LOOK_UP_S))
            while True:
                items.append(self._post.inbox.get_nowait())
        except Empty:
            return items

    def _turn(self, items: list[Item]) -> None:
        packet: list[Envelope] = []
        for item in items:
            match item:
                case Arrived(sender, content):
                    self._read(sender, content, packet)
                case Missed(letters):
                    raise Unsupported(f"{letters} letters to {self._robot.name} were lost for good")
                case Presence() | Woken():
                    pass
        self._take_in(packet)
        if len(self._events) > EVENTS_AT_ONCE:
            self._report_events()
        if not items:
            self._idle()

    def _idle(self) -> None:
        if self._searching and self._told != (self._sent, self._received):
            self._report_events()
            self._say_counters(0)
            return
        self._look_up()
        if self._welcome is None and time.monotonic() - self._registered >= REGISTER_AGAIN_S:
            self._register()

    def _look_up(self) -> None:
        """Whether the master can be reached; after an outage, whether it is the same one."""
        now = time.monotonic()
        if self._post.connected:
            self._connected = now
            if self._away:
                self._away = False
                self._register()
            return
        self._away = True
        if now - self._connected > self._patience_s:
            raise _Over(f"the master is gone: no link to it for {self._patience_s:g} s", failed=True)

    # Letters

    def _say(self, word: ToMaster) -> None:
        self._post.send(MASTER, self._letters.write(MASTER, word))

    def _read(self, sender: str, content: bytes, packet: list[Envelope]) -> None:
        try:
            opened = self._letters.read(sender, content)
            word = self._unsealed(sender, opened)
        except (Refused, NotGenuine, UnknownPeer) as refused:
            self._object(sender, str(refused))
            return
        self._letters.take(sender, opened.number)
        match word:
            case Said():
                self._hear(sender, word, packet)
            case Copies(epoch, constraints):
                self._copies.setdefault(epoch, {})[sender] = constraints
                self._begin_if_told()
            case _:
                self._obey(word)

    def _unsealed(self, sender: str, opened: Opened) -> Word:
        word = opened.word
        if not isinstance(word, Said) or self._filters is None:
            return word
        content = self._filters.open(sender, word.content, self._context(sender, self._robot.name, opened.number, word))
        return Said(word.epoch, word.clock, content)

    def _context(self, sender: str, receiver: str, number: int, word: Said) -> bytes:
        """What binds a sealed message to its place in the run."""
        return f"{self._letters.run} {sender} {receiver} {number} {word.epoch} {word.clock}".encode()

    def _object(self, sender: str, why: str) -> None:
        """Tell the master of a letter that was refused; not endlessly, as whoever sends them may not tire."""
        self._objections += 1
        if self._welcome is not None and self._objections <= _OBJECTIONS_AT_MOST:
            self._say(Objection(sender, f"a letter to {self._robot.name}", why))

    # Registration

    def _register(self) -> None:
        self._registered = time.monotonic()
        self._say(Register(profile_of(self._robot), self._visit))

    def _enter(self, welcome: Welcome) -> None:
        if welcome.visit != self._visit:
            return
        if self._welcome is not None:
            if welcome.run != self._welcome.run:
                raise _Over("the master was started anew; start this robot anew as well", failed=True)
            return
        self._welcome = welcome
        self._letters.begin(welcome.run)
        card = b""
        if welcome.filters:
            self._ring = KeyRing(self._identity, welcome.run)
            try:
                self._filters = FilterStack(self._ring, [filter_named(name) for name in welcome.filters])
            except UnknownFilter as unknown:
                raise _Over(f"the master asks for a filter: {unknown}", failed=True) from None
            card = self._ring.card.encode()
        self._say(Joined(card))
        self._stage("registered, waiting for the others")

    def _admit(self, cards: tuple[bytes, ...]) -> None:
        """Believe the key cards of the others, if the Authority has certified them."""
        if self._ring is None:
            return
        for content in cards:
            try:
                card = KeyCard.decode(content)
                if card.name != self._robot.name:
                    self._ring.admit(card, time.time())
            except BadCard as bad:
                self._object(MASTER, str(bad))

    # The master's orders

    def _obey(self, word: Word) -> None:
        match word:
            case Welcome():
                self._enter(word)
            case Denied(visit, why):
                if visit == self._visit:
                    raise _Over(f"the master does not take {self._robot.name}: {why}", failed=True)
            case Show(variables):
                domains = {variable.name: variable.domain for variable in self._robot.variables}
                self._say(Shown({name: ranges_of(domains[name]) for name in variables if name in domains}))
            case Task():
                self._take_task(word)
            case Search(epoch):
                if epoch == self._epoch and self._host:
                    self._search(self._host)
            case Wave(number):
                self._say_counters(number)
            case Pause():
                self._pause()
            case Judge(epoch, values):
                self._say(self._judged(epoch, {**values, **self._assignment}))
            case Revoked(name):
                if self._ring:
                    self._ring.dismiss(name)
            case Leave(why, failed):
                self._say(Bye())
                raise _Over(why, failed=failed)
            case Told():
                pass
            case _:
                self._object(MASTER, f"{type(word).__name__} is no word for a robot")

    def _take_task(self, task: Task) -> None:
        """A new epoch: tell others what they have to know; begin once all children have told."""
        self._enter_epoch(task.epoch)
        self._task = task
        self._admit(task.cards)
        self._team_member = among(self._robot, task.interfaces)
        if self._protocol(task).traits.everywhere:
            owners = {name: agent for agent, names in task.interfaces.items() for name in names}
            known = [one for one in held(self._team_member) if one.constraint.model is not Model.PKC]
            for parent in self._team_member.parents:
                theirs = [one for one in known if parent.name in {owners.get(v) for v in one.constraint.variables}]
                copies = Copies(self._epoch, tuple(map(record_of, theirs)))
                self._post.send(parent.name, self._letters.write(parent.name, copies))
        self._begin_if_told()

    def _protocol(self, task: Task) -> type[Protocol]:
        try:
            return self._protocol_named(task.protocol)
        except LookupError as unknown:
            raise Unsupported(f"{self._robot.name}: {unknown}") from None

    def _begin_if_told(self) -> None:
        """Get ready, when all that has to be known is known."""
        task = self._task
        if task is None or self._host is not None:
            return
        protocol = self._protocol(task)
        robot = self._team_member
        told = self._copies.get(task.epoch, {})
        if protocol.traits.everywhere and any(child.name not in told for child in robot.children):
            return
        try:
            copies = tuple(known_of(record) for records in told.values() for record in records)
            domains = {name: domain_of(name, ranges) for name, ranges in task.domains.items()}
        except (BadShared, BadProfile) as bad:
            raise Unsupported(f"{robot.name} was told what cannot be: {bad}") from None
        self._host = Host.of(
            protocol,
            Part(
                robot,
                task.order,
                task.interfaces,
                self._domain,
                copies,
                domains,
                task.links,
                task.secretive,
                Brief(task.seed, task.settings, task.aside),
            ),
        )
        if self._welcome and self._welcome.observed:
            self._host.observe(self._events.append, self._now)
        self._place(task.order.index(robot.name), len(task.order))
        self._conclude(self._host)
        self._say(Ready(self._epoch))

    def _search(self, host: Host) -> None:
        self._began = time.monotonic()
        self._searching = True
        self._told = (-1, -1)
        self._stage("searching")
        self._send(host.start())
        self._take_in(self._early.pop(self._epoch, []))

    def _pause(self) -> None:
        """Be silent, and report: what still arrives is lost."""
        self._searching, self._paused = False, True
        self._report_events()
        host = self._host
        if host is None or self._welcome is None:
            return
        private = self._welcome.private
        metrics = replace(host.metrics(), memory=own_memory())
        assignment, findings = host.protocol.assignment, host.protocol.findings
        self._say(
            Account(
                self._epoch,
                host.protocol.value is not None,
                {} if private else assignment,
                metrics,
                NOTHING if private else findings,
            )
        )

    def _judged(self, epoch: int, values: dict[str, int]) -> Checked:
        """Hold all own constraints against what everybody has decided; of robots that stepped aside nothing is asked.

        The code is that of the problem itself, not that of the compiled constraints that the protocol works with.
        """
        robot = self._team_member
        parts = [part for child in robot.children for part in child.constraints]
        own = robot.private if self._assignment or not robot.variables else ()
        constraints = [one for one in (*own, *robot.shared, *parts) if values.keys() >= set(one.variables)]
        cost = sum(constraint.price(values) for constraint in constraints)
        return Checked(epoch, cost < INFINITE, cost if cost < INFINITE else 0)

    # Messages of the protocol

    def _hear(self, sender: str, said: Said, packet: list[Envelope]) -> None:
        envelope = Envelope(sender, self._robot.name, said.content, said.clock)
        if said.epoch == self._epoch and self._searching:
            packet.append(envelope)
        elif said.epoch > self._epoch or (said.epoch == self._epoch and not self._paused):
            self._early.setdefault(said.epoch, []).append(envelope)

    def _take_in(self, packet: list[Envelope]) -> None:
        if packet and self._host:
            self._received += len(packet)
            self._send(self._host.handle(packet))

    def _send(self, envelopes: list[Envelope]) -> None:
        for _, receiver, content, clock in envelopes:
            said = Said(self._epoch, clock, content)
            if self._filters:
                number = self._letters.next_number(receiver)
                context = self._context(self._robot.name, receiver, number, said)
                said = Said(self._epoch, clock, self._filters.seal(receiver, content, context))
            self._post.send(receiver, self._letters.write(receiver, said))
        self._sent += len(envelopes)
        if self._host:
            self._conclude(self._host)

    def _conclude(self, host: Host) -> None:
        verdict = host.protocol.verdict
        if verdict is not None and not self._concluded:
            self._concluded = True
            self._say(Conclusion(self._epoch, verdict))

    # Reports

    def _say_counters(self, wave: int) -> None:
        self._told = (self._sent, self._received)
        self._say(Counters(self._epoch, wave, *self._told))

    def _report_events(self) -> None:
        events, self._events[:] = list(self._events), []
        for start in range(0, len(events), EVENTS_AT_ONCE):
            self._say(Events(events[start : start + EVENTS_AT_ONCE]))

    def _fail(self, why: str, *, unsupported: bool, refusal: Exception) -> None:
        """Tell the master why this robot cannot go on, and wait a moment for its leave."""
        if self._welcome is None:
            return
        self._say(Failed(why, unsupported=unsupported, elsewhere=isinstance(refusal, TooMuch)))
        until = time.monotonic() + self._patience_s
        while time.monotonic() < until and self._post.connected:
            for item in self._items():
                if isinstance(item, Arrived) and item.sender == MASTER:
                    try:
                        opened = self._letters.read(MASTER, item.content)
                    except Refused:
                        continue
                    self._letters.take(MASTER, opened.number)
                    if isinstance(opened.word, Leave):
                        self._say(Bye())
                        return

    def _now(self) -> float:
        return time.monotonic() - self._began
