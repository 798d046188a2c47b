"""Rebuilds the robots of each recorded run from their recorded problems."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from robochoc.communication.host import Host
from robochoc.communication.session import Epoch
from robochoc.journal.events import AnyEvent, Given, Lost
from robochoc.journal.journal import Header
from robochoc.journal.team_events import GivenProblemError, TeamReader, invalidated_of, run_parameters_of, with_start
from robochoc.model.change import team_after_events
from robochoc.model.costs import normalized
from robochoc.model.orders import Order, OrderError, compute_order, with_priorities
from robochoc.model.problem import Robot, Team
from robochoc.model.team_edits import ChangeError, keep_interfaces, without_robots
from robochoc.protocols.dynamic import DynamicProtocol
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import SettingsError
from robochoc.replay.steps import RecordedRun
from robochoc.run.registry import UnknownProtocolError, protocol_by_class, protocol_or_stage
from robochoc.solver.ace import AceProcess
from robochoc.solver.agent_problem import AgentProblem, AgentProblems, RunParameters
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compile import CompileError, CompileLimits, Compiler, CompileTimeoutError
from robochoc.solver.compiled_domain import CompiledDomain, TooManySolutionsError
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam
from robochoc.solver.errors import SolverLostError, SolverMissingError, SolverTimeoutError, UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.verification.objective import withdrawal_cost

_UNCOMPILED = (
    TooManySolutionsError,
    CompileTimeoutError,
    CompileError,
    SolverMissingError,
    SolverLostError,
    SolverTimeoutError,
    UnsupportedError,
    SettingsError,
)
"""Raised for robots that cannot be compiled, or whose settings are invalid."""


class CannotReplayError(RobochocError):
    """A run cannot be replayed; contains the reason and a hint. `broken`: the journal is damaged."""

    def __init__(self, why: str, *, broken: bool = False) -> None:
        super().__init__(why)
        self.broken = broken


class ReplayOptions(NamedTuple):
    """Inputs to a replay besides the journal.

    Attributes:
        team: The team from its files, for journals without the robots' problems.
        protocols: Protocols by their class names, to be used instead of the installed ones.
        settings: The settings of the protocol, if the journal does not record them.
        limits: Limits for robots whose private constraints need a solver (`solver/compile.py`).
        cache: The cache of solutions for these robots.
        solver: The process of the solver.
    """

    team: Team | None = None
    protocols: Mapping[str, type[Protocol]] = MappingProxyType({})
    settings: Mapping[str, str] = MappingProxyType({})
    limits: CompileLimits | None = None
    cache: SolutionCache | None = None
    solver: AceProcess | None = None


class RebuiltRobots(NamedTuple):
    """The robots of one run, ready to start.

    Attributes:
        protocol: The protocol of the robots.
        hosts: The hosts of the robots, by robot name.
        parts: Each robot's part of the problem.
        lossless: True if no message of the previous epoch was lost.
        continuing: Robots that continue with their results from the previous epoch.
        compiled: The compiled team of the robots.
    """

    protocol: type[Protocol]
    hosts: Mapping[str, Host]
    parts: Mapping[str, AgentProblem]
    lossless: bool
    continuing: Collection[str]
    compiled: CompiledTeam


def reads_files(events: Iterable[AnyEvent]) -> bool:
    """Return whether a journal with these `events` lacks the robots' problems, so that the team's files are needed."""
    given = [event for event in events if isinstance(event, Given)]
    return not given or any(one.why for one in given)


class RecordedTeams:
    """The teams in a journal's `Given` events, for several rebuilders of the journal: each team is read once."""

    def __init__(self, header: Header | None) -> None:
        self._reader = TeamReader(header.team if header else "")
        self._teams: dict[int, tuple[Given, Team]] = {}
        self._problems: dict[tuple[int, bool, bool], AgentProblems] = {}

    def team(self, given: Given) -> Team:
        """Return the team after `given`. Each rebuilder requests the events in order. Raises `GivenProblemError`."""
        if (found := self._teams.get(id(given))) is None:
            found = self._teams[id(given)] = given, self._reader.team(given)  # keeps the event, and thus its id
        return found[1]

    def parts(self, epoch: Epoch, given: Given, protocol: type[Protocol]) -> dict[str, AgentProblem]:
        """Return each compiled robot's part of the problem in `epoch`, which is the epoch of `given`."""
        traits = protocol.traits
        key = id(given), traits.shared_scopes, traits.tree
        if (problems := self._problems.get(key)) is None:
            problems = self._problems[key] = AgentProblems(
                epoch.team, epoch.parameters, shared_scopes=traits.shared_scopes, tree=traits.tree
            )
        return {name: problems.problem(own) for name, own in epoch.compiled.robots.items()}


