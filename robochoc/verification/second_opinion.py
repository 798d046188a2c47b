"""The second opinion: the central solver checks the robots' proofs of `no-solution` or of a minimum cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.model.outcome import CENTRAL_SOLVER, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.solver.central import ACE, ENUMERATION, CentralAnswer, TeamSolver
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
    """Return the names of the central solvers that agree with the result of a protocol.

    Args:
        solvers: The central solvers. The first one is required.
        team: The team as in its files.
        protocol: The protocol's name.
        alone: A robot that has no local solution. This is also verified by the checker, because the central solver and
            the compiler of domains share their encoding.
        total: The claimed minimum cost, including withdrawal costs; infinite if the claim is that there is no solution.
        withdrawal_cost: The withdrawal cost of a robot of weight 1 (None: no robot may withdraw).

    Returns:
        The solvers that agree. Solvers that did not finish are omitted.

    Raises:
        RefutedError: if a solver has found a different result.
    """
    agreeing: dict[str, None] = {}
    for solver in solvers:
        if solver.name in agreeing:
            continue
        opinion = solver.solve(team, withdrawal_cost=withdrawal_cost)
        against = contradiction(opinion, total)
        if against or (alone is not None and has_local_solution(team[alone])):
            claim = "no solution" if total == INFINITE else f"a solution of the least cost, {total:,}"
            name = " and ".join(_names(solver, opinion))
            found = f"{team.name} has {claim}, but {name} has found {against or 'one'}"
            raise RefutedError(f"{protocol} claims that {found}")
        if opinion.verdict != Verdict.UNKNOWN:
            agreeing |= dict.fromkeys(_names(solver, opinion))
    return tuple(agreeing)


def _names(solver: TeamSolver, opinion: CentralAnswer) -> tuple[str, ...]:
    """Return the solvers that found `opinion`: the central solver, instead of ACE and enumeration, and the others."""
    names = [name for name in opinion.solvers if name not in {ACE, ENUMERATION}]
    return (*([CENTRAL_SOLVER] if len(names) < len(opinion.solvers) else []), *names) or (solver.name,)


def contradiction(opinion: CentralAnswer, total: float) -> str | None:
    """Return the central solver's objection to a claim; None if it agrees, or did not finish.

    `total` is the claimed minimum cost, including withdrawal costs; infinite if the claim is that there is no solution.
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
    """Return the cost of `assignment` and of withdrawing the robots without values."""
    withdrawn = (robot for robot in team.robots if robot.variables[0].name not in assignment)
    return assignment_cost(team, assignment) + (withdrawal_cost or 0) * sum(robot.weight for robot in withdrawn)
