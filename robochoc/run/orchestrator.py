"""A run on this machine: a team goes in, an outcome comes out."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from robochoc.communication.run_result import Progress
from robochoc.formats import check_team, with_checked_events
from robochoc.journal.events import Observer
from robochoc.model.change import team_after_events
from robochoc.model.costs import UnboundedCostError, normalized
from robochoc.model.orders import OrderError
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.model.symbols import symbol_table, symbolic_variables
from robochoc.run.choice import decided, decided_at_once
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.team_rules import CENTRAL_TRAITS, UnfitProtocolError, refuse_unfit
from robochoc.run.context import RunContext
from robochoc.run.distributed import solve_distributed
from robochoc.run.improvement import Audience
from robochoc.run.options import CENTRAL, Options
from robochoc.run.protocol_settings import refuse_settings
from robochoc.run.registry import protocol_named
from robochoc.run.scenario import Environment
from robochoc.run.this_machine import ThisMachine
from robochoc.solver.compile import CompileTimeoutError, TeamCompileTimeoutError
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.time_limit import TimeLimitError, computed_by
from robochoc.verification.checker import check_told_cost

if TYPE_CHECKING:
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
    """Let `team` solve its problem, epoch by epoch if it changes, and check each answer against every constraint.

    Args:
        team: the team with its scenario.
        options: how to run.
        observer: gets all events.
        progress: gets the number of messages so far, now and then.
        solver: a constraint solver that is running already: a program that solves many teams saves time with it.
        environment: gets each epoch's answer, and returns the next change of the problem.
        audience: with `Options.improve`, gets each answer while the search goes on.
        ordered: whether the priority order of `team` is meant. Otherwise one is chosen for any protocol.

    Returns:
        The outcome. When a limit was reached, its verdict is `unknown`.

    Raises:
        InvalidInputError: when the team is not valid, or an event of the environment.
        UnknownProtocolError: when the protocol is not installed.
        UnsupportedError: when the options do not go together, or with the team.
        RobotsLostError: when a robot was lost, and the run is not to go on without it.
        CompileError: when the domains cannot be compiled.
        SolverLostError: when the constraint solver has failed.
        SolverMissingError: when it is needed and not installed.
        RefutedError: when the checker, or the central solver, refutes an answer.
    """
    check_team(team)
    environment = environment and with_checked_events(environment)
    refuse_options(options, environment=environment is not None)
    context = RunContext(options, observer, progress, solver)
    try:
        changing = environment is not None
        choice = computed_by(context.deadline, decided, team, options, environment=changing, ordered=ordered)
    except TimeLimitError:
        choice = decided_at_once(team, options)
    context.options = options = choice.options
    try:
        counted = normalized(team)
        if options.protocol == CENTRAL:
            outcome = _solve_centrally(counted, context)
        else:
            outcome = _solve_distributed(counted, context, environment, audience)
    except (OrderError, UnboundedCostError) as refused:
        raise UnsupportedError(str(refused)) from None
    if counted is not team and environment is None:
        _check_told_costs(team, outcome)
    return outcome


def _check_told_costs(team: Team, outcome: Outcome) -> None:
    """Check what answers cost, in the user's numbers. After losses the files no longer say what an epoch's team is.

    Raises:
        RefutedError: when a cost is another.
    """
    if not outcome.epochs:
        check_told_cost(team, outcome.assignment, outcome.cost, without=outcome.withdrawn)
        return
    for events, epoch in enumerate(outcome.epochs):
        if epoch.lost:
            return
        check_told_cost(team_after_events(team, events), epoch.assignment, epoch.cost)


def _solve_centrally(team: Team, context: RunContext) -> Outcome:
    """Let the central solver decide. See `run/central.py`."""
    refuse_unfit(team, context.options, CENTRAL_TRAITS)
    from robochoc.run.central import solve_centrally  # noqa: PLC0415 - start-up: seldom asked for

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
        from robochoc.run.radio import refuse_channel  # noqa: PLC0415 - start-up: seldom asked for

        refuse_channel(team, options)
    deployment = ThisMachine(team, context, environment, audience)
    header = _header(team, options)
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
    """Return an outcome that says what is run, and nothing else yet."""
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
    )