class Rebuilder:
    """Creates the robots of each run in turn. Robots that continue into an epoch remain the same objects.

    `only` names the robots to create; None for all. `teams`: shared by the rebuilders of one journal. Raises
    `CannotReplayError` for a run in which messages may be lost.
    """

    def __init__(
        self,
        header: Header | None,
        options: ReplayOptions,
        only: Collection[str] | None = None,
        teams: RecordedTeams | None = None,
    ) -> None:
        if header is not None and header.message_loss:
            raise CannotReplayError("messages were lost (--message-loss), and journals do not record which")
        self._header = header
        self._options = options
        self._only = only
        self._teams = teams
        self._reader = TeamReader(header.team if header else "")
        self._hosts: dict[type[Protocol], dict[str, Host]] = {}
        """The hosts of each protocol's last run: before an epoch, there may be a run of another protocol."""
        self._before: Mapping[str, CompiledRobot] = {}
        self._lost: set[str] = set()

    def robots_of(self, run: RecordedRun) -> RebuiltRobots:
        """Return the robots of `run`. Raises `CannotReplayError`."""
        protocol = self._protocol(run)
        try:
            epoch = self._epoch(run, protocol)
            parts = self._parts(run, epoch, protocol)
            continues = run.began is not None and isinstance(run.began.epoch, int)
            before = self._hosts.get(protocol, {}) if continues else {}
            hosts = {name: _host(protocol, part, before.get(name), epoch) for name, part in parts.items()}
            self._hosts[protocol] = hosts
        except GivenProblemError as why:
            raise CannotReplayError(str(why), broken=True) from why
        except _UNCOMPILED as why:
            raise CannotReplayError(str(why)) from why
        self._lost.update(event.robot for event in run.events if isinstance(event, Lost))
        kept = issubclass(protocol, DynamicProtocol)
        continuing = [name for name in parts if kept and name in before and name not in epoch.restarted]
        lossless = run.given is None or run.given.quiet
        return RebuiltRobots(protocol, hosts, parts, lossless, continuing, epoch.compiled)

    def _protocol(self, run: RecordedRun) -> type[Protocol]:
        """Return the protocol of the run; in a master's journal, the protocol in the header."""
        asked = self._header.protocol if self._header else None
        if run.began is None:
            return self._named(asked or "")
        name = run.began.protocol
        if name in self._options.protocols:
            return self._options.protocols[name]
        found = protocol_by_class(name, filter(None, [asked]))
        if found is not None:
            return found[1]
        hint = "install its package (robochoc protocols lists the installed ones)"
        raise CannotReplayError(f"no protocol with the class {name!r} is installed; {hint}")

    @staticmethod
    def _named(name: str) -> type[Protocol]:
        try:
            return protocol_or_stage(name)
        except UnknownProtocolError as unknown:
            raise CannotReplayError(str(unknown)) from unknown

    def _epoch(self, run: RecordedRun, protocol: type[Protocol]) -> Epoch:
        given = self._given(run)
        epoch = self._from_files(run, protocol) if given is None else self._from_event(given)
        return epoch._replace(parameters=with_start(epoch.parameters, run.began))

    def _given(self, run: RecordedRun) -> Given | None:
        """Return the event with the robots' problems; None if the team's files are used instead."""
        return None if run.given is not None and run.given.why and self._options.team else run.given

    def _parts(self, run: RecordedRun, epoch: Epoch, protocol: type[Protocol]) -> dict[str, AgentProblem]:
        given = self._given(run)
        return (
            epoch.parts(protocol) if self._teams is None or given is None else self._teams.parts(epoch, given, protocol)
        )

    def _from_event(self, given: Given) -> Epoch:
        compiled = self._compiled((self._teams or self._reader).team(given))
        return Epoch(compiled, invalidated_of(given), frozenset(given.fresh), run_parameters_of(given))

    def _from_files(self, run: RecordedRun, protocol: type[Protocol]) -> Epoch:
        """Return the epoch of the team in the files, without the robots lost earlier."""
        if self._options.team is None:
            raise CannotReplayError(
                "the journal lacks the robots' problems, as in a run across machines;"
                " give the folder of the team's files: --team DIR"
            )
        if run.began is not None and isinstance(run.began.epoch, int):
            raise CannotReplayError("the journal lacks the robots' problems after the change")
        try:
            filed = self._ordered(team_after_events(normalized(self._options.team), events=0))
            team = self._without_lost(filed)
        except (OrderError, ChangeError, ValueError) as why:
            raise CannotReplayError(f"the team cannot be brought into the order of the run: {why}") from why
        seed = self._header.seed if self._header else 0
        asked = self._header.protocol if self._header else None
        if asked is None or self._named(asked) is protocol:
            return Epoch(self._compiled(team), parameters=RunParameters(seed, self._options.settings))
        there = [robot for robot in filed.robots if run.given is not None or robot.name in team]
        aside = withdrawal_cost(replace(filed, robots=tuple(there))) if protocol.traits.costs else None
        return Epoch(self._compiled(team), parameters=RunParameters(seed, withdrawal_cost=aside))

    def _ordered(self, team: Team) -> Team:
        """Return `team` in the order of the run. Raises `OrderError`, `ValueError`."""
        order = self._header.order if self._header else None
        if isinstance(order, str):
            order = compute_order(team, Order(order), self._header.seed if self._header else 0)
        if isinstance(order, tuple):
            return with_priorities(team, order)
        return team

    def _without_lost(self, team: Team) -> Team:
        """Return `team` without the robots lost earlier. Across machines, the other robots keep their interfaces."""
        on_network = self._header is not None and self._header.runtime == "network"
        left = without_robots(team, self._lost, with_files=on_network)
        return keep_interfaces(left, team) if on_network else left

    def _compiled(self, team: Team) -> CompiledTeam:
        """Return `team` with the participating robots compiled; unchanged parts are reused."""
        options = self._options

        def compile_robot(robot: Robot) -> CompiledDomain:
            known = self._before.get(robot.name)
            return known.domain if known and known.robot == robot else compiler.compile(robot).domain

        with Compiler(options.limits, options.cache, solver=options.solver) as compiler:
            compiled = CompiledTeam(team, compile_robot, self._only)
        self._before = {**self._before, **compiled.robots}
        return compiled


def _host(protocol: type[Protocol], part: AgentProblem, before: Host | None, epoch: Epoch) -> Host:
    """Return the host from the previous epoch if it continues, or a new host. Raises `CannotReplayError`."""
    name = part.robot.name
    try:
        if before is None or name in epoch.restarted:
            return Host.create(protocol, part)
        before.change(part, epoch.invalidated)
    except _UNCOMPILED:
        raise
    except Exception as error:  # a protocol under development, or an altered journal
        raise CannotReplayError(f"{name} could not start: {type(error).__name__}: {error}") from error
    return before
