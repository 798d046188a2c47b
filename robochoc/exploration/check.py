"""Checks a protocol on small teams: every order of deliveries, up to a number of states."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, suppress
from functools import partial
from typing import NamedTuple

from robochoc.exploration.changes import Course, FaultPlan, with_events
from robochoc.exploration.explanation import explanation_of
from robochoc.exploration.random_runs import play_random_runs
from robochoc.exploration.stage import NotCreatedError, Stage
from robochoc.exploration.state_graph import StateGraph, TooManyPacketsError
from robochoc.exploration.team_state import Exploration
from robochoc.generators.draws import seeded
from robochoc.model.costs import normalized
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.run.alternatives import refuse_team
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.options import Options
from robochoc.run.phases import RunPhase, first_phase
from robochoc.solver.compile import NoLocalSolutionError
from robochoc.solver.compiled_team import CompiledTeam, ensure_compiled
from robochoc.solver.errors import UnsupportedError
from robochoc.system.compiled_core import PURE, kind_of_core
from robochoc.system.parallel_map import ParallelMap
from robochoc.system.plain_text import counted
from robochoc.system.stopping import stop_requested
from robochoc.verification.objective import withdrawal_cost

_FEWEST_RANDOM_STEPS = 1000


class CheckOptions(NamedTuple):
    """The options of a check.

    Attributes:
        protocol: The class of the protocol.
        run: The options of the run: the protocol's name, its settings, the seed. Other options are not used.
        states: The maximum number of states per team.
        packets: True to deliver also several waiting messages at once.
        losses: The maximum number of lost messages.
        plan: The maximum numbers of robots that crash, and of events.
        random_steps: The maximum number of steps of random runs, if not all states were explored. None: a tenth of
            `states`, because such steps are rarely known yet and take much longer, but at least 1,000, if this
            many states are allowed.
    """

    protocol: type[Protocol]
    run: Options
    states: int = 100_000
    packets: bool = False
    losses: int = 0
    plan: FaultPlan = FaultPlan()
    random_steps: int | None = None


class Case(NamedTuple):
    """A team that is checked: compiled, with the phase of its run."""

    compiled: CompiledTeam
    phase: RunPhase


def case_of(team: Team, protocol: type[Protocol], options: Options) -> Case:
    """Return the case of `team`.

    Raises:
        UnsupportedError: if the protocol does not accept the team.
        NoLocalSolutionError: if a robot has no value.
    """
    refuse_settings(options.protocol, protocol, options.settings)
    refuse_team(team, options, protocol.traits)
    counted_team = normalized(team)
    phase = first_phase(options, protocol, partial(withdrawal_cost, counted_team))
    return Case(ensure_compiled(counted_team), phase)


def explore(case: Case, options: CheckOptions, is_over: Callable[[int], bool] = lambda _: False) -> Exploration:
    """Explore every order of deliveries in the run of a team.

    Args:
        case: The team.
        options: How to check.
        is_over: Asked from time to time, with the number of states so far, whether to stop.

    Raises:
        UnsupportedError: with the compiled core.
    """
    try:
        return _explored(graph_of(case, options), case, options, is_over)
    except NotCreatedError as fault:
        return Exploration(fault=str(fault))


def _explored(graph: StateGraph, case: Case, options: CheckOptions, is_over: Callable[[int], bool]) -> Exploration:
    found = graph.explore(options.states, is_over)
    endless = graph.endless_run() if found.is_cyclic and case.phase.traits.complete else None
    if endless is not None:
        found.fault, (found.path, found.cycle) = ENDLESS, endless
    if not (found.is_complete or found.fault):
        few = min(options.states, max(_FEWEST_RANDOM_STEPS, options.states // 10))
        steps = few if options.random_steps is None else options.random_steps
        with suppress(TooManyPacketsError):
            play_random_runs(graph, found, seeded(options.run.seed), steps, is_over)
    if found.fault:
        found.explanation = explanation_of(found, graph)
    return found


def graph_of(case: Case, options: CheckOptions) -> StateGraph:
    """Return the states of a team, none of which is explored yet.

    Raises:
        UnsupportedError: with the compiled core.
    """
    if kind_of_core() != PURE:
        raise UnsupportedError("compiled protocols cannot be copied; set the environment variable ROBOCHOC_PURE to 1")
    course = Course(case.compiled.team, case.phase, options.plan)
    return StateGraph(Stage.first_of(course), packets=options.packets, losses=options.losses)


ENDLESS = (
    "the robots may continue forever, although every message arrives, and the protocol claims to end on every problem"
)


class CheckedTeam(NamedTuple):
    """A team with what was explored. `team` is in the form of the files."""

    team: Team
    case: Case
    exploration: Exploration

    @property
    def in_words(self) -> str:
        """The result as a sentence."""
        found = self.exploration
        if found.fault:
            return f"after {counted(len(found.path), 'step')}: {found.fault}" if found.path else found.fault
        if not found.is_complete:
            runs = f", nor in {counted(found.random_runs, 'random run')}" if found.random_runs else ""
            return f"no fault so far{runs}; not all states were explored"
        return "no fault in any order of deliveries"

    @property
    def steps_in_words(self) -> str:
        """The deliveries that lead to the fault, one on each line."""
        return "\n".join(f"{number}. {step}" for number, step in enumerate(self.exploration.explanation.steps, 1))

    @property
    def report(self) -> str:
        """The result of a faulty team: one line, the deliveries, and the explanation in lines of 100 characters."""
        explanation = textwrap.fill(self.exploration.explanation.text, 100, break_on_hyphens=False)
        return "\n".join(filter(None, [self.in_words, self.steps_in_words, explanation]))

    def as_dict(self) -> dict[str, object]:
        """Return the numbers and the fault, for JSON."""
        found = self.exploration
        return {
            "team": self.team.name,
            "robots": len(self.team.robots),
            "states": found.states,
            "steps": found.steps,
            "ends": found.ends,
            "local_states": found.local_states,
            "complete": found.is_complete,
            "cyclic": found.is_cyclic,
            "random_runs": found.random_runs,
            "fault": found.fault or None,
            "explanation": found.explanation.text or None,
            "path": [delivery.as_dict() for delivery in found.path],
            "cycle": [delivery.as_dict() for delivery in found.cycle],
        }


Explored = Generator[tuple[tuple[Team, Case], Exploration], None, None]
"""Teams with what was explored, in the order of the teams."""


def checked(
    teams: Iterable[Team],
    options: CheckOptions,
    deadline: float | None = None,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    show: Callable[[int, int], None] | None = None,
    notice: Callable[[str], object] | None = None,
) -> Generator[CheckedTeam, None, None]:
    """Yield each of `teams` with what was explored, up to the `deadline` on the monotonic clock.

    Teams with a robot that has no value are skipped: there is no search. After the deadline, nothing is explored.

    Args:
        teams: The teams.
        options: How to check.
        deadline: The end of the time, on the monotonic clock. None: no limit.
        jobs: The number of teams that are explored at the same time, each in its own process. Results and their order
            do not depend on it.
        cluster: The scheduler of a Dask cluster whose workers explore the teams: see `cluster_client.connect`. None:
            processes of this machine do.
        show: Called from time to time with the number of explored teams, and of the states so far.
        notice: Called with a text if the cluster has no workers yet.

    Raises:
        UnsupportedError: if the protocol does not accept a team, or does not tolerate lost messages, crashes or events.
        ChildDiedError: if a process was killed.
        ClusterLostError: if the cluster cannot be reached or is lost, or a team has killed several of its workers.
    """
    _refuse_untolerated(options)

    def is_over() -> bool:
        return stop_requested() or (deadline is not None and time.monotonic() > deadline)

    cases = cases_of(teams, options)
    if cluster is None:
        results = _explored_here(cases, options, jobs, is_over, show)
    else:
        from robochoc.exploration.cluster import explored_on_cluster  # noqa: PLC0415 - an extra

        results = explored_on_cluster(cluster, cases, options, is_over, show, notice)
    with closing(results):
        for (team, case), exploration in results:
            yield CheckedTeam(team, case, exploration)


def _explored_here(
    cases: Iterable[tuple[Team, Case]],
    options: CheckOptions,
    jobs: int,
    is_over: Callable[[], bool],
    show: Callable[[int, int], None] | None,
) -> Explored:
    """Explore the teams in processes of this machine."""

    def explored(item: tuple[Team, Case], report: Callable[[int], None]) -> Exploration:
        def is_over_now(states: int) -> bool:
            report(states)
            return is_over()

        return explore(item[1], options, is_over_now)

    with ParallelMap(explored, jobs, show) as processes:
        yield from processes.results(cases)


def _refuse_untolerated(options: CheckOptions) -> None:
    """Raise `UnsupportedError` for faults that the protocol does not claim to tolerate."""
    name, traits = options.run.protocol, options.protocol.traits
    if options.losses and not traits.bears_loss:
        raise UnsupportedError(f"{name} does not tolerate lost messages: check it without losses")
    if any(options.plan) and not traits.dynamic:
        raise UnsupportedError(
            f"{name} does not continue after a crash or an event, it starts again: check it without them"
        )
    if any(options.plan) and options.losses:
        raise UnsupportedError("lost messages cannot be combined with crashes and events: check them one by one")


def cases_of(teams: Iterable[Team], options: CheckOptions) -> Iterator[tuple[Team, Case]]:
    """Yield each of `teams` with its case, unless a robot has no value."""
    for team in teams:
        if stop_requested():
            return
        team = with_events(team, options.plan.events)  # noqa: PLW2901
        with suppress(NoLocalSolutionError):
            yield team, case_of(team, options.protocol, options.run)
