"""Checks the answer of a run from an opened file, whose claims are untrusted.

The claim that no better answer, or no answer at all, exists is not checked: that would require another run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from robochoc.app.flights.flight_map import changed_to
from robochoc.app.runs.prepared_team import value_of
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Checked, Run
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.sketch import Value
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError, read_team
from robochoc.model.change import team_after_events
from robochoc.model.problem import INFINITE, Team
from robochoc.modelling.errors import ModelError
from robochoc.verification.checker import RefutedError, check_user_cost, constraint_cost, objective_costs

CHECK_S = 5.0
"""The time limit in seconds for checking all constraints, after which the answer counts as unchecked."""
_UNREADABLE = (ModelError, InvalidInputError, OSError, ValueError, TypeError, LookupError, ArithmeticError)


def claim_words(run: Run, claims: str) -> str:
    """Return the description of a run. For a run from an opened file, add that it is the file's claim, and the check.

    Args:
        run: The run.
        claims: The result in words.
    """
    if not run.record.opened or run.result is None:
        return claims
    return f"{say('opened.says', claims=claims)} {' '.join(_check_words(run, run.result))}"


def _check_words(run: Run, result: RunResult) -> list[str]:
    checked = run.record.checked
    if checked is None:
        return [say("opened.unchecked")]
    if checked != Checked.KEPT:
        return [say(f"opened.{checked}")]
    number = "" if result.cost is None else "-worth" if run.record.maximised else "-cost"
    proves = result.verdict == "optimal" or result.bound is not None
    return [say(f"opened.kept{number}"), *([say("opened.unproven")] if proves else [])]


def check(run: Run) -> None:
    """Check the answer of a run from an opened file, and write the finding into the run's record."""
    record, result = run.record, run.read_result()
    record.checked, record.maximised = None, False
    with suppress(*_UNREADABLE):
        drawn = bool(run.sketch.decisions)
        team, code = _team_of_sketch(run, result) if drawn else _team_of_files(run, result)
        record.maximised = not drawn and any(robot.costs.maximize for robot in team.robots)
        if result is not None and result.assignment:
            record.checked = _checked_points(team, code, result)


_Code = Callable[[str, Value], int | None]
"""Returns the code of a variable's value, or None for an invalid value."""


def _team_of_sketch(run: Run, result: RunResult | None) -> tuple[Team, _Code]:
    """Return the final team in a run of a sketch, and a function that encodes the user's values."""
    changed = changed_to(run) if result is not None and len(result.epochs) > 1 else None
    sketch = run.sketch if changed is None else changed
    if errors_of(sketch):
        raise ValueError("the sketch has errors")
    model = model_of(sketch)
    team, codes = model.team, dict[str, dict[Value, int]]()
    for decision in sketch.decisions:
        names = [f"{robot}.{decision.name}" for robot in sketch.deciders(decision)]
        if names:  # all robots with a decision have the same values
            own = {value_of(model, names[0], code): code for code in team.variables[names[0]].domain}
            codes |= dict.fromkeys(names, own)
    return team, lambda name, value: codes.get(name, {}).get(value)


def _team_of_files(run: Run, result: RunResult | None) -> tuple[Team, _Code]:
    """Return the final team in a run of files, and a function that encodes the values in the files."""
    events = max(0, len(result.epochs) - 1) if result is not None else 0
    team = team_after_events(read_team(run.team), events)
    named = {name for name, variable in team.variables.items() if variable.domain.symbols}
    symbols = next((variable.domain.symbols for variable in team.variables.values() if variable.domain.symbols), ())
    codes: dict[Value, int] = {symbol: code for code, symbol in enumerate(symbols)}

    def code(name: str, value: Value) -> int | None:
        if name in named:
            return codes.get(value)
        return value if isinstance(value, int) else None

    return team, code


def _checked_points(team: Team, code: _Code, result: RunResult) -> Checked | None:
    """Check an answer, or each point of a Pareto front, or return None if the time limit was reached."""
    until = time.monotonic() + CHECK_S
    for place in range(max(1, len(result.front))):
        found = _checked(team, code, result.at_point(place)) if time.monotonic() <= until else None
        if found != Checked.KEPT:
            return found
    return Checked.KEPT


def _checked(team: Team, code: _Code, result: RunResult) -> Checked | None:
    """Check an answer for a team, or return None if the time limit was reached."""
    aside = frozenset(result.withdrawn)
    flying = {name: one.domain for name, one in team.variables.items() if team.owner[name] not in aside}
    values = {name: known for name, value in result.values.items() if (known := code(name, value)) is not None}
    if values.keys() != flying.keys() or len(values) != len(result.assignment):
        return Checked.BROKEN
    if not all(values[name] in domain for name, domain in flying.items()):
        return Checked.BROKEN
    until = time.monotonic() + CHECK_S
    for constraint in team.constraints():
        if time.monotonic() > until:
            return None
        known = all(name in values for name in constraint.variables)
        if known and constraint_cost(constraint, values) == INFINITE:
            return Checked.BROKEN
    return Checked.KEPT if _is_cost_correct(team, values, result, aside) else Checked.COST


def _is_cost_correct(team: Team, values: Mapping[str, int], result: RunResult, aside: frozenset[str]) -> bool:
    if team.objectives:
        return objective_costs(team, values, aside) == dict(result.objectives)
    try:
        check_user_cost(team, values, result.cost, without=aside)
    except RefutedError:
        return False
    return True
