"""A robot's end of a run across machines: it registers with the master, and searches when that orders the start.

It knows its own file; what else it has to know (names, order, interfaces) the master tells it in its `Task`. What
happens then is `searcher.py`'s; this is the loop around it, with the letters: all messages that wait when it looks up
are one packet. It ends when the master says so, and by itself once the master is gone for longer than its patience.
"""

from __future__ import annotations

import secrets
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from queue import Empty
from typing import NamedTuple

import msgspec

from robochoc.authority.identity import Identity
from robochoc.authority.keyring import KeyCard, KeyCardError, KeyRing, UnknownPeerError
from robochoc.communication.control import Failed, Pause, Wave
from robochoc.communication.filters import FilterStack, NotGenuineError, UnknownFilterError, filter_named
from robochoc.communication.host import BadMessageError
from robochoc.communication.network.control_messages import (
    Bye,
    Copies,
    Denied,
    Gap,
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
    Sniffable,
    Task,
    Told,
    ToMaster,
    Welcome,
    Word,
)
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing, Opened
from robochoc.communication.network.inbox import Arrived, Item, Missed, Presence, Woken
from robochoc.communication.network.manner import AS_USUAL, Manner
from robochoc.communication.network.profile import among, profile_of, ranges_of
from robochoc.communication.network.quotas import Kept
from robochoc.communication.network.refusals import Refusals
from robochoc.communication.network.searcher import Searcher, Surroundings
from robochoc.communication.network.transport import Transport
from robochoc.model.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.encoding import TooLargeError, UnsupportedError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

IDLE_S = 0.002
"""A robot that has heard nothing for so long reports its counters. Only when to ask; never whether it is over."""
LOOK_UP_S = 0.25
"""How often a robot that waits looks whether the link is still there."""
REGISTER_AGAIN_S = 1.0
AT_ONCE = 10_000
"""So many letters at most are one packet."""
_VISIT_BYTES = 8
_UNUSABLE = (FrameRefusedError, NotGenuineError, UnknownPeerError, BadMessageError)


class Ending(NamedTuple):
    """How the run ended for this robot: the master's words, whether it failed, and the own decision."""

    why: str
    failed: bool
    assignment: dict[str, int]


class _RunOverError(Exception):
    def __init__(self, why: str, *, failed: bool) -> None:
        super().__init__(why)
        self.why = why
        self.failed = failed


