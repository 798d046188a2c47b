"""A run: a team goes in, an outcome comes out. Everything that solves goes through here."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TypedDict, assert_never

from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator import Simulation
from robochoc.observers.checker import cost, could_join, has_local_solution, objections
from robochoc.observers.events import Began, Observer
from robochoc.outcome import Metrics, Outcome, Verdict
from robochoc.problem import Kind, Model, Team
from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.registry import protocol_named
from robochoc.solver.ace import AceProcess, SolverTimeout
from robochoc.solver.cache import SolutionCache
from robochoc.solver.central import Judge
from robochoc.solver.compile import Compilation, Compiler, CompileTimeout, Limits, Source
from robochoc.solver.domain import CompiledDomain, TooManySolutions
from robochoc.solver.encoding import Unsupported

PAIR = 2
CENTRAL = "central"
"""The protocol that is none: one model of all files, which ACE decides."""


class Runtime(StrEnum):
    """Where robots live: each in its own OS process, or all in one thread."""

    PROCESSES = "processes"
    SIMULATOR = "simulator"


class ScheduleName(StrEnum):
    """How the simulator orders events: by time counted in checks, or any channel next."""

    CONCURRENT = "concurrent"
    RANDOM = "random"


class Withdrawal(StrEnum):
    """Who steps aside when the whole team has no solution: whoever finds no place, in priority order."""

    MAXIMAL = "maximal"


class Refuted(Exception):  # noqa: N818 - named for what happened to the claim
    """The checker refutes what the protocol claims: a fault of the protocol, or ours."""


@dataclass(frozen=True)
class Options:
    """How to run. `timeout` is in seconds of wall-clock time; `seed`, `schedule` and `delay` are the simulator's.

    `delay` is the longest a message takes, in constraint checks. `local` limits the compilation of each robot's
    domain; `cache` says whether solutions of local problems are kept in the user's cache folder. `count` is for the
    central judge: the number of all solutions. `verify` asks for a second opinion on a `no-solution`.
    """

    protocol: str = "abt"
    runtime: Runtime = Runtime.PROCESSES
    seed: int = 0
    timeout: float | None = None
    withdraw: Withdrawal | None = None
    schedule: ScheduleName = ScheduleName.CONCURRENT
    delay: int = 0
    local: Limits = field(default_factory=Limits)
    cache: bool = True
    count: bool = False
    verify: bool = False


def solve(
    team: Team,
    options: Options = Options(),
    *,
    observer: Observer | None = None,
    progress: Callable[[Progress], None] | None = None,
    solver: AceProcess | None = None,
) -> Outcome:
    """Let `team` solve its problem, and hold its answer against every constraint.

    Who solves many teams may lend a `solver` that stays warm between them. When a limit is reached, the verdict is
    `unknown`. Raises `UnknownProtocol`, `Unsupported`, `RobotsLost` (processes), `CompileFailed` and `SolverLost`
    (the constraint solver), `SolverMissing`, and `Refuted` when a second opinion does not agree.
    """
    run = _Run(team, options, observer, progress, solver)
    outcome = run.centrally() if options.protocol == CENTRAL else run.distributed()
    if outcome.verdict is Verdict.SOLUTION and outcome.count is None:
        _check(team, outcome.assignment, outcome.withdrawn)
        return replace(outcome, cost=cost(team, outcome.assignment), verified=True)
    if options.verify and outcome.verdict is Verdict.NO_SOLUTION and options.protocol != CENTRAL:
        return run.second_opinion(outcome)
    return outcome


class _TimeOver(Exception):  # noqa: N818 - a limit that was reached
    """The time for everything was over before the robots could start."""


class _Run:
    """One team, one set of options, one time limit for all that has to be done."""

    def __init__(
        self,
        team: Team,
        options: Options,
        observer: Observer | None,
        progress: Callable[[Progress], None] | None,
        solver: AceProcess | None,
    ) -> None:
        self._team = team
        self._solver = solver
        self._options = options
        self._observer = observer
        self._progress = progress
        self._began = time.monotonic()
        self._deadline = None if options.timeout is None else self._began + options.timeout
        self._cache = SolutionCache() if options.cache else None
        self._outcome = Outcome(
            team=team.name,
            protocol=options.protocol,
            runtime=options.runtime,
            seed=options.seed,
            verdict=Verdict.UNKNOWN,
        )

    def distributed(self) -> Outcome:
        """The robots compile their domains, then the protocol runs; robots step aside if they are to."""
        protocol = protocol_named(self._options.protocol)
        name = self._options.protocol
        _refuse(self._team, name, protocol.traits)
        try:
            compiled = self._compile()
        except (TooManySolutions, CompileTimeout, _TimeOver) as limit:
            return replace(self._outcome, reason=str(limit), metrics=Metrics(compile_s=time.monotonic() - self._began))
        compile_s = time.monotonic() - self._began if any(c.source is not Source.DIRECT for c in compiled) else 0.0
        outcome = replace(self._outcome, metrics=Metrics(compile_s=compile_s))
        domains = {one.robot: one.domain for one in compiled}
        alone = next((name for name, domain in domains.items() if not domain.values), None)
        if alone is None:
            outcome = _after(outcome, self._play(protocol, domains))
        else:
            outcome = replace(
                outcome,
                verdict=Verdict.NO_SOLUTION,
                witness=alone,
                reason=f"{alone} alone has none: its private constraints leave it no local solution",
            )
        if outcome.verdict is Verdict.NO_SOLUTION and self._options.withdraw is Withdrawal.MAXIMAL:
            outcome = self._withdrawn(outcome, self._play(FirstFit, domains))
        return outcome

    def _withdrawn(self, outcome: Outcome, result: RunResult) -> Outcome:
        placed = replace(_after(outcome, result), witness=outcome.witness)
        if result.verdict is not Verdict.SOLUTION:
            return placed
        return replace(placed, withdrawn=tuple(name for name in self._team.order if not result.assignments[name]))

    def centrally(self, *, count: bool | None = None) -> Outcome:
        """One model of all files, decided by ACE."""
        count = self._options.count if count is None else count
        _refuse(self._team, CENTRAL, Traits(partially_known=True))
        judge = Judge(self._cache, self._deadline, lambda: self._show("ACE decides the whole team"), self._solver)
        judgement = judge.judge(self._team, count=count)
        return replace(
            self._outcome,
            runtime=CENTRAL,
            verdict=judgement.verdict,
            assignment=judgement.assignment,
            count=judgement.count,
            verified=False,
            metrics=Metrics(wall_s=time.monotonic() - self._began),
        )

    def second_opinion(self, outcome: Outcome) -> Outcome:
        """Let the central judge decide what the robots have found to have no solution.

        A robot that had none alone is looked at by the checker as well, as judge and compiler share their encoding.
        Raises `Refuted` when one of them finds a solution.
        """
        opinion = self.centrally(count=False)
        alone = [robot for robot in self._team.robots if robot.name == outcome.witness and outcome.reason]
        if opinion.verdict is Verdict.SOLUTION or any(has_local_solution(robot) for robot in alone):
            raise Refuted(f"{outcome.protocol} says that {self._team.name} has no solution, and a judge has found one")
        return replace(outcome, verified=opinion.verdict is Verdict.NO_SOLUTION)

    def _compile(self) -> list[Compilation]:
        """All robots' domains; up to the first that is empty, if that decides the matter."""
        compiled = []
        robots = self._team.robots
        with Compiler(self._options.local, self._cache, self._deadline, self._solver) as compiler:
            for number, robot in enumerate(robots, 1):
                self._show(f"compiling {robot.name} ({number} of {len(robots)})")
                try:
                    compiled.append(compiler.compile(robot))
                except SolverTimeout:
                    raise _TimeOver(f"the time (--timeout) was over while {robot.name} was compiled") from None
                if not compiled[-1].domain.values and self._options.withdraw is None:
                    break
        return compiled

    def _play(self, protocol: type[Protocol], domains: Mapping[str, CompiledDomain]) -> RunResult:
        """One run of `protocol`, in the runtime asked for."""
        left = None if self._deadline is None else max(0.0, self._deadline - time.monotonic())
        if self._observer:
            self._observer(Began(t=0, protocol=protocol.__name__))
        watchers: _Watchers = {"observer": self._observer, "progress": self._progress}
        if self._options.runtime is Runtime.PROCESSES:
            from robochoc.communication.processes import ProcessesRun  # noqa: PLC0415 - one runtime is enough

            return ProcessesRun(self._team, protocol, domains=domains, **watchers).run(left)
        return Simulation(self._team, protocol, _schedule(self._options), domains=domains, **watchers).run(left)

    def _show(self, stage: str) -> None:
        if self._progress:
            self._progress(Progress(0, time.monotonic() - self._began, stage))


