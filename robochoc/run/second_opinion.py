"""What the central judge has to say: as the answer itself, or as the second opinion on what robots have proven."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.run.incumbent import absent
from robochoc.run.options import Options, Withdrawal
from robochoc.solver.central import CentralSolver, Judgement
from robochoc.solver.failures import SolverLostError
from robochoc.verification.checker import RefutedError, assignment_cost, has_local_solution


def decided(judge: CentralSolver, team: Team, options: Options, aside: int) -> EpochOutcome:
    """What `judge` makes of `team`, with the fewest robots aside if that is asked for and has to be.

    `aside` is the price at which a robot of weight 1 steps aside. Raises as `Judge.judge` does, and `SolverLostError`
    when an answer does not cost what the solver says.
    """
    price = None
    judgement = None
    if options.withdraw is not Withdrawal.FEWEST or team.kind is ProblemKind.DISCSP:
        judgement = judge.judge(team)
    if judgement is None or (options.withdraw is not None and judgement.verdict is Verdict.NO_SOLUTION):
        price = aside
        judgement = judge.judge(team, aside=price)
    return _told(judgement, team, price)


def confirmed(
    judge: CentralSolver,
    team: Team,
    protocol: str,
    alone: str | None = None,
    *,
    total: float = INFINITE,
    aside: int | None = None,
) -> bool:
    """Return whether `judge` agrees with `protocol`: the least cost is `total`, or (infinite) there is no solution.

    A robot that had none `alone` is looked at by the checker as well, as judge and compiler share their encoding.
    Raises `RefutedError` when one of them finds something else.
    """
    opinion = judge.judge(team, aside=aside)
    against = contradiction(opinion, total)
    if against or (alone is not None and has_local_solution(team[alone])):
        claim = "no solution" if total == INFINITE else f"a solution of the least cost, {total:,}"
        found = f"{team.name} has {claim}, and a judge has found {against or 'one'}"
        raise RefutedError(f"{protocol} says that {found}")
    return opinion.verdict is not Verdict.UNKNOWN


def contradiction(opinion: Judgement, total: float) -> str | None:
    """What the judge has found against a claim; None where it agrees, or has not come to an end.

    `total` is what is claimed to be the least cost, what stepping aside costs included; infinite: there is no
    solution.
    """
    if opinion.verdict is Verdict.NO_SOLUTION:
        return None if total == INFINITE else "none"
    if total == INFINITE:
        return "one" if opinion.verdict is not Verdict.UNKNOWN or opinion.assignment else None
    if opinion.bound is not None and opinion.bound > total:
        return f"that nothing costs less than {opinion.bound:,}"
    if opinion.cost is not None and opinion.cost < total:
        return f"one that costs {opinion.cost:,}"
    return None


def total_cost(team: Team, assignment: Mapping[str, int], aside: float | None) -> float:
    """What `assignment` costs, and those who have stepped aside, one of weight 1 at the price `aside`."""
    return assignment_cost(team, assignment) + (aside or 0) * sum(
        team[name].weight for name in absent(team, assignment)
    )


def _told(judgement: Judgement, team: Team, aside: int | None) -> EpochOutcome:
    verdict, assignment, bound = judgement.verdict, judgement.assignment, None
    if judgement.cost is not None:
        total = total_cost(team, assignment, aside)
        if total != judgement.cost:
            raise SolverLostError(f"the constraint solver's answer costs {total:,}, and it says {judgement.cost:,}")
    if verdict is Verdict.UNKNOWN and judgement.bound is not None:
        bound = judgement.bound // (aside or 1)
    if verdict is Verdict.OPTIMAL and team.kind is ProblemKind.DISCSP and not absent(team, assignment):
        verdict = Verdict.SOLUTION
    answered = judgement.cost is not None or verdict is Verdict.SOLUTION
    paid = assignment_cost(team, assignment) if answered else None
    return EpochOutcome(verdict, team.order, assignment=assignment, cost=paid, bound=bound, verified=answered)
