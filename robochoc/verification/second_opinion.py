"""The second opinion: the central solver checks the robots' proofs of `no-solution` or of a minimum cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.solver.central import CentralAnswer, TeamSolver
from robochoc.verification.checker import RefutedError, assignment_cost, has_local_solution


def confirmed(
    solvers: Sequence[TeamSolver],
    team: Team,
    protocol: str,
    alone: str | None = None,
    *,
    total: float = INFINITE,
    withdrawal_cost: int | None = None,
) -> tuple[str, ...]:
    """Return the names of the central solvers that agree with a protocol.

    Args:
        solvers: the central solvers, the first of which has to be there.
        team: the team as its files have it.
        protocol: the protocol's name.
        alone: a robot that has no local solution. The checker looks at it as well, as the central solver and the
            compiler of domains share their encoding.
        total: the minimum cost that is claimed, withdrawal costs included; infinite: that there is no solution.
        withdrawal_cost: the withdrawal cost of a robot of weight 1 (None: no robot may withdraw).

    Returns:
        The solvers that agree; a solver that did not finish does not count.

    Raises:
        RefutedError: when one has found something else.
    """
    agreeing = []
    for solver in solvers:
        opinion = solver.solve(team, withdrawal_cost=withdrawal_cost)
        against = contradiction(opinion, total)
        if against or (alone is not None and has_local_solution(team[alone])):
            claim = "no solution" if total == INFINITE else f"a solution of the least cost, {total:,}"
            found = f"{team.name} has {claim}, and {solver.name} has found {against or 'one'}"
            raise RefutedError(f"{protocol} says that {found}")
        if opinion.verdict != Verdict.UNKNOWN:
            agreeing.append(solver.name)
    return tuple(agreeing)


def contradiction(opinion: CentralAnswer, total: float) -> str | None:
    """Return the central solver's objection to a claim; None if it agrees, or did not finish.

    `total` is the minimum cost that is claimed, withdrawal costs included; infinite: that there is no solution.
    """
    if opinion.verdict == Verdict.NO_SOLUTION:
        return None if total == INFINITE else "none"
    if total == INFINITE:
        return "one" if opinion.verdict != Verdict.UNKNOWN or opinion.assignment else None
    if opinion.bound is not None and opinion.bound > total:
        return f"that nothing costs less than {opinion.bound:,}"
    if opinion.cost is not None and opinion.cost < total:
        return f"one that costs {opinion.cost:,}"
    return None


def total_cost(team: Team, assignment: Mapping[str, int], withdrawal_cost: float | None) -> float:
    """Return the cost of `assignment`, and the robots without values, at a withdrawal cost for one of weight 1."""
    withdrawn = (robot for robot in team.robots if robot.variables[0].name not in assignment)
    return assignment_cost(team, assignment) + (withdrawal_cost or 0) * sum(robot.weight for robot in withdrawn)
