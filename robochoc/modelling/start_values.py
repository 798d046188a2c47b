"""The argument `start` of `solve`: conversion of an assignment in the user's values to start values of robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.modelling.numbers import whole_number
from robochoc.modelling.solution import Solution
from robochoc.modelling.terms import ModelVariable
from robochoc.run.starts import code_of, start_of_outcome
from robochoc.solver.agent_problem import StartValues
from robochoc.system.errors import OptionError, OptionTypeError
from robochoc.system.plain_text import listed
from robochoc.system.suggestions import did_you_mean

_EXPECTED = "expected a mapping of variables to values, or an earlier solution"


def start_values(
    given: object,
    team: Team,
    names: Mapping[str, str],
    variables: Mapping[str, ModelVariable],
    team_name: Callable[[Any], Any],
) -> StartValues:
    """Return the start values in the argument `start`.

    Args:
        given: An assignment of some or all variables, an earlier outcome, or None.
        team: The team that solves the problem.
        names: The original names of robots and variables, by their names in the team.
        variables: The variables of a model, by name.
        team_name: Returns the name in the team of a variable, or of its original name.

    Raises:
        OptionError: if a variable is unknown, or cannot have its value. Values in an earlier outcome that are no longer
            possible are omitted.
        OptionTypeError: if `given` is not an assignment.
    """
    if given is None:
        return {}
    if isinstance(given, Outcome) and not (isinstance(given, Solution) and variables):
        return start_of_outcome(given, team, names)
    if not isinstance(given, Mapping):
        raise OptionTypeError(f"start={given!r} is not allowed; {_EXPECTED}")
    known = team.variables
    found: dict[str, int | None] = {}
    if isinstance(given, Solution):
        found |= {name: None for name in known if team.owner[name] in given.withdrawn}
    for key, value in (given.values if isinstance(given, Solution) else given).items():
        name = key.name if isinstance(key, ModelVariable) else team_name(key)
        code = None
        if name in known:
            code = _code(team, name, value, variables)
        elif not isinstance(given, Solution):
            raise OptionError(f"start: there is no variable {name!r}; {did_you_mean(name, known, 'check the name')}")
        if code is not None:
            found[name] = code
        elif not isinstance(given, Solution):
            raise OptionError(f"start: {name} cannot be {value!r}; {_possible(team, name, variables)}")
    return found


def _code(team: Team, name: str, value: object, variables: Mapping[str, ModelVariable]) -> int | None:
    """Return the integer for a user's value of the variable `name`; None if it is not possible."""
    if name in variables:
        code, domain = variables[name].codes.code(value), team.variables[name].domain
        return code if code is not None and (domain.real or code in domain) else None
    whole = whole_number(value)
    return code_of(value if whole is None else whole, team.variables[name].domain)


def _possible(team: Team, name: str, variables: Mapping[str, ModelVariable]) -> str:
    """Return the values of the variable `name` in words."""
    domain = team.variables[name].domain
    if domain.real:
        low, high = map(domain.label, (domain.real.low, domain.real.high))
        return f"its values are the multiples of {10**-domain.real.places} from {low} to {high}"
    values = [variables[name].codes.value(one) if name in variables else domain.label(one) for one in domain]
    return f"its values are {listed([repr(one) for one in values]) or 'none'}"
