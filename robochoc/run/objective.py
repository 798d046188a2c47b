"""What an observer of a run weighs the robots' decisions by."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.model.costs import normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.options import Options, Withdrawal
from robochoc.verification.objective import Objective, withdrawal_cost


def objective_to_record(team: Team, options: Options) -> Callable[[], Objective] | None:
    """Return what makes the objective of a run. None where nothing is minimised, or the problem changes."""
    minimum = options.withdraw is Withdrawal.MINIMUM
    if team.dynamic or not (minimum or team.kind is ProblemKind.DISWCSP):
        return None
    counted = normalized(team)
    return lambda: Objective(counted, withdrawal_cost(counted) if minimum else None)
