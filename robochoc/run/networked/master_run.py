"""The master's side of a run: listen, wait for the team, search, check, report the outcome.

Section 5.2: "The master waits for the confirmation of creation all agents before ordering the start of the search."
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import field, replace
from pathlib import Path
from typing import NamedTuple

from robochoc.authority.admission import Admission
from robochoc.authority.authority import Authority
from robochoc.authority.enrolment_server import EnrolmentServer
from robochoc.authority.identity import Identity, IdentityError
from robochoc.communication.network.control_messages import TeamDecision
from robochoc.communication.network.journal_server import Publication
from robochoc.communication.network.master import Master
from robochoc.communication.network.master_votes import NoMajorityError, SupersededError
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.router import RouterError
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.search_result import Progress, RobotsLostError
from robochoc.formats.result import ResultError, read_result, result_json
from robochoc.journal.events import Observer
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.model.symbols import real_places, symbol_table, symbolic_variables
from robochoc.run.choice import choose_for_private_team
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.compatibility.team_rules import refuse_unfit
from robochoc.run.defaults import AUTO, DEFAULT_COST_PROTOCOL, DEFAULT_PROTOCOL
from robochoc.run.distributed import solve_distributed
from robochoc.run.improvement import Audience
from robochoc.run.incumbent import merged_values
from robochoc.run.networked.address import LOOPBACK, Address
from robochoc.run.networked.machines import Machines, claimed, first_names, registered_team
from robochoc.run.networked.standby import LeaderWatch, StandbyPlan
from robochoc.run.options import AnswerRule, OnLoss, Options, Runtime, Withdrawal
from robochoc.run.registry import protocol_or_stage
from robochoc.run.starts import start_of_outcome
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionError, RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.verification.checker import RefutedError

LOOPBACK_ADDRESS = Address(LOOPBACK)
"""The default address, reachable only from this machine. Other addresses must be chosen explicitly."""
SHARED = (
    "seed", "timeout", "deadline", "improve", "answer", "repair", "withdraw", "messages", "message_loss", "settings",
)  # fmt: skip
"""The fields of `MasterPlan` that are also in `Options`, with the same meaning."""


@dataclass(frozen=True)
class MasterPlan:
    """The plan of a master's run.

    Attributes:
        authority: The folder of the Authority.
        place: The address at which the master listens.
        hosts: Further names and addresses of the master's machine that robots may use.
        name: The team's name.
        names: The robots of the team. If neither `names` nor `number` is given, the team is complete when every
            neighbour named by a robot has registered.
        number: The number of robots of the team.
        protocol: The protocol's name (None, or `auto`: a protocol is chosen from the data that the robots declare).
        settings: The protocol's settings, as text.
        seed: The seed of protocols with random decisions.
        withdraw: The rule by which robots withdraw if the team has no solution (None: no robot withdraws).
        gather_s: The seconds to wait for the team (None: no limit).
        timeout: A limit in seconds, from the time at which the team is complete (None: no limit).
        deadline: A limit like `timeout`, but the best assignment known at the deadline is the answer (None: no
            deadline).
        improve: The seconds after the deadline in which the robots search for better answers (None: they stop).
        answer: The answer of a search that proves nothing: see `Options`.
        repair: True if a local search repairs the assignment of an incomplete protocol: see `Options`.
        messages: A limit on the number of messages (None: no limit).
        message_loss: The probability with which robots drop received messages.
        start: The outcome from whose assignment the robots begin (None: they begin without an assignment).
        standby: The masters with a higher priority, and this master's identity (None: it has the highest priority).
        following: Called whenever a standby master begins to follow another master.
        conditions: The network settings.
    """

    authority: Path
    place: Address = LOOPBACK_ADDRESS
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
    deadline: float | None = None
    improve: float | None = None
    answer: AnswerRule = AnswerRule.BEST
    repair: bool = True
    messages: int | None = None
    message_loss: float = 0.0
    start: Outcome | None = None
    standby: StandbyPlan | None = None
    following: Callable[[], None] = lambda: None
    conditions: NetworkSettings = NetworkSettings()

    def options(self, protocol: str) -> Options:
        """Return the options of a run with `protocol`."""
        return Options(
            protocol=protocol,
            runtime=Runtime.NETWORK,
            on_loss=OnLoss.WITHDRAW if self.conditions.survive else OnLoss.FAIL,
            patience=self.conditions.patience_s,
            filters=self.conditions.filters,
            **{name: getattr(self, name) for name in SHARED},
        )


class TeamIncompleteError(RobochocError):
    """Raised if the team was not complete in time."""


class MasterResult(NamedTuple):
    """The outcome, and the team without constraints, as the master sees it."""

    outcome: Outcome
    team: Team


def run_master(
    plan: MasterPlan,
    *,
    observer: Observer | None = None,
    audience: Audience | None = None,
    watched: bool = False,
    progress: Callable[[Progress], None] | None = None,
    listening: Callable[[], None] = lambda: None,
    publication: Publication | None = None,
    concluded: Callable[[Outcome | None], None] = lambda _outcome: None,
) -> MasterResult:
    """Act as the master in one run.

    Args:
        plan: The plan of the run.
        observer: Receives all events of the master.
        audience: Receives each answer that is published during the search (`plan.improve`).
        watched: True if the observer also receives the robots' events.
        progress: Receives the number of messages so far, from time to time.
        listening: Called as soon as robots can connect.
        publication: The journal for members that may sniff. It is served until shortly after `concluded`.
        concluded: Called with the outcome (None: the run was aborted). It writes the end of the publication.

    Raises:
        AuthorityError: if the folder has no Authority.
        HostNameError: if a host name is invalid.
        RouterError: if the master cannot listen.
        TeamIncompleteError: if the team is not complete in time.
        RobotsLostError: if robots were lost, and the options do not let the run continue without them.
        UnsupportedError: if the options cannot be combined with each other or with the team.
        UnknownProtocolError: if the protocol is not installed.
        RefutedError: if a check refutes the answer.
        RunOverElsewhereError: if this is a standby master, and another master has ended the run.
    """
    _refuse_early(plan)
    hosts = [*([] if plan.place.anywhere else [plan.place.host]), *plan.hosts]
    called = [host for host in hosts if ":" not in host]
    if not called:
        why = "means all addresses" if plan.place.anywhere else "has no name that zenoh can check"
        raise UnsupportedError(f"{plan.place} {why}; name the host by which robots connect: --host NAME")
    conditions = replace(
        plan.conditions, protocol="" if plan.protocol in {None, AUTO} else plan.protocol, listen=str(plan.place)
    )

    def opened(admission: Admission, identity: Identity) -> Master:
        endpoint = str(plan.place._replace(host=called[0]))
        members = NetworkMembers(plan.names, plan.number)
        master = Master(
            admission, identity, endpoint, members, conditions, observer=observer, watched=watched, progress=progress
        )
        if publication:
            master.publish(publication)
        return master

    observers = observer, audience
    if plan.standby is not None:
        _refuse_other_hosts(plan.standby.identity, hosts)
        return _stand_by(plan, plan.standby, opened, lambda master: _run(plan, master, observers, concluded), listening)
    authority = Authority.open(plan.authority)
    identity = authority.master_identity(hosts)
    master = opened(authority, identity)
    authority.observer = master.events.relay
    with _enrolling(authority, identity, plan.place), master:
        listening()
        return _run(plan, master, observers, concluded)


def _refuse_other_hosts(identity: Identity, hosts: Sequence[str]) -> None:
    """Raise `IdentityError` if robots would not accept a standby master at one of `hosts`."""
    if unknown := [host for host in hosts if host not in identity.hosts]:
        if not identity.hosts:
            raise IdentityError(
                f"{identity.name} is not enrolled as a master: choose a name of its own for this master, and enrol it,"
                f" with robochoc authority enrol NAME --role master --host {unknown[0]}"
            )
        known = ", ".join(identity.hosts)
        raise IdentityError(
            f"{identity.name} is certified for {known}, not for {', '.join(unknown)}: enrol it again, with"
            f" robochoc authority enrol {identity.name} --role master --host {unknown[0]}"
        )


def _stand_by(
    plan: MasterPlan,
    standby: StandbyPlan,
    opened: Callable[[Admission, Identity], Master],
    run: Callable[[Master], MasterResult],
    listening: Callable[[], None],
) -> MasterResult:
    """Lead the run as soon as no master with a higher priority leads. Follow a master that returns before the search.

    Raises `RunOverElsewhereError`, `NoLeaderError`, and the errors of `run`.
    """
    with LeaderWatch(standby) as watch:
        while True:
            plan.following()
            watch.wait(plan.gather_s)
            master = opened(watch.admission, standby.identity)
            master.is_superseded = lambda: watch.is_led
            master.takes_over = watch.has_closed
            master.spent_before = watch.spent
            with master:
                listening()
                try:
                    return run(master)
                except SupersededError:
                    continue


@contextmanager
def _enrolling(authority: Authority, identity: Identity, place: Address) -> Iterator[None]:
    """Serve robots that redeem tokens. Raises `RouterError`."""
    with ExitStack() as stack:
        try:
            stack.enter_context(EnrolmentServer(authority, identity, place.host, place.enrolment_port))
        except OSError as error:
            where = place._replace(port=place.enrolment_port)
            why = error.strerror or error
            raise RouterError(f"cannot listen on {where}, where tokens are redeemed: {why}") from error
        yield


def _run(
    plan: MasterPlan,
    master: Master,
    observers: tuple[Observer | None, Audience | None],
    concluded: Callable[[Outcome | None], None],
) -> MasterResult:
    """Run the search after the master has started to listen, and send the outcome to the robots."""
    try:
        led = _solve(plan, master, *observers)
    except SupersededError:
        master.leave("a master with a higher priority leads", failed=True, elsewhere=True)
        raise
    except BaseException as error:
        failure = isinstance(error, RobotsLostError | UnsupportedError | RefutedError | TeamIncompleteError)
        is_final = failure and not isinstance(error, NoMajorityError)
        concluded(None)
        why = f"the run was broken off: {error if failure else 'the master has stopped'}"
        master.leave(why, failed=True, elsewhere=not is_final)
        raise
    concluded(led.outcome)
    master.leave(_in_words(led.outcome))
    return led


def _solve(plan: MasterPlan, master: Master, observer: Observer | None, audience: Audience | None) -> MasterResult:
    """Wait for the team, and run its search."""
    if not master.gather(None if plan.gather_s is None else time.monotonic() + plan.gather_s):
        names = first_names(master.members.waited_for) or "more robots"
        raise TeamIncompleteError(f"the team is not complete after {plan.gather_s:g} s; missing: {names}")
    if master.votes.is_needed and plan.improve is not None:
        raise UnsupportedError(
            "--improve publishes answers before a majority has accepted them: remove it,"
            " or give the robots only one master"
        )
    decided = master.elect()
    if decided is not None:
        return _repeat(plan, master, decided)
    team = registered_team(master, plan.name)
    options = choose_for_private_team(team, plan.options(plan.protocol or AUTO)).options
    if plan.start is not None:
        try:
            options = replace(options, start=start_of_outcome(plan.start, team))
        except OptionError as unfit:
            raise UnsupportedError(str(unfit)) from None
    name, protocol = options.protocol, protocol_or_stage(options.protocol)
    refuse_settings(name, protocol, options.settings)
    refuse_unfit(team, options, protocol.traits)
    if known := _last_values(master, team):
        options = replace(options, start=known)
    machines = Machines(master, options, plan.name, observer, audience)
    if master.absent:
        machines.remove(master.absent)
    header = Outcome(
        Verdict.UNKNOWN,
        team=plan.name,
        protocol=name,
        runtime=Runtime.NETWORK,
        seed=plan.seed,
        symbols=symbol_table(team.robots),
        symbolic=symbolic_variables(team),
        real_places=real_places(team),
        chosen=dict(options.chosen),
    )
    outcome = _led(master, claimed(solve_distributed(machines, protocol, header)))
    bare = replace(outcome, assignment={}, epochs=(), improvements=(), optima=None)
    there = tuple(name for name in master.members.order if name not in outcome.lost)
    master.confirm(TeamDecision(master.run, there, result_json(bare).decode(), _in_words(outcome)))
    return MasterResult(outcome, machines.team_seen())


def _led(master: Master, outcome: Outcome) -> Outcome:
    """Return `outcome` with the master that led, if robots know several masters."""
    return replace(outcome, led_by=master.votes.name, term=master.votes.term) if master.votes.is_needed else outcome


def _last_values(master: Master, team: Team) -> dict[str, int | None]:
    """Return the values that the robots had under the previous master, from which their search begins again."""
    known = set(team.variables)
    values = {name: value for own in master.votes.last_values.values() for name, value in own.items() if name in known}
    return dict(values)


def _repeat(plan: MasterPlan, master: Master, decided: TeamDecision) -> MasterResult:
    """Publish the decision that an earlier master may have published, with the values that the robots have stored."""
    master.confirm(decided)
    values = merged_values(master.votes.decided_values(decided))
    try:
        outcome = read_result(decided.outcome.encode())
    except ResultError as bad:
        raise UnsupportedError(f"robots have stored an invalid decision: {bad}") from None
    lost = tuple(sorted({*outcome.lost, *(name for name in decided.robots if name in master.absent)}))
    outcome = _led(master, replace(outcome, assignment=values, lost=lost))
    return MasterResult(outcome, registered_team(master, plan.name))


def _refuse_early(plan: MasterPlan) -> None:
    """Check the options and settings before any robot registers. Raises `UnsupportedError`."""
    asked = plan.protocol or AUTO
    refuse_options(plan.options(asked), private=plan.conditions.private)
    try:
        name = DEFAULT_PROTOCOL if asked == AUTO else asked
        refuse_settings(name, protocol_or_stage(name), plan.settings)
    except UnsupportedError:
        if asked != AUTO:
            raise
        refuse_settings(DEFAULT_COST_PROTOCOL, protocol_or_stage(DEFAULT_COST_PROTOCOL), plan.settings)


def _in_words(outcome: Outcome) -> str:
    """Return the outcome in a few words, for the robots."""
    withdrawn = f", {len(outcome.withdrawn_alive)} withdraw" if outcome.withdrawn_alive else ""
    claim = f", claimed by {outcome.claimed_by}" if outcome.claimed_by else ""
    return f"{outcome.verdict}{withdrawn}{claim}"
