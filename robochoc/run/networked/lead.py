"""A whole run from the master's side: open, gather, search, let robots step aside, check, tell the outcome.

Section 5.2: "The master waits for the confirmation of creation all agents before ordering the start of the search."
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, assert_never

from msgspec import UNSET

from robochoc.authority.authority import Authority
from robochoc.authority.enrolment_server import EnrolmentServer
from robochoc.authority.identity import Identity
from robochoc.communication.host import SettingsError, settings_of
from robochoc.communication.network.journal_server import Publication
from robochoc.communication.network.master import Master
from robochoc.communication.network.members import Members
from robochoc.communication.network.router import RouterError
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.processes.robot_link import RobotsLostError
from robochoc.communication.run_result import Progress, RunResult
from robochoc.journal.events import Began, Observer
from robochoc.model.outcome import ALL_ROBOTS, Outcome, Verdict
from robochoc.model.problem import Domain, ProblemKind, Team, Variable
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import FIRST_FIT, MINIMISES, SATISFIES, default_protocol
from robochoc.run.incumbent import bound_of, joined, tree_of
from robochoc.run.networked.address import LOOPBACK, Address
from robochoc.run.options import Withdrawal
from robochoc.run.registry import protocol_by_name
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.encoding import UnsupportedError
from robochoc.verification.checker import RefutedError

HERE = Address(LOOPBACK)
"""Anything but loopback must be asked for."""
_TOLD = 5
"""So many who are awaited are named."""


@dataclass(frozen=True)
class Plan:
    """What a master is to do.

    `place` is where it listens, `hosts` how robots may call that place besides. `names` says who is in the team, or
    `number` how many are; without either the team is complete when every neighbour that somebody names is there.
    `protocol` is by default the one that suits the team. `timeout` counts from when the team is complete, `gather_s`
    is how long that may take (seconds; None: no limit). `authority` is the folder of the Authority.
    """

    authority: Path
    place: Address = HERE
    hosts: tuple[str, ...] = ()
    name: str = "team"
    names: tuple[str, ...] | None = None
    number: int | None = None
    protocol: str | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    withdraw: Withdrawal | None = None
    gather_s: float | None = None
    timeout: float | None = None
    messages: int | None = None
    conditions: NetworkSettings = NetworkSettings()


class TeamIncompleteError(Exception):
    """The team was not complete in time."""


class Led(NamedTuple):
    """The outcome, and what the master knows of the team: silhouettes, without any constraint."""

    outcome: Outcome
    team: Team


def lead(
    plan: Plan,
    *,
    observer: Observer | None = None,
    watched: bool = False,
    progress: Callable[[Progress], None] | None = None,
    listening: Callable[[], None] = lambda: None,
    publication: Publication | None = None,
    concluded: Callable[[Outcome | None], None] = lambda _outcome: None,
) -> Led:
    """Be the master of one run. `listening` is called once robots can come.

    Who has the right to sniff may have what is written to `publication`, while the run lasts and until a moment after
    `concluded` was called with its outcome (None: it broke off), which writes the last of it.
    Raises `AuthorityError`, `HostNameError`, `RouterError`, `TeamIncompleteError`, `RobotsLostError`,
    `UnsupportedError`, `UnknownProtocolError`, `RefutedError`.
    """
    _check_settings_early(plan)
    authority = Authority.open(plan.authority)
    hosts = [*([] if plan.place.anywhere else [plan.place.host]), *plan.hosts]
    called = [host for host in hosts if ":" not in host]
    if not called:
        why = "every address and the name of none" if plan.place.anywhere else "an address that zenoh checks no name of"
        raise UnsupportedError(f"{plan.place} is {why}; say how robots call it: --host NAME")
    endpoint = str(plan.place._replace(host=called[0]))
    identity = authority.master_identity(hosts)
    conditions = replace(plan.conditions, protocol=plan.protocol or "", listen=str(plan.place))
    members = Members(plan.names, plan.number)
    master = Master(
        authority, identity, endpoint, members, conditions, observer=observer, watched=watched, progress=progress
    )
    authority.observer = master.chronicle.relay
    if publication:
        master.publish(publication)
    with _enrolling(authority, identity, plan.place), master:
        listening()
        return _Lead(plan, master, observer, concluded).run()


@contextmanager
def _enrolling(authority: Authority, identity: Identity, place: Address) -> Iterator[None]:
    """Redeem tokens. Raises `RouterError`."""
    with ExitStack() as stack:
        try:
            stack.enter_context(EnrolmentServer(authority, identity, place.host, place.enrolment_port))
        except OSError as error:
            where = place._replace(port=place.enrolment_port)
            why = error.strerror or error
            raise RouterError(f"cannot listen on {where}, where tokens are redeemed: {why}") from error
        yield


class _Lead:
    """One run, once the master listens."""

    def __init__(
        self, plan: Plan, master: Master, observer: Observer | None, concluded: Callable[[Outcome | None], None]
    ) -> None:
        self._plan = plan
        self._master = master
        self._observer = observer
        self._concluded = concluded
        self._lost: dict[str, str] = {}
        self._deadline: float | None = None
        self._values: dict[str, dict[str, int]] = {}
        self._outcome = Outcome(plan.name, plan.protocol or SATISFIES, "network", plan.seed, Verdict.UNKNOWN)

    def run(self) -> Led:
        try:
            outcome = self._solved()
        except BaseException as error:
            failure = isinstance(error, RobotsLostError | UnsupportedError | RefutedError | TeamIncompleteError)
            self._concluded(None)
            self._master.leave(f"the run was broken off: {error if failure else 'the master has stopped'}", failed=True)
            raise
        self._concluded(outcome)
        self._master.leave(_in_words(outcome))
        return Led(outcome, self._seen())

    def _solved(self) -> Outcome:
        plan, members = self._plan, self._master.members
        if not self._master.gather(None if plan.gather_s is None else time.monotonic() + plan.gather_s):
            awaited = sorted(members.awaited)
            names = _listed(awaited) or "more robots"
            raise TeamIncompleteError(f"the team is not complete after {plan.gather_s:g} s; awaited: {names}")
        self._deadline = None if plan.timeout is None else time.monotonic() + plan.timeout
        kind = self._team().kind
        protocol = plan.protocol or default_protocol(kind)
        _check_settings(protocol, plan.settings)
        self._outcome = replace(self._outcome, protocol=protocol)
        traits = protocol_by_name(protocol).traits
        at_once = plan.withdraw is Withdrawal.FEWEST and traits.costs
        result = self._search(protocol, traits, self._brief(aside=at_once))
        outcome = self._answered(result, traits, aside=at_once)
        if outcome.verdict is not Verdict.NO_SOLUTION or plan.withdraw is None or at_once:
            return outcome
        fewest = plan.withdraw is Withdrawal.FEWEST
        second = MINIMISES if fewest else FIRST_FIT
        self._outcome = replace(self._outcome, metrics=outcome.metrics, witness=outcome.witness, placed_by=second)
        traits = protocol_by_name(second).traits
        return self._answered(self._search(second, traits, self._brief(aside=fewest)), traits, aside=True)

    def _search(self, protocol: str, traits: Traits, brief: RunParameters) -> RunResult:
        """Search until robots stop getting lost; without `survive` the first loss raises `RobotsLostError`."""
        plan, master = self._plan, self._master
        while True:
            left = None if self._deadline is None else max(0.0, self._deadline - time.monotonic())
            if self._observer:
                self._observer(Began(t=0, protocol=protocol, minimises=True if traits.costs else UNSET))
            result = master.search(protocol, traits, brief, left, plan.messages)
            self._outcome = replace(self._outcome, metrics=self._outcome.metrics + result.metrics)
            if not result.lost:
                return result
            self._lost |= result.lost
            master.members.remove(result.lost)
            if not master.members.robots:
                raise RobotsLostError(self._lost)

    def _answered(self, result: RunResult, traits: Traits, *, aside: bool) -> Outcome:
        """What `result` comes to, once every robot has checked its own constraints. Raises `RefutedError`."""
        outcome = replace(
            self._outcome,
            verdict=result.verdict,
            witness=result.witness or self._outcome.witness,
            tree=tree_of(result.findings),
            bound=bound_of(result.findings) if result.verdict is Verdict.UNKNOWN else None,
            lost=tuple(self._lost),
            withdrawn=tuple(self._lost),
        )
        self._refute(*(doubt.why for doubt in self._master.tally.doubts_about_verdict))
        ended = result.verdict is Verdict.SOLUTION
        if result.verdict is Verdict.UNKNOWN:
            outcome = replace(outcome, reason=self._limit(result.witness))
        if result.verdict is Verdict.NO_SOLUTION or not (ended or traits.costs):
            return claimed(outcome)
        proven = ended and (traits.complete or not traits.costs)
        out = tuple(name for name in self._master.members.order if not self._master.tally.assigned.get(name))
        if ended and aside:
            outcome = replace(outcome, withdrawn=(*outcome.withdrawn, *out))
        verdict = self._verdict(traits, aside=bool(out)) if proven else Verdict.UNKNOWN
        if self._plan.conditions.private:
            reason = "every robot knows its own values, and nobody else's (--private)"
            return claimed(replace(outcome, verdict=verdict, reason=reason))
        self._values = self._told(result.assignments)
        held, cost = self._master.checked(self._values)
        self._refute(*(doubt.why for doubt in self._master.tally.doubts_about_verdict))
        if held and (aside or not out):
            verdict = verdict if proven or not ended else Verdict.SOLUTION
            outcome = replace(outcome, verdict=verdict, assignment=joined(self._values), cost=cost, verified=True)
            return claimed(replace(outcome, checked=self._master.tally.thoroughness))
        if proven:
            against = "; ".join(self._master.tally.objections) or f"{_listed(out)} has no value"
            who = f"{result.witness} says that" if result.witness else "all fell quiet, so that"
            raise RefutedError(f"{who} {outcome.protocol} has a solution for {outcome.team}, but {against}")
        reason = outcome.reason or f"{outcome.protocol} has come to its end, and what it came by breaks a constraint"
        return claimed(replace(outcome, verdict=Verdict.UNKNOWN, reason=reason))

    def _told(self, reported: Mapping[str, dict[str, int]]) -> dict[str, dict[str, int]]:
        """Return what was `reported`. Raises `RobotsLostError` for who has values, and does not tell them."""
        for name, assigned in self._master.tally.assigned.items():
            if assigned and not reported[name]:
                raise RobotsLostError({name: "it has reported that it has values, and none of them"})
        return dict(reported)

    def _refute(self, *doubts: str) -> None:
        """Raise `RefutedError` if there are `doubts`: of two robots one lies, and nobody can tell which."""
        if doubts:
            raise RefutedError(f"{self._outcome.team} has no answer that can be believed: {'; '.join(doubts)}")

    def _seen(self) -> Team:
        """The team as the outcome shows it: with variables that only their robots knew before."""
        robots = []
        for robot in self._team().robots:
            shown = {variable.name for variable in robot.variables}
            others = [(name, value) for name, value in self._values.get(robot.name, {}).items() if name not in shown]
            told = tuple(Variable(name, Domain(name, (range(value, value + 1),))) for name, value in others)
            robots.append(replace(robot, variables=(*robot.variables, *told)))
        return Team(self._plan.name, tuple(robots))

    def _verdict(self, traits: Traits, *, aside: bool) -> Verdict:
        """What the answer of a protocol that has come to its end is."""
        minimal = traits.costs and traits.complete and (aside or self._team().kind is ProblemKind.DISWCSP)
        return Verdict.OPTIMAL if minimal else Verdict.SOLUTION

    def _brief(self, *, aside: bool) -> RunParameters:
        """What robots are told; to step aside costs more than all that constraints can charge together."""
        dearest = sum(member.profile.max_cost for member in self._master.members.robots.values())
        own = self._outcome.placed_by is None
        return RunParameters(self._plan.seed, self._plan.settings if own else {}, 1 + dearest if aside else None)

    def _limit(self, witness: str | None) -> str:
        """Return why there is no verdict, and who is to blame for it, as far as that can be told."""
        plan = self._plan
        if witness is not None:
            return f"{witness} gave up, as its protocol has it"
        if plan.messages is not None and sum(self._outcome.metrics.messages.values()) >= plan.messages:
            over = f"so many messages have been sent (--messages {plan.messages})"
        else:
            over = "the time was over" + ("" if plan.timeout is None else f" (--timeout {plan.timeout:g})")
        return "; ".join(filter(None, [over, self._master.tally.restless]))

    def _team(self) -> Team:
        members = self._master.members
        return Team(self._plan.name, tuple(members.robots[name].robot for name in members.order))


def claimed(outcome: Outcome) -> Outcome:
    """Return `outcome` with whom it rests on, as nobody could check it (docs/guides/security.md, "One traitor").

    That there is no solution is the word of who says so; that none costs less, or what was not told, is everybody's.
    """
    by: str | None = None
    match outcome.verdict:
        case Verdict.NO_SOLUTION:
            by = outcome.witness
        case Verdict.OPTIMAL:
            by = ALL_ROBOTS
        case Verdict.UNKNOWN:
            by = None if outcome.bound is None else ALL_ROBOTS
        case Verdict.SOLUTION:
            by = (outcome.witness if outcome.aside else None) if outcome.verified else ALL_ROBOTS
        case never:
            assert_never(never)
    return replace(outcome, claimed_by=by)


def _listed(names: Sequence[str]) -> str:
    """Return a few of `names` in words."""
    return ", ".join(names[:_TOLD]) + f" and {len(names) - _TOLD} others" * (len(names) > _TOLD)


def _check_settings_early(plan: Plan) -> None:
    """Before anybody comes: do not have a team gather for settings that no protocol of this plan has."""
    if plan.protocol:
        _check_settings(plan.protocol, plan.settings)
        return
    try:
        _check_settings(SATISFIES, plan.settings)
    except UnsupportedError:
        _check_settings(MINIMISES, plan.settings)


def _check_settings(protocol: str, settings: Mapping[str, str]) -> None:
    try:
        settings_of(protocol_by_name(protocol), settings)
    except SettingsError as wrong:
        raise UnsupportedError(f"--set: {wrong} (protocol {protocol})") from None


def _in_words(outcome: Outcome) -> str:
    """The outcome, as robots are told it."""
    aside = f", {len(outcome.aside)} step aside" if outcome.aside else ""
    claim = f", claimed by {outcome.claimed_by}" if outcome.claimed_by else ""
    return f"{outcome.verdict}{aside}{claim}"
