"""The assignment from which a search begins: its values, and its cost, which bounds the search.

Every robot receives its own start value, and begins with it if its protocol can. If the start assignment is a solution,
robots of protocols with the trait `upper_bound` also receive its cost, and search for lower costs only. If they find
none, the start assignment is optimal (`run/evaluation.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from robochoc.model.problem import INFINITE, Team
from robochoc.solver.agent_problem import StartValues
from robochoc.verification.objective import Objective


class Start(NamedTuple):
    """The start of a search.

    Attributes:
        values: The start values that are known, by variable. None: the variable's robot withdraws.
        cost: The cost of the start assignment in normalised costs, including withdrawal costs. None: some values are
            missing or not possible, or the assignment violates a hard constraint.
    """

    values: StartValues
    cost: float | None = None


def start_in(team: Team, values: StartValues, withdrawal_cost: float | None = None) -> Start:
    """Return the start of a search with those of the `values` that are possible in `team`.

    Args:
        team: The team, with normalised costs.
        values: The values by variable. Unknown variables are ignored.
        withdrawal_cost: The withdrawal cost of a robot of weight 1 (None: no robot may withdraw).
    """
    possible = {name: values[name] for name in team.variables if name in values and _is_possible(team, name, values)}
    own = robots_values(team, possible)
    if own is None:
        return Start(possible)
    objective = Objective(team, withdrawal_cost)
    objective.change(own)
    return Start(possible, None if objective.cost == INFINITE else objective.cost)


def robots_values(team: Team, values: StartValues) -> dict[str, dict[str, int]] | None:
    """Return the start values by robot, without those of withdrawn robots; None if some values are missing."""
    own: dict[str, dict[str, int]] = {}
    for robot in team.robots:
        given = [(one.name, values[one.name]) for one in robot.variables if one.name in values]
        known = {name: value for name, value in given if value is not None}
        if len(given) < len(robot.variables) or (known and len(known) < len(given)):
            return None
        own[robot.name] = known
    return own


def _is_possible(team: Team, name: str, values: Mapping[str, int | None]) -> bool:
    value = values[name]
    return value is None or value in team.variables[name].domain