class NetworkRobot:
    """The robot `own` at its `post`.

    `protocol_named` finds the protocol that the master asks for; it raises `LookupError`.
    """

    def __init__(
        self,
        own: CompiledRobot,
        identity: Identity,
        post: Transport,
        protocol_named: Callable[[str], type[Protocol]],
        manner: Manner = AS_USUAL,
    ) -> None:
        self._own = own
        self._robot = own.robot
        self._identity = identity
        self._post = post
        self._protocol_named = protocol_named
        self._manner = manner
        self._letters = Framing(own.robot.name)
        self._visit = secrets.token_hex(_VISIT_BYTES)
        self._ring: KeyRing | None = None
        self._filters: FilterStack | None = None
        self._welcome: Welcome | None = None
        self._searcher: Searcher | None = None
        self._ahead: list[tuple[str, Opened]] = []
        """What others have said in an epoch that the master has not told this robot of yet."""
        self._kept = Kept()
        self._registered = 0.0
        self._gaps: set[tuple[int, str]] = set()
        """In which search the master was told that letters of whom are lost: nobody floods it through this robot."""
        self._refusals = Refusals(lambda who, what, why: self._say(Objection(who, what, why)))
        self._connected = time.monotonic()
        self._router = post.router
        self._unanswered: float | None = None
        """Since when this robot has registered, and heard nothing of it."""

    def run(self) -> Ending:
        """Register, and take part until the end."""
        try:
            self._register()
            while True:
                self._turn(self._items())
        except _RunOverError as over:
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
        """All that has come; none when nothing has for a while."""
        restless = self._searcher is not None and self._searcher.restless
        items = []
        with suppress(Empty):
            items.append(self._post.inbox.get(timeout=IDLE_S if restless else LOOK_UP_S))
            while len(items) < AT_ONCE:
                items.append(self._post.inbox.get_nowait())
        return items

    def _turn(self, items: list[Item]) -> None:
        packet: list[Envelope] = []
        for item in items:
            match item:
                case Arrived(sender, content):
                    self._read(sender, content, packet)
                case Missed(sender, letters) if sender == MASTER:
                    raise UnsupportedError(
                        f"{letters:,} letters of the master to {self._robot.name} were lost for good"
                    )
                case Missed(sender, letters) if self._welcome:
                    self._tell_of_gap(sender, letters)
                case Missed() | Presence() | Woken():
                    pass
        if self._searcher:
            self._searcher.take_in(packet)
        if not items:
            self._idle()

    def _tell_of_gap(self, sender: str, letters: int) -> None:
        """Tell the master, once a search of each: it finds out whether the run can do without these letters."""
        gap = (self._searcher.epoch if self._searcher else 0, sender)
        if gap not in self._gaps:
            self._gaps.add(gap)
            self._say(Gap(sender, letters))

    def _idle(self) -> None:
        if self._searcher and self._searcher.restless:
            self._searcher.report_events()
            self._searcher.tell_counters(0)
            return
        self._look_up()
        if self._unanswered is not None and time.monotonic() - self._registered >= REGISTER_AGAIN_S:
            self._register()

    def _look_up(self) -> None:
        """Whether the master can be reached; behind a new router, whether it is the same one, and still takes us."""
        now = time.monotonic()
        router = self._post.router
        if router:
            self._connected = now
            if router != self._router:
                self._router = router
                self._register()
        elif now - self._connected > self._manner.patience_s:
            raise _RunOverError(f"the master is gone: no link to it for {self._manner.patience_s:g} s", failed=True)
        if self._unanswered is not None and now - self._unanswered > max(self._manner.patience_s, 2 * REGISTER_AGAIN_S):
            raise _RunOverError(
                f"the master does not answer {self._robot.name}: is it enrolled there, and not revoked?", failed=True
            )

    # Letters

    def _say(self, word: ToMaster) -> None:
        self._post.send(MASTER, self._letters.write(MASTER, word))

    def _send(self, receiver: str, word: Said | Copies) -> None:
        if self._filters:
            context = self._context(self._robot.name, receiver, self._letters.next_number(receiver), word)
            try:
                word = msgspec.structs.replace(word, content=self._filters.seal(receiver, word.content, context))
            except UnknownPeerError:
                return  # it was revoked, and hears nothing any more
        self._post.send(receiver, self._letters.write(receiver, word))

    def _read(self, sender: str, content: bytes, packet: list[Envelope]) -> None:
        try:
            opened = self._letters.read(sender, content)
            self._use(sender, opened, packet)
        except _UNUSABLE as refused:
            self._object(sender, str(refused))

    def _use(self, sender: str, opened: Opened, packet: list[Envelope]) -> None:
        """Take in what is for now; what is for later waits as it is, for the cards that open it have not come yet.

        Raises `BadMessageError`, `NotGenuineError`, `FrameRefusedError`, `UnknownPeerError`, so that what nobody can
        use does not take the place of another letter.
        """
        word, epoch = opened.word, self._searcher.epoch if self._searcher else 0
        if not isinstance(word, Said | Copies):
            self._letters.take(sender, opened.number)
            self._obey(word)
        elif word.epoch > epoch:
            if word.epoch > epoch + 1:
                raise FrameRefusedError(f"it is of epoch {word.epoch}, and this is {epoch}")
            if not self._kept.takes(sender, len(word.content)):
                raise FrameRefusedError(f"it is more than is kept of {sender} for epoch {word.epoch}")
            self._letters.take(sender, opened.number)
            self._ahead.append((sender, opened))
        else:
            word = self._unsealed(sender, opened.number, word)
            if isinstance(word, Said) and self._searcher and word.epoch == epoch:
                self._searcher.check(word.content)
            self._letters.take(sender, opened.number)
            self._hear(sender, word, packet)

    def _unsealed(self, sender: str, number: int, word: Said | Copies) -> Said | Copies:
        if self._filters is None:
            return word
        context = self._context(sender, self._robot.name, number, word)
        return msgspec.structs.replace(word, content=self._filters.open(sender, word.content, context))

    def _context(self, sender: str, receiver: str, number: int, word: Said | Copies) -> bytes:
        """What binds a sealed word to its place in the run."""
        kind = word.clock if isinstance(word, Said) else "copies"
        return f"{self._letters.run} {sender} {receiver} {number} {word.epoch} {kind}".encode()

    def _hear(self, sender: str, word: Said | Copies, packet: list[Envelope]) -> None:
        searcher = self._searcher
        if searcher is None or word.epoch != searcher.epoch:
            return
        if isinstance(word, Copies):
            searcher.learn(sender, word.content)
        else:
            envelope = Envelope(sender, self._robot.name, word.content, word.clock)
            if searcher.hear(envelope):
                packet.append(envelope)

    def _object(self, sender: str, why: str) -> None:
        """Tell the master of a letter that was refused."""
        if self._welcome is not None:
            self._refusals.note(sender, f"a letter to {self._robot.name}", why)

    # The master's orders

    def _obey(self, word: Word) -> None:
        match word:
            case Welcome():
                self._enter(word)
            case Denied(visit, why) if visit == self._visit:
                raise _RunOverError(f"the master does not take {self._robot.name}: {why}", failed=True)
            case Show(variables):
                domains = {variable.name: variable.domain for variable in self._robot.variables}
                self._say(Shown({name: ranges_of(domains[name]) for name in variables if name in domains}))
            case Revoked(name):
                if self._ring:
                    self._ring.dismiss(name)
            case Leave(why, failed):
                self._say(Bye())
                raise _RunOverError(why, failed=failed)
            case Denied() | Told() | Sniffable():
                pass
            case _:
                self._obey_in_search(word)

    def _obey_in_search(self, word: Word) -> None:
        searcher = self._searcher
        match word:
            case Task():
                self._take_task(word)
            case Search(epoch) if searcher and epoch == searcher.epoch:
                self._manner.stage("searching")
                searcher.search()
            case Wave(number) if searcher:
                searcher.tell_counters(number)
            case Pause() if searcher:
                searcher.pause()
            case Judge(epoch, values) if searcher and epoch == searcher.epoch:
                self._say(searcher.judged(values))
            case _:
                self._object(MASTER, f"{type(word).__name__} is nothing to be told now")

    def _register(self) -> None:
        self._registered = time.monotonic()
        if self._unanswered is None:
            self._unanswered = self._registered
        self._say(Register(profile_of(self._robot), self._visit))

    def _enter(self, welcome: Welcome) -> None:
        """Registered; a second welcome comes after an outage, and of another run from another master."""
        if welcome.visit != self._visit:
            return
        self._unanswered = None
        if self._welcome is None:
            self._begin(welcome)
        elif welcome.run != self._welcome.run:
            raise _RunOverError("the master was started anew; start this robot anew as well", failed=True)
        self._say(Joined(self._visit, self._ring.card.encode() if self._ring else b""))

    def _begin(self, welcome: Welcome) -> None:
        self._welcome = welcome
        self._letters.begin(welcome.run)
        if welcome.filters:
            self._ring = KeyRing(self._identity, welcome.run)
            try:
                self._filters = FilterStack(self._ring, [filter_named(name) for name in welcome.filters])
            except UnknownFilterError as unknown:
                raise UnsupportedError(f"{self._robot.name}: {unknown}") from None
        self._manner.stage("registered, waiting for the others")

    def _take_task(self, task: Task) -> None:
        """A new epoch."""
        if self._welcome is None:
            return
        self._admit(task.cards)
        try:
            protocol = self._protocol_named(task.protocol)
        except LookupError as unknown:
            raise UnsupportedError(f"{self._robot.name}: {unknown}") from None
        told = self._welcome.observed and not self._welcome.private  # events have values in them
        observed = told or self._manner.sniffed
        around = Surroundings(self._say, self._send, self._manner.place, observed, self._welcome.private)
        own = self._own.relinked(among(self._robot, task.interfaces), self._manner.compiled)
        self._searcher = Searcher(own, task, protocol, around)
        self._searcher.prepare()
        ahead, self._ahead = self._ahead, []
        self._kept.clear()
        for sender, opened in ahead:
            try:
                self._use(sender, opened, [])
            except _UNUSABLE as refused:
                self._object(sender, str(refused))

    def _admit(self, cards: tuple[bytes, ...]) -> None:
        """Believe the key cards of the others, if the Authority has certified them."""
        if self._ring is None:
            return
        for content in cards:
            try:
                card = KeyCard.decode(content)
                if card.name != self._robot.name:
                    self._ring.admit(card, time.time())
            except KeyCardError as bad:
                self._object(MASTER, str(bad))

    def _fail(self, word: Failed) -> None:
        """Tell the master why this robot cannot go on, and wait a while for its leave."""
        if self._welcome is None:
            return
        self._say(word)
        until = time.monotonic() + self._manner.patience_s
        while time.monotonic() < until and self._post.router:
            for item in self._items():
                if isinstance(item, Arrived) and item.sender == MASTER and self._is_leave(item.content):
                    self._say(Bye())
                    return

    def _is_leave(self, content: bytes) -> bool:
        try:
            opened = self._letters.read(MASTER, content)
        except FrameRefusedError:
            return False
        self._letters.take(MASTER, opened.number)
        return isinstance(opened.word, Leave)
