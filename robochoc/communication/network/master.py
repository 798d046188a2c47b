"""The master across machines: Figure 3's, which "launches its communication interface listening on the network".

It runs the router and is a participant like others. It registers robots (never seeing their files), closes the team
when all are there, gives each its task, orders the start, finds out by four counters when all is quiet, collects what
was decided, has every robot check its own constraints against it, and sends everybody home.

A robot whose liveliness token has been gone for longer than the patience is lost.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from queue import Empty
from typing import Self

from robochoc.authority.admission import Admission
from robochoc.authority.identity import Identity
from robochoc.communication.control import Events, Failed, OfEpoch, Pause, Wave
from robochoc.communication.network.access import ALL, journal_key
from robochoc.communication.network.connection_policy import ConnectionPolicy
from robochoc.communication.network.control_messages import (
    Ask,
    Bye,
    Denied,
    Gap,
    Joined,
    Judge,
    Leave,
    Objection,
    Register,
    Revoked,
    Search,
    Show,
    Shown,
    Sniff,
    ToRobot,
    Welcome,
    Word,
)
from robochoc.communication.network.facilitator import DirectoryFacilitator
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing
from robochoc.communication.network.gaps import TO_MASTER, Gaps
from robochoc.communication.network.inbox import Arrived, Inbox, Missed, Presence, Woken
from robochoc.communication.network.journal_server import JournalServer, Publication
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.members import Member, Members, RegistrationRefusedError
from robochoc.communication.network.profile import Profile
from robochoc.communication.network.requests import Requests
from robochoc.communication.network.router import Refusal
from robochoc.communication.network.search_state import SearchState
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.processes.robot_link import RobotsLostError
from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.session import over
from robochoc.journal.events import Observer
from robochoc.model.outcome import Verdict
from robochoc.protocols.traits import Traits
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.encoding import TooLargeError, UnsupportedError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

TICK_S = 0.2
REGISTRY_S = 0.5
"""How often the Authority's registry is looked at: who has been enrolled or revoked since."""
LAST_WORDS_S, FAREWELL_S, AGAIN_S = 10.0, 5.0, 0.5


