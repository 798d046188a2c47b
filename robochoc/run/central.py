"""A run without robots: the central solver solves a single model, merged from all files, epoch by epoch."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

from robochoc.model.change import describe_change, team_after_events
from robochoc.model.cost_units import Cost
from robochoc.model.costs import user_cost
from robochoc.model.outcome import Metrics, Outcome, Verdict
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.model.team_edits import dropped_constraints
from robochoc.run.context import RunContext
from robochoc.run.defaults import CENTRAL
from robochoc.run.evaluation import PhaseAnswer, check_assignment
from robochoc.run.options import Options, Withdrawal
from robochoc.solver.central import CentralAnswer, TeamSolver
from robochoc.solver.errors import SolverLostError
from robochoc.verification.absence_reason import absence_reason
from robochoc.verification.checker import assignment_cost, robots_without_values
from robochoc.verification.objective import withdrawal_cost
from robochoc.verification.second_opinion import confirmed, total_cost


class _Decision(NamedTuple):
    """The decision of the central solver for one epoch, and the number of solutions if the options require it."""

    answer: PhaseAnswer
    solutions: int | None = None


def solve_centrally(team: Team, context: RunContext, header: Outcome) -> Outcome:
    """Return the outcome of a run in which the central solver decides the problem of every epoch.

    Args:
        team: The team with its scenario.
        context: The options, the time and the solver of the run.
        header: An outcome that describes the run, without an answer.

    Raises:
        RefutedError: if the checker refutes an answer of the solver.
        SolverLostError: if the computed cost of an answer differs from the cost that the solver reports.
    """
    from robochoc.solver.ace import AceProcess  # noqa: PLC0415 - start-up: robots need it seldom

    options = context.options
    last = len(team.scenario)
    with AceProcess(always=options.local.always_ace) as warm:
        solver = context.deciding_solver(warm)
        decisions = [_decide(solver, team_after_events(team, number), context) for number in range(last + 1)]
    answer, solutions = decisions[-1]
    epochs = tuple(
        _shown(decision.answer, team, context).as_epoch(team_after_events(team, number).order, _opened_by(team, number))
        for number, decision in enumerate(decisions)
    )
    spent = sum((epoch.metrics for epoch in epochs), Metrics())
    answer = replace(answer, metrics=spent, epochs=epochs if team.dynamic else ())
    answer = _shown(answer, team, context)
    return replace(answer.as_outcome(header, ()), runtime=CENTRAL, count=solutions)


def _shown(answer: PhaseAnswer, team: Team, context: RunContext) -> PhaseAnswer:
    return answer.for_whole_problem(context.searched(team))


def _opened_by(team: Team, number: int) -> str:
    """Return the cause of epoch `number`, in a few words."""
    if not number:
        return "the start"
    return ", ".join(describe_change(change, team) for change in team.scenario[number - 1].changes) or "nothing"


def _decide(solver: TeamSolver, team: Team, context: RunContext) -> _Decision:
    """Decide one epoch, and check the answer."""
    began = time.monotonic()
    options = context.options
    solutions = None
    if options.count:
        found = solver.solve(team, count=True)
        answer, solutions = PhaseAnswer(found.verdict, solved_by=found.solvers), found.count
    else:
        answer = _answer(solver, team, options)
    if answer.verified:
        check_assignment(team, answer.assignment, answer.withdrawn, maximal=answer.verdict != Verdict.UNKNOWN)
    if options.verify:
        answer = _confirmed(context, team, answer)
    return _Decision(replace(answer, metrics=Metrics(wall_s=time.monotonic() - began)), solutions)


def _confirmed(context: RunContext, team: Team, answer: PhaseAnswer) -> PhaseAnswer:
    """Return the answer, confirmed by a solver that has not found it, if it is a proof."""
    if answer.verdict not in {Verdict.NO_SOLUTION, Verdict.OPTIMAL}:
        return answer
    options = context.options
    price = int(withdrawal_cost(team)) if options.withdraw is not None and answer.withdrawn else None
    if options.withdraw is not None and answer.verdict == Verdict.NO_SOLUTION:
        price = int(withdrawal_cost(team))
    total = INFINITE if answer.verdict == Verdict.NO_SOLUTION else total_cost(team, answer.assignment, price)
    solver = context.solver_without(answer.solved_by)
    names = confirmed([solver], team, CENTRAL, total=total, withdrawal_cost=price)
    return answer.confirmed_as(names) if names else answer


def _answer(solver: TeamSolver, team: Team, options: Options) -> PhaseAnswer:
    """Return the solver's answer. If no solution exists and the options allow it, a minimum of robots withdraw."""
    price = None
    found = None
    if options.withdraw != Withdrawal.MINIMUM or team.kind == ProblemKind.DISCSP:
        found = solver.solve(team)
    if found is None or (options.withdraw is not None and found.verdict == Verdict.NO_SOLUTION):
        price = int(withdrawal_cost(team))
        found = solver.solve(team, withdrawal_cost=price)
    return _answer_of(found, team, price, options)


def _answer_of(found: CentralAnswer, team: Team, price: int | None, options: Options) -> PhaseAnswer:
    """Convert a result of the central solver to the answer of a phase.

    `price` is the withdrawal cost of a robot of weight 1 (None: no robot may withdraw).
    """
    verdict, assignment = found.verdict, found.assignment
    bound: Cost | None = None
    if found.cost is not None:
        total = total_cost(team, assignment, price)
        if total != found.cost:
            raise SolverLostError(
                f"the constraint solver reports a cost of {found.cost:,}, but its answer costs {total:,}"
            )
    if verdict == Verdict.UNKNOWN and found.bound is not None:
        bound = user_cost(team, found.bound) if price is None else found.bound // price
    if verdict == Verdict.OPTIMAL and team.kind == ProblemKind.DISCSP and not robots_without_values(team, assignment):
        verdict = Verdict.SOLUTION
    has_answer = found.cost is not None or verdict == Verdict.SOLUTION
    withdrawn = robots_without_values(team, assignment) if has_answer and options.withdraw else ()
    paid = user_cost(team, assignment_cost(team, assignment), without=withdrawn) if has_answer else None
    is_impossible = verdict == Verdict.NO_SOLUTION
    return PhaseAnswer(
        verdict,
        reason=absence_reason(team, withdrawal=price is not None) or None if is_impossible else None,
        assignment=assignment,
        cost=paid,
        withdrawn=withdrawn,
        bound=bound,
        verified=has_answer,
        solved_by=found.solvers,
        dropped_constraints=dropped_constraints(team, withdrawn) if has_answer else (),
    )
