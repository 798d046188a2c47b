"""A run: a team goes in, an outcome comes out. Everything that solves goes through here."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import assert_never

from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator import Simulation
from robochoc.observers.checker import cost, could_join, objections
from robochoc.observers.events import Began, Observer
from robochoc.outcome import Outcome, Verdict
from robochoc.problem import Kind, Model, Team
from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.registry import protocol_named
from robochoc.solver.compiled import Unsupported, check_supported


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

    `delay` is the longest a message takes, in constraint checks.
    """

    protocol: str = "abt"
    runtime: Runtime = Runtime.PROCESSES
    seed: int = 0
    timeout: float | None = None
    withdraw: Withdrawal | None = None
    schedule: ScheduleName = ScheduleName.CONCURRENT
    delay: int = 0


def solve(
    team: Team,
    options: Options = Options(),
    *,
    observer: Observer | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Outcome:
    """Let `team` solve its problem, and hold its answer against every constraint.

    When the time is over, the verdict is `unknown`. Raises `UnknownProtocol`, `Unsupported`, `RobotsLost`
    (processes), and `Refuted` when the checker does not agree.
    """
    protocol = protocol_named(options.protocol)
    _refuse(team, options.protocol, protocol)
    phase = _Phases(team, options, observer, progress)
    result = phase.play(protocol)
    witness = result.witness
    metrics = result.metrics
    withdrawn: tuple[str, ...] = ()
    if result.verdict is Verdict.NO_SOLUTION and options.withdraw is Withdrawal.MAXIMAL:
        result = phase.play(FirstFit)
        metrics += result.metrics
        withdrawn = tuple(name for name in team.order if not result.assignments[name])
    outcome = Outcome(
        team=team.name,
        protocol=options.protocol,
        runtime=options.runtime,
        seed=options.seed,
        verdict=result.verdict,
        metrics=metrics,
        witness=witness,
    )
    if result.verdict is not Verdict.SOLUTION:
        return outcome
    assignment = {name: value for own in result.assignments.values() for name, value in own.items()}
    _check(team, assignment, withdrawn)
    return replace(outcome, assignment=assignment, cost=cost(team, assignment), withdrawn=withdrawn, verified=True)


class _Phases:
    """Runs of one team, one after the other, within one time limit."""

    def __init__(
        self, team: Team, options: Options, observer: Observer | None, progress: Callable[[Progress], None] | None
    ) -> None:
        self._team = team
        self._options = options
        self._observer = observer
        self._progress = progress
        self._deadline = None if options.timeout is None else time.monotonic() + options.timeout

    def play(self, protocol: type[Protocol]) -> RunResult:
        """One run of `protocol`, in the runtime asked for."""
        left = None if self._deadline is None else max(0.0, self._deadline - time.monotonic())
        if self._observer:
            self._observer(Began(t=0, protocol=protocol.__name__))
        if self._options.runtime is Runtime.PROCESSES:
            from robochoc.communication.processes import ProcessesRun  # noqa: PLC0415 - one runtime is enough

            run = ProcessesRun(self._team, protocol, observer=self._observer, progress=self._progress)
            return run.run(left)
        schedule = _schedule(self._options)
        return Simulation(self._team, protocol, schedule, observer=self._observer, progress=self._progress).run(left)


def _schedule(options: Options) -> Schedule:
    match options.schedule:
        case ScheduleName.CONCURRENT:
            return Concurrent(options.seed, options.delay)
        case ScheduleName.RANDOM:
            return RandomChannels(options.seed)
        case never:
            assert_never(never)


def _refuse(team: Team, name: str, protocol: type[Protocol]) -> None:
    """Say in one sentence what the protocol, or this version, cannot take."""
    if team.dynamic:
        raise Unsupported(f"{team.name} has a scenario.xml; this version does not solve dynamic problems yet")
    if team.kind is Kind.DISWCSP and not protocol.costs:
        raise Unsupported(f"{team.name} is a DisWCSP, and {name} does not minimise costs")
    for robot in team.robots:
        check_supported(robot)
    if not protocol.partially_known:
        for robot in team.robots:
            for constraint in robot.shared:
                if constraint.model is Model.PKC:
                    raise Unsupported(
                        f"{robot.name} shares a partially known constraint (PKC, {constraint.name}), which {name}"
                        " does not support; where privacy allows it, state it as TKC in the child's file"
                    )


def _check(team: Team, assignment: dict[str, int], withdrawn: tuple[str, ...]) -> None:
    """Hold the claim against every constraint of every file."""
    faults = [*objections(team, assignment, withdrawn)]
    faults += [f"{name} has stepped aside and could be added" for name in could_join(team, assignment, withdrawn)]
    if faults:
        raise Refuted(f"the checker refutes the answer for {team.name}: {faults[0]} ({len(faults)} objections)")