class Master:
    """The master at `endpoint` (`HOST:PORT`), who takes robots that `admission` admits; a context manager.

    `members` says who is expected; then it holds who has come. `observer` is told of all events, refusals among them
    (those in threads of their own), with `watched` of the robots' too.
    """

    def __init__(
        self,
        admission: Admission,
        identity: Identity,
        endpoint: str,
        members: Members,
        conditions: NetworkSettings = NetworkSettings(),
        *,
        observer: Observer | None = None,
        watched: bool = False,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        self.endpoint = endpoint
        self.run = secrets.token_hex(8)
        self.members = members
        self.tally = SearchState()
        self._identity, self._conditions, self._watched, self._progress = identity, conditions, watched, progress
        self._shown = self._looked = self._read_registry = 0.0
        self._began = time.monotonic()
        self._letters = Framing(MASTER, self.run)
        self._facilitator = DirectoryFacilitator(endpoint, conditions.protocol)
        self.chronicle = MasterEvents(observer)
        told, listen = self._note_refusal if observer else None, conditions.listen or endpoint
        lease_ms, scratch = conditions.lease_ms, conditions.scratch
        self._gate = ConnectionPolicy(admission, identity, listen, told, lease_ms, members.ways, scratch)
        self._desk = JournalServer(self.run, self._gate.may_sniff, self.chronicle)
        self._requests = Requests(self._desk, self._facilitator, self._tell, self.chronicle.refuse)
        self._dead: dict[str, str] = {}
        self._gaps = Gaps(members, self.chronicle.refuse, self._lose)

    def __enter__(self) -> Self:
        """Listen. Raises `RouterError` and `CannotConnectError`."""
        try:
            self._gate.open()
            inbox, lease_ms = Inbox(self._gate.share_of), self._conditions.lease_ms
            self._post = Transport(
                self.endpoint, self._identity, heard=self._gate.admitted, inbox=inbox, lease_ms=lease_ms
            )
            if self._desk.publication:
                self._post.answer(journal_key(ALL), self._desk.answer)
        except BaseException:
            self._gate.close()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        try:
            self._post.close()
        finally:
            self._gate.close()

    @property
    def is_private(self) -> bool:
        """Whether robots keep their values to themselves."""
        return self._conditions.private

    def publish(self, publication: Publication) -> None:
        """Give what is written to `publication`, this run's journal, to those who may sniff. Before it listens."""
        publication.run = self.run
        self._desk.publication = publication
        self._gate.sniffable = True

    # What a run goes through

    def gather(self, deadline: float | None = None) -> bool:
        """Wait until all robots are registered; False when the deadline came first (on the monotonic clock)."""
        self._wait_until(lambda: self.members.complete, deadline)
        unseen = self.members.unseen()
        while unseen and not over(deadline):
            for name, variables in unseen.items():
                self._tell(name, Show(variables))
            self._wait_until(lambda before=unseen: self.members.unseen() != before, deadline)  # type: ignore[misc]
            unseen = self.members.unseen()
        self.members.closed = self.members.complete and not unseen
        stranger = next(self.members.strangers(), None) if self.members.closed else None
        if stranger:
            raise UnsupportedError(stranger)
        return self.members.closed

    def search(
        self,
        protocol: str,
        traits: Traits,
        brief: RunParameters,
        timeout: float | None = None,
        messages: int | None = None,
    ) -> RunResult:
        """Have all that are registered search by `protocol`, from the beginning, for at most `timeout` seconds.

        Raises `RobotsLostError`, and `UnsupportedError` when a robot's problem is too large, or not for this protocol.
        """
        began = time.monotonic()
        self.chronicle.begin()
        self._gaps.begin()
        deadline = None if timeout is None else began + timeout
        self._gate.open_ways(self.members.reach(writes_to_non_neighbours=traits.writes_to_non_neighbours))
        epoch, declared = self.tally.epoch + 1, self.members.declared(traits)
        tally = self.tally = SearchState(epoch, self.members.order, messages, declared)
        for name, task in self.members.tasks(tally.epoch, protocol, traits, brief).items():
            self._tell(name, task)
        self._wait_until(lambda: tally.broken_off or tally.ready, deadline)
        if tally.verdict is None and not tally.broken_off and not over(deadline):
            self._tell_all(Search(tally.epoch))
            self.chronicle.begin()
            tally.ordered = tally.searching = True
            self._wait_until(lambda: tally.verdict is not None or tally.broken_off, deadline)
            tally.searching = False
        tally.note_end(time.monotonic() - began, in_time=not over(deadline))
        self._collect(tally)
        return tally.result(tally.lasted_s)

    def checked(self, assignments: Mapping[str, Mapping[str, int]]) -> tuple[bool, float]:
        """Have every robot hold its constraints against what was decided: whether all hold, and the sum of the costs.

        Not in private runs: nobody tells its values there.
        """
        tally = self.tally
        for name in self.members.order:
            self._tell(name, Judge(tally.epoch, self.members.neighbourhood(name, assignments)))
        away_s = LAST_WORDS_S + self._conditions.patience_s + self._conditions.lease_ms / 1000
        self._wait_until(lambda: not tally.unchecked, time.monotonic() + away_s)
        if tally.unchecked or tally.lost:
            raise RobotsLostError(tally.lost or {MASTER: "robots have not checked their constraints in time"})
        return tally.held, tally.cost

    def leave(self, why: str, *, failed: bool = False, farewell_s: float = FAREWELL_S) -> None:
        """Tell all that the run is over, until they have heard it: some may have joined, or come back, just now."""
        leave, until = Leave(why, failed), time.monotonic() + farewell_s
        staying = partial(self.members.staying, FAREWELL_S, besides=self.tally.lost)
        with suppress(RobotsLostError, UnsupportedError):
            self._tell_all(leave)
            while staying() and not over(until):
                self._wait_until(lambda: not staying(), time.monotonic() + AGAIN_S)
                self._tell_all(leave)
            self._wait_until(lambda: not self._desk.lagging, time.monotonic() + FAREWELL_S)

    def lose(self, name: str, why: str) -> None:
        """Somebody who can see it says that the robot's process has ended. May be called from any thread."""
        self._dead[name] = why
        self._post.wake()

    def _wait_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve everybody until `done()` or the deadline; raises `RobotsLostError` as soon as one is lost for good."""
        while not done():
            now = time.monotonic()
            if over(deadline):
                return
            with suppress(Empty):
                self._serve(TICK_S if deadline is None else min(TICK_S, deadline - now))
            if self._dead or now - self._looked >= TICK_S:
                self._looked = now
                self._look_around(now)
            if self.tally.searching:
                self._ask_around(self.tally, now)

    def _serve(self, patience_s: float) -> None:
        """Deal with what has come, for a while at most. Raises `Empty` when nothing is left."""
        until = time.monotonic() + TICK_S
        item = self._post.inbox.get(timeout=max(patience_s, 0.001))
        while True:
            match item:
                case Arrived(sender, content):
                    self._read(sender, content)
                case Presence(name, there):
                    self._note_presence(name, there=there)
                case Missed():
                    self._gaps.at_the_master(item)
                case Woken():
                    return
            if time.monotonic() >= until:
                return
            item = self._post.inbox.get_nowait()

    def _look_around(self, now: float) -> None:
        """Who is gone for too long, whose process has ended, and who may not take part any more."""
        if self._gate.broken:
            raise RobotsLostError({MASTER: "the router's process has ended"})
        while self._dead:
            self._lose(*self._dead.popitem(), for_good=True)
        away_s = self._conditions.patience_s
        for name in [n for n, member in self.members.robots.items() if member.is_away(away_s) and not member.left]:
            self._lose(name, f"it has not been there for {away_s:g} s")
        if now - self._read_registry >= REGISTRY_S:
            self._read_registry = now
            for name, visit in self.members.to_welcome().items():
                self._welcome(name, visit)
            self._facilitator.expire()
            for subscriber, told in self._facilitator.notices():
                self._tell(subscriber, told)
            self._follow_registry()

    def _ask_around(self, tally: SearchState, now: float) -> None:
        """Begin a wave when it could show that all is quiet, or when somebody waits for news."""
        counters, missing = tally.counters, tally.missing(now, self._conditions.patience_s)
        wanted = tally.wave_due
        if self._progress and now - self._shown >= TICK_S:
            self._shown, wanted = now, wanted or not counters.waving
            self._progress(Progress(counters.sent, time.monotonic() - self._began))
        if missing and not self._gaps.explain_missing():
            tally.stuck = f"{missing:,} messages between robots were lost for good"
        elif counters.quiescent:
            tally.verdict = tally.verdict or Verdict.SOLUTION
        elif wanted:
            self._tell_all(Wave(counters.begin_wave()))

    def _collect(self, tally: SearchState) -> None:
        """Say that the search is over, and collect everybody's account. Raises `RobotsLostError` when it was stuck."""
        self._tell_all(Pause())
        self._wait_until(lambda: not tally.silent, time.monotonic() + LAST_WORDS_S)
        for name in tally.silent if tally.verdict is not None else ():
            self._lose(name, "it did not report at the end")
        doubts = self.chronicle.doubted(tally.doubts_about_counts)
        if tally.stuck:
            raise RobotsLostError({MASTER: tally.stuck + doubts})

    def _tell(self, name: str, word: ToRobot) -> None:
        self._post.send(name, self._letters.write(name, word))

    def _tell_all(self, word: ToRobot) -> None:
        for name in self.members.listening:
            self._tell(name, word)

    def _read(self, sender: str, content: bytes) -> None:
        try:
            opened = self._letters.read(sender, content)
        except FrameRefusedError as refused:
            self.chronicle.refuse(sender, TO_MASTER, str(refused))
            return
        self._letters.take(sender, opened.number)
        member = self.members.robots.get(sender)
        match opened.word:
            case Register(profile, visit):
                self._register(sender, profile, visit)
            case Ask() | Sniff():
                self._requests.answer(sender, opened.word)
            case _ if member is None:
                self.chronicle.refuse(sender, TO_MASTER, "it is not registered")
            case word:
                self._hear(sender, member, word)

    def _hear(self, name: str, member: Member, word: Word) -> None:
        match word:
            case OfEpoch():
                self._note_failure(name, self.tally.hear(name, word))
            case Joined(visit, card):
                member.join(visit, card)
            case Shown(variables):
                self._note_failure(name, self.members.show(name, variables))
            case Events(told):
                self.chronicle.told(name, told)
            case Failed(why, unsupported, elsewhere):
                refusal = TooLargeError if elsewhere else UnsupportedError
                self._note_failure(name, why, refusal if unsupported else None)
            case Objection(who, what, why):
                self.chronicle.refuse(who, what, f"{why} ({name} says so)")
            case Gap():
                self._gaps.between(name, word)
            case Bye():
                member.left = True
            case _:
                raise AssertionError(word)  # `Framing` decodes nothing else

    def _note_failure(self, name: str, why: str, refusal: type[UnsupportedError] | None = None) -> None:
        """The robot cannot go on (if there is a `why`); a `refusal` ends the run."""
        why = on_one_line(why, LONGEST_REASON)
        if refusal:
            raise refusal(why)
        if why:
            self._lose(name, why, for_good=True)

    # Who is there

    def _register(self, name: str, profile: Profile, visit: str) -> None:
        known = self.members.robots.get(name)
        try:
            member = self.members.register(name, profile, visit, admitted=self._gate.is_robot(name))
        except RegistrationRefusedError as refusal:
            self.chronicle.refuse(name, "register", str(refusal))
            self._tell(name, Denied(visit, str(refusal)))
            return
        if member is not known:
            self._letters.forget(name)
            if unfit := self._facilitator.enter(profile):
                self.chronicle.refuse(name, "be in the directory", unfit)
            self.chronicle.registered(name)
            if self._progress:
                elapsed_s, number = time.monotonic() - self._began, len(self.members.robots)
                self._progress(Progress(0, elapsed_s, f"{number} robots registered"))
        self._welcome(name, visit)

    def _welcome(self, name: str, visit: str) -> None:
        self._tell(name, Welcome(visit, self.run, self._conditions.filters, self._watched, self._conditions.private))

    def _note_presence(self, name: str, *, there: bool) -> None:
        if member := self.members.robots.get(name):
            member.note_presence(there=there)

    def _follow_registry(self) -> None:
        """Let in who was enrolled since, and throw out who was revoked; that needs a router with other rules."""
        for name in self._gate.revoked(self.members.robots):
            if name not in self.tally.lost:
                self.chronicle.refuse(name, "take part", "its certificate was revoked")
                self._tell_all(Revoked(name))
                self._gate.follow()
                self._lose(name, "its certificate was revoked")
        self._gate.follow()
        self._post.hear(self._gate.admitted)

    def _lose(self, name: str, why: str, *, for_good: bool = False) -> None:
        """The robot is lost: before the search it may come back, unless `for_good`; in it that ends the run."""
        member = self.members.robots.get(name)
        if name in self.tally.lost or (member.left if member else not for_good or self.members.closed):
            return
        self._facilitator.leave(name)
        if not self.members.closed and not for_good:
            self.members.remove([name])
            return
        self.chronicle.lost(name, why)
        self.tally.lose(name, why)
        if not self._conditions.survive or not self.members.closed:
            raise RobotsLostError({name: why})

    def _note_refusal(self, refusal: Refusal) -> None:
        """What the router tells; not of those who were enrolled a moment ago, and are let in when they try again."""
        if refusal.what != "connect" or not self._gate.admits(refusal.who):
            self.chronicle.refuse(*refusal)
