"""Who plays: the robots of each run, made of what they were given then."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from robochoc.communication.host import Host
from robochoc.communication.session import Epoch
from robochoc.journal.events import Given, Lost
from robochoc.journal.given import GivenProblemError, TeamReader, invalidated_of, run_parameters_of
from robochoc.journal.journal import Header
from robochoc.model.change import team_after_events
from robochoc.model.orders import Order, OrderError, compute_order, with_priorities
from robochoc.model.problem import Robot, Team
from robochoc.model.team_edits import ChangeError, keep_interfaces, without_robots
from robochoc.protocols.protocol import DynamicProtocol, Protocol
from robochoc.protocols.settings import SettingsError
from robochoc.replay.steps import RecordedRun
from robochoc.run.registry import UnknownProtocolError, protocol_by_class, protocol_or_first_fit
from robochoc.solver.ace import AceProcess
from robochoc.solver.agent_problem import AgentProblem, RunParameters
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compile import CompileError, Compiler, CompileTimeoutError, Limits
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam
from robochoc.solver.domain import CompiledDomain, TooManySolutionsError
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.failures import SolverLostError, SolverMissingError, SolverTimeoutError
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
"""What stands in the way of robots that have to be compiled, or set, first."""


class CannotReplayError(Exception):
    """The run cannot be played again; says why, and what would help. `broken`: it is the journal's fault."""

    def __init__(self, why: str, *, broken: bool = False) -> None:
        super().__init__(why)
        self.broken = broken


class ReplayOptions(NamedTuple):
    """What a replay may use.

    `team` is the one in the files, for runs whose journals do not say what robots were given; `protocols` are, by
    their classes' names, to be used rather than those that are installed. `settings` are what was set of the protocol,
    where the journal does not say. `limits`, `cache` and `solver` are for
    robots whose private constraints need a solver (`solver/compile.py`).
    """

    team: Team | None = None
    protocols: Mapping[str, type[Protocol]] = MappingProxyType({})
    settings: Mapping[str, str] = MappingProxyType({})
    limits: Limits | None = None
    cache: SolutionCache | None = None
    solver: AceProcess | None = None


class RebuiltRobots(NamedTuple):
    """The robots of one run, ready to begin: the protocol, their hosts, and what each of them knows.

    Those in `mindful` go on with what they found out in the epoch before. `compiled` is what they were made of.
    """

    protocol: type[Protocol]
    hosts: Mapping[str, Host]
    parts: Mapping[str, AgentProblem]
    lossless: bool
    mindful: Collection[str]
    compiled: CompiledTeam


