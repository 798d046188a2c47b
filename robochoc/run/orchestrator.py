"""The run of a team on this machine: check the team, choose a protocol and an order, search, check the answer."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from robochoc.communication.search_result import Progress
from robochoc.formats import check_team, with_checked_events
from robochoc.journal.events import Observer
from robochoc.model.change import team_after_events
from robochoc.model.costs import NormalizationError, normalized
from robochoc.model.orders import OrderError
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.policies import Risk
from robochoc.model.problem import ScenarioEvent, Team
from robochoc.model.sampling import Samples
from robochoc.model.symbols import real_places, symbol_table, symbolic_variables
from robochoc.model.uncertainty import AUTOMATIC, UncertaintyError, is_uncertain, sampled_team
from robochoc.model.worst_case import worst_case
from robochoc.run.choice import ProtocolChoice, choose, choose_without_analysis
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.compatibility.team_rules import CENTRAL_TRAITS, UnfitProtocolError, refuse_unfit
from robochoc.run.context import RunContext
from robochoc.run.defaults import CENTRAL
from robochoc.run.distributed import solve_distributed
from robochoc.run.improvement import Audience
from robochoc.run.options import Options
from robochoc.run.refinement import numbered, refines, solve_on_grids
from robochoc.run.registry import protocol_named
from robochoc.run.scenario import Environment
from robochoc.run.this_machine import ThisMachine
from robochoc.solver.compile import CompileTimeoutError, TeamCompileTimeoutError
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.time_limit import TimeLimitError, computed_by
from robochoc.verification.checker import check_user_cost

if TYPE_CHECKING:
    from robochoc.run.objectives import CombinedRun
    from robochoc.solver.ace import AceProcess


def solve(
    team: Team,
    options: Options = Options(),
    *,
    observer: Observer | None = None,
    progress: Callable[[Progress], None] | None = None,
    solver: AceProcess | None = None,
    environment: Environment | None = None,
    audience: Audience | None = None,
    ordered: bool = True,
) -> Outcome:
    """Let `team` solve its problem, in epochs if the problem changes, and check each answer against every constraint.

    Args:
        team: the team with its scenario.
        options: how to run.
        observer: receives all events.
        progress: receives the number of messages so far, from time to time.
        solver: a running constraint solver. A program that solves many teams saves time by passing the same one.
        environment: receives each epoch's answer, and returns the next change of the problem.
        audience: with `Options.improve`, receives each answer during the search.
        ordered: true if the user chose the priority order of `team`. Otherwise an order is chosen too, for any
            protocol.

    Returns:
        The outcome. Its verdict is `unknown` if a limit was reached before a verdict was known.

    Raises:
        InvalidInputError: when the team, or an event from the environment, is not valid.
        UnknownProtocolError: when the protocol is not installed.
        UnsupportedError: when the options cannot be combined with each other or with the team.
        RobotsLostError: when a robot was lost, and the options do not let the run continue without it.
        CompileError: when the domains cannot be compiled.
        SolverLostError: when the constraint solver has crashed.
        SolverMissingError: when the constraint solver is needed and not installed.
        RefutedError: when the checker, or the central solver, refutes an answer.
    """
    changing = environment is not None
    refuse_options(options, environment=changing)
    run = prepare(team, options, environment=changing, ordered=ordered)
    return run.solve(observer=observer, progress=progress, solver=solver, environment=environment, audience=audience)


@dataclass(frozen=True)
class PreparedRun:
    """A run before its start: a valid team, and options that name a protocol.

    Attributes:
        team: The team with its scenario.
        choice: The options with a protocol and an order, and the reasons for them.
        spent_s: The seconds spent on the choice. They count towards the time of the run.
        uncertain: The team with expected costs, if the problem has random variables.
        samples: The samples of random variables that replace some of the expected costs of `team`.
        combined: The team with several objectives, if `team` is its form with a single cost.
    """

    team: Team
    choice: ProtocolChoice
    spent_s: float
    uncertain: Team | None = None
    samples: Samples = AUTOMATIC
    combined: CombinedRun | None = None

    def solve(
        self,
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        solver: AceProcess | None = None,
        environment: Environment | None = None,
        audience: Audience | None = None,
    ) -> Outcome:
        """Run the search and return its outcome. For the arguments and errors see the function `solve`."""
        environment = environment and with_checked_events(environment)
        if environment is None and not (self.uncertain or self.combined) and refines(self.team, self.choice.options):
            began = time.monotonic() - self.spent_s

            def solve_grid(team: Team, options: Options, number: int, opened_by: str) -> Outcome:
                spent_s = time.monotonic() - began
                own = numbered(observer, number, opened_by)
                context = RunContext(options, own, progress, solver, spent_s, proves_reals=True)
                return _solved(team, context, None, audience)

            return solve_on_grids(self.team, self.choice.options, solve_grid)
        context = RunContext(self.choice.options, observer, progress, solver, self.spent_s)
        added: list[ScenarioEvent] = []
        outcome = _solved(self.team, context, environment and _noting(environment, added), audience)
        if self.uncertain and outcome.assignment and not outcome.epochs:
            from robochoc.verification.policies import policy_report  # noqa: PLC0415 - start-up: rarely needed

            report = policy_report(self.uncertain, outcome, self.choice.options.risk, self.samples)
            return replace(outcome, uncertainty=report)
        return outcome if self.combined is None else self.combined.after(added).outcome(outcome)


def _noting(environment: Environment, added: list[ScenarioEvent]) -> Environment:
    """Return `environment`, which appends its events to `added`."""

    def noting(team: Team, ended: EpochOutcome, left_s: float | None) -> ScenarioEvent | None:
        event = environment(team, ended, left_s)
        if event is not None:
            added.append(event)
        return event

    return noting


def prepare(team: Team, options: Options, *, environment: bool = False, ordered: bool = True) -> PreparedRun:
    """Check the team, and choose the protocol and the order if `options` do not specify them.

    Args:
        team: The team with its scenario.
        options: How to run. They must have passed `refuse_options`.
        environment: True if an environment changes the problem.
        ordered: True if the user chose the priority order of `team`. Otherwise an order is chosen too, for any
            protocol.

    Raises:
        InvalidInputError: if the team is not valid.
        UnsupportedError: if the options cannot be combined with the objectives of the team.
    """
    check_team(team)
    uncertain = team if is_uncertain(team) else None
    began = time.monotonic()
    if options.risk == Risk.WORST:
        team = _worst_case(team)
        if (
            options.withdraw is not None or options.survives_losses or environment
        ):  # a table ends with any of its robots
            what = "robots cannot withdraw, be lost or leave during a run"
            raise UnsupportedError(f"with --risk worst, {what}: use --risk expected")
    samples = AUTOMATIC
    if options.samples is not None:
        samples = Samples(options.samples, options.seed, options.samples)
        team = _sampled(team, samples, environment=environment)
    run = None
    if team.objectives or options.objectives is not None:
        from robochoc.run.objectives import combined_run  # noqa: PLC0415 - start-up: rarely needed

        run = combined_run(team, options, environment=environment)
        if run is not None:
            team, options = run.team, run.options
    deadline = None if options.limit_s is None else began + options.limit_s
    try:
        choice = computed_by(deadline, choose, team, options, environment=environment, ordered=ordered)
    except TimeLimitError:
        choice = choose_without_analysis(team, options)
    return PreparedRun(team, choice, time.monotonic() - began, uncertain, samples, run)


def _worst_case(team: Team) -> Team:
    """Return the team whose costs are those of the worst scenario. Raises `UnsupportedError`."""
    if not is_uncertain(team) or team.scenario or any(robot.objectives for robot in team.robots):
        uncertain = "has a scenario.xml" if team.scenario else "has several objectives"
        what = uncertain if is_uncertain(team) else "has no random variables"
        raise UnsupportedError(f"{team.name} {what}, so that the worst case cannot be minimised: use --risk expected")
    try:
        return worst_case(team)
    except UncertaintyError as refused:
        raise UnsupportedError(str(refused)) from None


def _sampled(team: Team, samples: Samples, *, environment: bool) -> Team:
    """Return the team whose costs are averages of samples. Raises `UnsupportedError`."""
    if not is_uncertain(team) or environment:
        what = "is changed during the run" if is_uncertain(team) else "has no random variables"
        raise UnsupportedError(f"{team.name} {what}, so that --samples cannot be used: remove --samples")
    try:
        return sampled_team(team, samples)
    except UncertaintyError as refused:
        raise UnsupportedError(str(refused)) from None


def _solved(team: Team, context: RunContext, environment: Environment | None, audience: Audience | None) -> Outcome:
    """Run the search for `team` on the present grids of its real variables, and return its outcome."""
    try:
        counted = normalized(team)
        if context.options.protocol == CENTRAL:
            outcome = _solve_centrally(counted, context)
        else:
            outcome = _solve_distributed(counted, context, environment, audience)
    except (OrderError, NormalizationError) as refused:
        raise UnsupportedError(str(refused)) from None
    if counted is not team and environment is None:
        _check_costs(team, outcome)
    return outcome


def _check_costs(team: Team, outcome: Outcome) -> None:
    """Check the costs of answers in the user's units, up to the first loss, after which the files differ from the team.

    Raises:
        RefutedError: if a cost is wrong.
    """
    if not outcome.epochs and not outcome.lost:
        check_user_cost(team, outcome.assignment, outcome.cost, without=outcome.withdrawn)
    for events, epoch in enumerate(outcome.epochs):
        if epoch.lost:
            return
        check_user_cost(team_after_events(team, events), epoch.assignment, epoch.cost)


def _solve_centrally(team: Team, context: RunContext) -> Outcome:
    """Let the central solver solve the problem. See `run/central.py`."""
    refuse_unfit(team, context.options, CENTRAL_TRAITS)
    from robochoc.run.central import solve_centrally  # noqa: PLC0415 - start-up: rarely needed

    return solve_centrally(team, context, _header(team, context.options))


def _solve_distributed(
    team: Team, context: RunContext, environment: Environment | None, audience: Audience | None
) -> Outcome:
    """Let the robots solve their problem together. See `run/distributed.py`."""
    options = context.options
    protocol = protocol_named(options.protocol)
    refuse_settings(options.protocol, protocol, options.settings)
    try:
        refuse_unfit(team, options, protocol.traits)
    except UnfitProtocolError as unfit:
        raise UnsupportedError(f"{unfit}{_alternatives(team, options, complete=unfit.complete)}") from None
    if options.channel is not None:
        from robochoc.run.compatibility.channel_rules import refuse_channel  # noqa: PLC0415 - start-up: rarely needed

        refuse_channel(team, options)
    header = _header(team, options)
    if options.standby:
        with_standbys: Callable[[Team, RunContext, Outcome], Outcome]
        with_standbys = resolve_name("robochoc.run.networked.local_standbys:solve_with_standbys")
        return with_standbys(team, context, header)
    deployment = ThisMachine(team, context, environment, audience)
    try:
        outcome = solve_distributed(deployment, protocol, header)
    except TooLargeError as refused:
        others = _alternatives(team, options, complete=True, costs=True, narrow=protocol.traits.wide_tables)
        raise UnsupportedError(f"{refused}{others}") from None
    except (TooManySolutionsError, CompileTimeoutError, TeamCompileTimeoutError) as limit:
        outcome = deployment.outcome(header, deployment.limit_reached(str(limit)))
    context.kills.warn_of_pending()
    return outcome


def _alternatives(team: Team, options: Options, *, complete: bool, costs: bool = False, narrow: bool = False) -> str:
    """Return the alternatives. See `run/alternatives.py`."""
    from robochoc.run.alternatives import alternatives  # noqa: PLC0415 - start-up: only refusals need it

    return alternatives(team, options, complete=complete, costs=costs, narrow=narrow)


def _header(team: Team, options: Options) -> Outcome:
    """Return an outcome that describes the run, without an answer."""
    return Outcome(
        team=team.name,
        protocol=options.protocol,
        runtime=options.runtime,
        seed=options.seed,
        verdict=Verdict.UNKNOWN,
        order="listed" if isinstance(options.order, tuple) else options.order,
        chosen=dict(options.chosen),
        channel=options.channel.name if options.channel else None,
        symbols=symbol_table(team.robots),
        symbolic=symbolic_variables(team),
        real_places=real_places(team),
    )
