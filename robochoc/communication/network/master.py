"""The master across machines: Figure 3's, "which launches its communication interface listening on the network".

It runs the router and is a participant like others. It registers robots (never seeing their files), closes the team
when all are there, gives each its task, orders the start, finds out by four counters when all is quiet, collects what
was decided, has every robot check its own constraints against it, and sends everybody home.

Whatever dies is noticed: a robot whose liveliness token has been gone for longer than the patience is lost.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from queue import Empty
from types import TracebackType
from typing import Self

from robochoc.authority.admission import Admission
from robochoc.authority.identity import Identity
from robochoc.authority.registry import Role
from robochoc.communication.control import Conclusion, Counters, Events, Failed, OfEpoch, Pause, Ready, Wave
from robochoc.communication.network.letters import MASTER, Letters, Refused, TooLarge
from robochoc.communication.network.members import Member, Members, NotTaken
from robochoc.communication.network.post import LEASE_MS, Arrived, Missed, Post, Presence, Woken
from robochoc.communication.network.profile import BadProfile, Profile, domain_of
from robochoc.communication.network.router import Refusal, Router
from robochoc.communication.network.words import (
    Account,
    Ask,
    Bye,
    Checked,
    Denied,
    Joined,
    Judge,
    Leave,
    Objection,
    Register,
    Revoked,
    Search,
    Show,
    Shown,
    Told,
    ToRobot,
    Welcome,
    Word,
)
from robochoc.communication.quiescence import Counts, FourCounters
from robochoc.communication.robot_link import RobotsLost
from robochoc.communication.run_result import Progress, RunResult
from robochoc.observers import events
from robochoc.observers.events import AnyEvent, Observer
from robochoc.outcome import Verdict
from robochoc.protocols.traits import Traits
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.descriptions import Refused as RefusedByDirectory
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle
from robochoc.solver.encoding import TooMuch, Unsupported
from robochoc.solver.part import Brief

TICK_S = 0.2
REGISTRY_S = 0.5
"""How often the Authority's registry is looked at: who has been enrolled or revoked since."""
LAST_WORDS_S = 10.0
FAREWELL_S = 2.0
_RUN_BYTES = 8
_ASKED_AT_MOST = 20
"""Requests to the Directory Facilitator that a participant may make in a second."""