class Rebuilder:
    """Makes the robots of one run after the other; those that go on from one epoch to the next are the same.

    `only` names those that are to play (None: all).
    """

    def __init__(self, header: Header | None, means: ReplayOptions, only: Collection[str] | None = None) -> None:
        self._header = header
        self._means = means
        self._only = only
        self._reader = TeamReader(header.team if header else "")
        self._hosts: dict[str, Host] = {}
        self._before: Mapping[str, CompiledRobot] = {}
        self._lost: set[str] = set()

    def enter(self, run: RecordedRun) -> RebuiltRobots:
        """The robots of `run`. Raises `CannotReplayError`."""
        protocol = self._protocol(run)
        try:
            epoch = self._epoch(run, protocol)
            parts = epoch.parts(protocol)
            goes_on = run.began is not None and isinstance(run.began.epoch, int)
            before = self._hosts if goes_on else {}
            self._hosts = {name: _host(protocol, part, before.get(name), epoch) for name, part in parts.items()}
        except GivenProblemError as why:
            raise CannotReplayError(str(why), broken=True) from why
        except _UNCOMPILED as why:
            raise CannotReplayError(str(why)) from why
        self._lost.update(event.robot for event in run.events if isinstance(event, Lost))
        kept = issubclass(protocol, DynamicProtocol)
        mindful = [name for name in parts if kept and name in before and name not in epoch.restarted]
        lossless = run.given is None or run.given.quiet
        return RebuiltRobots(protocol, self._hosts, parts, lossless, mindful, epoch.compiled)

    def _protocol(self, run: RecordedRun) -> type[Protocol]:
        """The class that the run names; of a master's journal, the header's."""
        asked = self._header.protocol if self._header else None
        if run.began is None:
            return self._named(asked or "")
        name = run.began.protocol
        if name in self._means.protocols:
            return self._means.protocols[name]
        found = protocol_by_class(name, filter(None, [asked]))
        if found is not None:
            return found[1]
        hint = "install the package that it came from (robochoc protocols shows what there is)"
        raise CannotReplayError(f"no protocol whose class is called {name!r} is installed; {hint}")

    @staticmethod
    def _named(name: str) -> type[Protocol]:
        try:
            return protocol_or_first_fit(name)
        except UnknownProtocolError as unknown:
            raise CannotReplayError(str(unknown)) from unknown

    def _epoch(self, run: RecordedRun, protocol: type[Protocol]) -> Epoch:
        if run.given is not None and not (run.given.why and self._means.team):
            return self._as_given(run.given)
        return self._as_filed(run, protocol)

    def _as_given(self, given: Given) -> Epoch:
        compiled = self._compiled(self._reader.team(given))
        return Epoch(compiled, invalidated_of(given), frozenset(given.fresh), run_parameters_of(given))

    def _as_filed(self, run: RecordedRun, protocol: type[Protocol]) -> Epoch:
        """What the files say, for a run whose journal does not; robots that were lost before are left out."""
        if self._means.team is None:
            raise CannotReplayError(
                "the journal does not say what the robots were given, as that of a run across machines;"
                " name the folder with the team's files: --team DIR"
            )
        if run.began is not None and isinstance(run.began.epoch, int):
            raise CannotReplayError("the journal does not say what the robots were given when their problem changed")
        try:
            filed = self._ordered(team_after_events(self._means.team, events=0))
            team = self._left(filed)
        except (OrderError, ChangeError, ValueError) as why:
            raise CannotReplayError(f"the team cannot be brought into the order of the run: {why}") from why
        seed = self._header.seed if self._header else 0
        asked = self._header.protocol if self._header else None
        if asked is None or self._named(asked) is protocol:
            return Epoch(self._compiled(team), parameters=RunParameters(seed, self._means.settings))
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

    def _left(self, team: Team) -> Team:
        """Return `team` without the robots that were lost before. On a network the others show what they did show."""
        left = without_robots(team, [name for name in self._lost if name in team])
        on_network = self._header is not None and self._header.runtime == "network"
        return keep_interfaces(left, team) if on_network else left

    def _compiled(self, team: Team) -> CompiledTeam:
        """Return `team` with those compiled who play; what did not change is not compiled again."""
        means = self._means

        def compile_robot(robot: Robot) -> CompiledDomain:
            known = self._before.get(robot.name)
            return known.domain if known and known.robot == robot else compiler.compile(robot).domain

        with Compiler(means.limits, means.cache, solver=means.solver) as compiler:
            compiled = CompiledTeam(team, compile_robot, self._only)
        self._before = {**self._before, **compiled.robots}
        return compiled


def _host(protocol: type[Protocol], part: AgentProblem, before: Host | None, epoch: Epoch) -> Host:
    """The robot of `part`: the one that was there before, if it goes on, or a new one. Raises `CannotReplayError`."""
    name = part.robot.name
    try:
        if before is None or name in epoch.restarted:
            return Host.of(protocol, part)
        before.change(part, epoch.invalidated)
    except _UNCOMPILED:
        raise
    except Exception as error:  # a protocol that is being written, or a journal that is not what it says
        raise CannotReplayError(f"{name} could not begin: {type(error).__name__}: {error}") from error
    return before