class _Watchers(TypedDict):
    observer: Observer | None
    progress: Callable[[Progress], None] | None


def _after(outcome: Outcome, result: RunResult) -> Outcome:
    """`outcome`, with what a run has come to; a solution's values are of all robots that have one."""
    found = result.verdict is Verdict.SOLUTION
    assignment = {name: value for own in result.assignments.values() for name, value in own.items()} if found else {}
    return replace(
        outcome,
        verdict=result.verdict,
        witness=result.witness,
        metrics=outcome.metrics + result.metrics,
        assignment=assignment,
    )


def _schedule(options: Options) -> Schedule:
    match options.schedule:
        case ScheduleName.CONCURRENT:
            return Concurrent(options.seed, options.delay)
        case ScheduleName.RANDOM:
            return RandomChannels(options.seed)
        case never:
            assert_never(never)


def _refuse(team: Team, name: str, traits: Traits) -> None:
    """Say in one sentence what the protocol, or this version, cannot take."""
    if team.dynamic:
        raise Unsupported(f"{team.name} has a scenario.xml; this version does not solve dynamic problems yet")
    if team.kind is Kind.DISWCSP and not traits.costs:
        raise Unsupported(f"{team.name} is a DisWCSP, and {name} does not minimise costs")
    for robot in team.robots:
        for constraint in robot.shared:
            if constraint.model is Model.PKC and not traits.partially_known:
                raise Unsupported(
                    f"{robot.name} shares a partially known constraint (PKC, {constraint.name}), which {name}"
                    " does not support; where privacy allows it, state it as TKC in the child's file"
                )
            if not traits.n_ary and len({team.owner[variable] for variable in constraint.variables}) > PAIR:
                raise Unsupported(
                    f"{robot.name} holds a constraint over more than two robots ({constraint.name}), which {name}"
                    " does not support; see 'robochoc protocols'"
                )


def _check(team: Team, assignment: dict[str, int], withdrawn: tuple[str, ...]) -> None:
    """Hold the claim against every constraint of every file."""
    faults = [*objections(team, assignment, withdrawn)]
    faults += [f"{name} has stepped aside and could be added" for name in could_join(team, assignment, withdrawn)]
    if faults:
        raise Refuted(f"the checker refutes the answer for {team.name}: {faults[0]} ({len(faults)} objections)")
