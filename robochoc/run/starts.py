"""The assignment from which a search begins: its values, and its cost, which bounds the search.

Every robot receives its own start value, and begins with it if its protocol can. If the start assignment is a solution,
robots of protocols with the trait `upper_bound` also receive its cost, and search for lower costs only. If they find
none, the start assignment is optimal (`run/evaluation.py`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from robochoc.model.outcome import Outcome
from robochoc.model.problem import INFINITE, Domain, Team
from robochoc.solver.agent_problem import StartValues
from robochoc.system.errors import OptionError
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


def start_of_outcome(outcome: Outcome, team: Team, names: Mapping[str, str] = MappingProxyType({})) -> StartValues:
    """Return the assignment in an earlier outcome as start values for `team`.

    Variables that are not in the team any more, and values that are not possible any more, are omitted.

    Args:
        outcome: The earlier outcome.
        team: The team.
        names: The original names of robots and variables, by their names in the team.

    Raises:
        OptionError: if the team has none of the variables.
    """
    called = {names.get(name, name): name for name in team.variables}
    withdrawn = {*outcome.withdrawn}
    found: dict[str, int | None] = {
        name: None for name, robot in team.owner.items() if withdrawn & {robot, names.get(robot, robot)}
    }
    known = {called.get(name, name): value for name, value in outcome.labelled(outcome.assignment).items()}
    if known and not any(name in team.variables for name in known):
        raise OptionError(f"start: {outcome.team} has none of the variables of {team.name}, such as {min(known)}")
    for name, value in known.items():
        code = code_of(value, team.variables[name].domain) if name in team.variables else None
        if code is not None:
            found[name] = code
    return found


def code_of(value: object, domain: Domain) -> int | None:
    """Return the integer for a number, or the name of a symbol, in `domain`; None if `domain` does not contain it.

    A real number may be anywhere in the interval of `domain`.
    """
    if domain.real:
        return domain.real.steps(value) if isinstance(value, int | float) and math.isfinite(value) else None
    if domain.symbols:
        value = domain.symbols.index(value) if value in domain.symbols else None
    return value if isinstance(value, int) and value in domain else None


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