class Master:
    """The master at `endpoint` (`HOST:PORT`), with the Authority whose robots it takes; a context manager.

    `protocol` is what the Directory Facilitator is told that robots speak. `expected` names the robots of the team, `number` says how many there are; without either, the team is complete when
    every neighbour that a robot names is there. `filters` are what messages go through; in a `private` run nobody
    tells its values. A robot may be away for `patience_s`. With `survive`, robots that are lost break the search off,
    and are told of in its result; otherwise `RobotsLost` is raised.
    """

    def __init__(
        self,
        authority: Admission,
        identity: Identity,
        endpoint: str,
        *,
        protocol: str = "",
        expected: Collection[str] | None = None,
        number: int | None = None,
        filters: tuple[str, ...] = (),
        private: bool = False,
        patience_s: float = 10.0,
        lease_ms: int = LEASE_MS,
        survive: bool = False,
        observer: Observer | None = None,
        watched: bool = False,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        self.endpoint = endpoint
        self.run = secrets.token_hex(_RUN_BYTES)
        self.members = Members(expected, number)
        self._authority = authority
        self._identity = identity
        self._protocol = protocol
        self._filters = filters
        self._private = private
        self._patience_s = patience_s
        self._lease_ms = lease_ms
        self._survive = survive
        self._observer = observer
        self._watched = watched
        self._progress = progress
        self._began = time.monotonic()
        self._letters = Letters(MASTER, self.run)
        self._directory = Directory()
        self._asked: dict[str, list[float]] = {}
        self._router = Router(endpoint, identity, self._note_refusal, lease_ms)
        self._beyond: bool | None = None
        self._epoch = 0
        self._lost: dict[str, str] = {}
        self._dead: dict[str, str] = {}
        self._shown = self._looked = self._read_registry = 0.0
        self._admitted: dict[str, tuple[str, ...]] = {}
        self._checks: dict[str, Checked] = {}
        self._enter_epoch(())

    def _enter_epoch(self, order: tuple[str, ...]) -> None:
        self._counters = FourCounters(order)
        self._verdict: Verdict | None = None
        self._witness: str | None = None
        self._enough: int | None = None
        self._searching = False
        self._lost = {}
        self._checks = {}
        for member in self.members.robots.values():
            member.ready, member.account = False, None

    def __enter__(self) -> Self:
        self._router.open(self._reach())
        try:
            self._post = Post(self.endpoint, self._identity, lease_ms=self._lease_ms)
        except BaseException:
            self._router.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._post.close()
        finally:
            self._router.close()

    # What a run goes through

    def gather(self, deadline: float | None = None) -> bool:
        """Wait until all robots are registered; False when the deadline came first (on the monotonic clock)."""
        self._wait_until(lambda: self.members.complete, deadline)
        if not self.members.complete:
            return False
        while unseen := self.members.unseen():
            for name, variables in unseen.items():
                self._tell(name, Show(variables))
            self._wait_until(lambda before=unseen: self.members.unseen() != before, deadline)  # type: ignore[misc]
            if _over(deadline):
                return False
        self.members.closed = True
        return True

    def search(
        self,
        protocol: str,
        traits: Traits,
        brief: Brief,
        timeout: float | None = None,
        messages: int | None = None,
    ) -> RunResult:
        """Have all that are registered search by `protocol`, from the beginning, for at most `timeout` seconds.

        Raises `RobotsLost`, and `Unsupported` when a robot's problem is more than its machine or the protocol can take.
        """
        began = time.monotonic()
        deadline = None if timeout is None else began + timeout
        self._epoch += 1
        self._enter_epoch(self.members.order)
        self._open_ways(beyond=traits.beyond)
        for name, task in self.members.tasks(self._epoch, protocol, traits, brief).items():
            self._tell(name, task)
        members = self.members.robots
        self._wait_until(lambda: self._broken_off or all(m.ready for m in members.values()), deadline)
        if self._verdict is None and not self._broken_off and not _over(deadline):
            self._enough = messages
            self._tell_all(Search(self._epoch))
            self._searching = True
            self._wait_until(lambda: self._verdict is not None or self._broken_off, deadline)
            self._searching = False
        return self._finish(began)

    def checked(self, result: RunResult, deadline: float | None = None) -> tuple[bool, float]:
        """Have every robot hold its constraints against what was decided: whether all hold, and the sum of the costs.

        Robots without values have stepped aside. Not in private runs: nobody tells its values there.
        """
        self._checks = {}
        for name in self.members.order:
            self._tell(name, Judge(self._epoch, self.members.neighbourhood(name, result.assignments)))
        limit = time.monotonic() + LAST_WORDS_S
        limit = limit if deadline is None else min(limit, deadline)
        self._wait_until(lambda: self._checks.keys() >= self.members.robots.keys(), limit)
        complete = self._checks.keys() >= self.members.robots.keys()
        held = complete and all(check.allowed for check in self._checks.values())
        return held, sum(check.cost for check in self._checks.values())

    def dismiss(self, names: Collection[str]) -> None:
        """Those who are lost are out of the team."""
        self.members.remove(names)

    def leave(self, why: str, *, failed: bool = False) -> None:
        """Tell all that the run is over, and wait a moment until they have heard it."""
        with suppress(RobotsLost):
            self._tell_all(Leave(why, failed))
            until = time.monotonic() + FAREWELL_S
            self._wait_until(lambda: all(m.left or m.gone for m in self.members.robots.values()), until)

    def lose(self, name: str, why: str) -> None:
        """Somebody who can see it says that the robot's process has ended. May be called from any thread."""
        self._dead[name] = why
        self._post.wake()

    # The loop

    def _wait_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve everybody until `done()` or the deadline; raises `RobotsLost` as soon as one is lost for good."""
        while not done():
            now = time.monotonic()
            if _over(deadline):
                return
            with suppress(Empty):
                self._serve(TICK_S if deadline is None else min(TICK_S, deadline - now))
            if now - self._looked >= TICK_S:
                self._looked = now
                self._look_around(now)
            if self._searching:
                self._ask_around(now)

    def _serve(self, patience_s: float) -> None:
        """Deal with one thing that has come, and what else waits."""
        item = self._post.inbox.get(timeout=max(patience_s, 0.001))
        while True:
            match item:
                case Arrived(sender, content):
                    self._read(sender, content)
                case Presence(name, there):
                    self._note_presence(name, there=there)
                case Missed(letters):
                    raise RobotsLost({MASTER: f"{letters} letters to it were lost for good"})
                case Woken():
                    pass
            item = self._post.inbox.get_nowait()

    def _look_around(self, now: float) -> None:
        """Who is gone for too long, whose process has ended, and who may not take part any more."""
        if self._router.ended:
            raise RobotsLost({MASTER: "the router's process has ended"})
        for name, why in list(self._dead.items()):
            del self._dead[name]
            self._lose(name, why)
        for name, member in list(self.members.robots.items()):
            if member.gone is not None and now - member.gone > self._patience_s and not member.left:
                self._lose(name, f"it has not been there for {self._patience_s:g} s")
        if now - self._read_registry >= REGISTRY_S:
            self._read_registry = now
            self._directory.expire(time.time())
            self._follow_registry()

    def _ask_around(self, now: float) -> None:
        """Begin a wave when it could show that all is quiet, or when somebody waits for news."""
        if self._counters.quiescent:
            self._verdict = self._verdict or Verdict.SOLUTION
        elif self._counters.due or (self._enough is not None and not self._counters.waving):
            self._tell_all(Wave(self._counters.begin_wave()))
        elif self._progress and now - self._shown >= TICK_S:
            self._shown = now
            self._progress(Progress(self._counters.sent, self._now()))
            if not self._counters.waving:
                self._tell_all(Wave(self._counters.begin_wave()))

    @property
    def _broken_off(self) -> bool:
        return bool(self._lost) or (self._enough is not None and self._counters.sent >= self._enough)

    # Letters

    def _tell(self, name: str, word: ToRobot) -> None:
        try:
            self._post.send(name, self._letters.write(name, word))
        except TooLarge as large:
            raise Unsupported(str(large)) from None

    def _tell_all(self, word: ToRobot) -> None:
        for name in list(self.members.robots):
            self._tell(name, word)

    def _read(self, sender: str, content: bytes) -> None:
        try:
            opened = self._letters.read(sender, content)
        except Refused as refused:
            self._refuse(sender, "a letter to the master", str(refused))
            return
        self._letters.take(sender, opened.number)
        match opened.word:
            case Register(profile, visit):
                self._register(sender, profile, visit)
            case Ask(number, request):
                self._ask(sender, number, request)
            case _:
                member = self.members.robots.get(sender)
                if member is None:
                    self._refuse(sender, "a letter to the master", "it is not registered")
                else:
                    self._hear(sender, member, opened.word)

    def _hear(self, name: str, member: Member, word: Word) -> None:
        if isinstance(word, OfEpoch) and word.epoch != self._epoch:
            return
        match word:
            case Joined(card):
                member.card, member.joined = card, True
            case Shown(variables):
                self._note_shown(name, member, variables)
            case Ready():
                member.ready = True
            case Counters(_, wave, sent, received):
                self._counters.answer(name, wave, Counts(sent, received))
            case Conclusion(_, verdict):
                self._verdict, self._witness = Verdict(verdict), name
            case Events(told):
                for event in told:
                    self._observe(event)
            case Account():
                member.account = word
            case Checked():
                self._checks[name] = word
            case Failed(why, unsupported, elsewhere):
                refusal = TooMuch if elsewhere else Unsupported
                raise refusal(why) if unsupported else RobotsLost({name: why})
            case Objection(who, what, why):
                self._refuse(who, what, f"{why} ({name} says so)")
            case Bye():
                member.left = True
            case _:
                self._refuse(name, "a letter to the master", f"{type(word).__name__} is no word for the master")

    def _note_shown(self, name: str, member: Member, variables: Mapping[str, tuple[tuple[int, int], ...]]) -> None:
        wanted = self.members.unseen().get(name, ())
        try:
            for variable, ranges in variables.items():
                domain_of(variable, ranges)
        except BadProfile as bad:
            raise RobotsLost({name: str(bad)}) from None
        if not set(wanted) <= variables.keys():
            missed = sorted(set(wanted) - variables.keys())
            raise Unsupported(f"a parent of {name} looks at {missed[0]}, which is no variable of {name}")
        member.also.update({variable: variables[variable] for variable in wanted})

    # Registration

    def _register(self, name: str, profile: Profile, visit: str) -> None:
        try:
            if self._authority.is_revoked(name):
                raise NotTaken("its certificate was revoked")
            known = self.members.robots.get(name)
            member = self.members.register(name, profile, visit)
        except NotTaken as refusal:
            self._refuse(name, "register", str(refusal))
            self._tell(name, Denied(visit, str(refusal)))
            return
        if member is not known:
            self._letters.forget(name)
            self._enter_in_directory(profile)
            self._observe(events.Registered(t=self._now(), robot=name))
            if self._progress:
                self._progress(Progress(0, self._now(), f"{len(self.members.robots)} robots registered"))
        member.gone = None
        self._tell(name, Welcome(visit, self.run, self._filters, self._watched, self._private))

    def _note_presence(self, name: str, *, there: bool) -> None:
        member = self.members.robots.get(name)
        if member:
            member.gone = None if there else member.gone or time.monotonic()

    def _follow_registry(self) -> None:
        """Let in who was enrolled since, and throw out who was revoked; that needs a router with other rules."""
        for name in [name for name in self.members.robots if self._authority.is_revoked(name)]:
            self._refuse(name, "take part", "its certificate was revoked")
            self._tell_all(Revoked(name))
            self._lose(name, "its certificate was revoked")
        reach = self._reach()
        if reach != self._admitted:
            self._open_router(reach)

    def _reach(self) -> dict[str, tuple[str, ...]]:
        """Who may take part now, and write to whom."""
        names = [*self._authority.names(Role.ROBOT), *self._authority.names(Role.OBSERVER)]
        reach: dict[str, tuple[str, ...]] = {n: () for n in names if not self._authority.is_revoked(n)}
        if self._beyond is not None:
            reach.update({n: to for n, to in self.members.reach(beyond=self._beyond).items() if n in reach})
        return reach

    def _open_ways(self, *, beyond: bool) -> None:
        """Let robots write to each other, as far as the protocol has to."""
        self._beyond = beyond
        reach = self._reach()
        if reach != self._admitted:
            self._open_router(reach)

    def _open_router(self, reach: dict[str, tuple[str, ...]]) -> None:
        self._admitted = reach
        self._router.open(reach)

    def _lose(self, name: str, why: str) -> None:
        """The robot is lost: before the search it may come back, in it that ends the run, or the search."""
        member = self.members.robots.get(name)
        if member is None or name in self._lost:
            return
        with suppress(RefusedByDirectory):
            self._directory.deregister(self._aid(name), requester=self._aid(name))
        if not self.members.closed:
            self.members.remove([name])
            return
        self._observe(events.Lost(t=self._now(), robot=name, why=why))
        if not self._survive:
            raise RobotsLost({name: why})
        self._lost[name] = why

    # The Directory Facilitator

    def _enter_in_directory(self, profile: Profile) -> None:
        services = (
            *(ServiceDescription(name=topic, type="topic") for topic in profile.topics),
            *(ServiceDescription(name=variable, type="variable") for variable in profile.variables),
        )
        name = self._aid(profile.name)
        protocols = (self._protocol,) if self._protocol else ()
        description = AgentDescription(name, services, protocols, ("robochoc",), addresses=(f"tls/{self.endpoint}",))
        with suppress(RefusedByDirectory):
            self._directory.deregister(name, requester=name)
        try:
            self._directory.register(description, time.time(), requester=name)
        except RefusedByDirectory as refusal:
            self._refuse(profile.name, "register with the Directory Facilitator", str(refusal))

    def _ask(self, requester: str, number: int, request: str) -> None:
        now = time.time()
        recent = [t for t in self._asked.get(requester, []) if now - t < 1]
        self._asked[requester] = [*recent, now]
        if len(recent) >= _ASKED_AT_MOST:
            self._refuse(requester, "ask the Directory Facilitator", f"more than {_ASKED_AT_MOST} times a second")
            return
        performative, content = handle(self._directory, self._aid(requester), request, now)
        self._tell(requester, Told(number, str(performative), content))

    def _aid(self, name: str) -> str:
        """The name of a participant's agent identifier: `Robot3.1@host:port/robochoc`."""
        return f"{name}@{self.endpoint}/robochoc"

    # The end of an epoch

    def _finish(self, began: float) -> RunResult:
        """Say that the search is over, and collect everybody's account."""
        wall_s = time.monotonic() - began
        self._tell_all(Pause())
        members = self.members.robots
        until = time.monotonic() + LAST_WORDS_S
        self._wait_until(lambda: all(m.account or name in self._lost for name, m in members.items()), until)
        silent = [name for name, m in members.items() if m.account is None and name not in self._lost]
        if silent and self._verdict is not None:
            if not self._survive:
                raise RobotsLost(dict.fromkeys(silent, "it did not report at the end"))
            self._lost.update(dict.fromkeys(silent, "it did not report at the end"))
        accounts = {name: m.account for name, m in members.items() if m.account is not None and name not in self._lost}
        result = RunResult.of(
            Verdict.UNKNOWN if self._lost or self._verdict is None else self._verdict,
            None if self._lost else self._witness,
            {name: account.assignment for name, account in accounts.items()},
            [account.metrics for account in accounts.values()],
            wall_s,
        )
        findings = {name: account.findings for name, account in accounts.items()}
        return replace(result, lost=dict(self._lost), findings=findings)

    # Small things

    def _note_refusal(self, refusal: Refusal) -> None:
        """What the router's thread tells."""
        self._refuse(refusal.who or "somebody", refusal.what, refusal.why)

    def _refuse(self, who: str, what: str, why: str) -> None:
        self._observe(events.Refused(t=self._now(), who=who, what=what, why=why))

    def _observe(self, event: AnyEvent) -> None:
        if self._observer:
            self._observer(event)

    def _now(self) -> float:
        return time.monotonic() - self._began


def _over(deadline: float | None) -> bool:
    return deadline is not None and time.monotonic() >= deadline
