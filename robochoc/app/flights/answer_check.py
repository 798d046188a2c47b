"""Checks the answer of a run that came in a file: a stranger's claims are told as such, and checked where they can be.

That no answer is better, or that there is none, is not checked: the team would have to decide again for that.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from decimal import Decimal

import msgspec

from robochoc.app.flights.flight_map import changed_to
from robochoc.app.runs.labels import value_of
from robochoc.app.runs.options import RESULT
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
from robochoc.verification.checker import RefutedError, check_told_cost, constraint_cost

CHECK_S = 5.0
"""Whether all constraints hold is looked at for so long; a team for which that is too short is not checked."""
_MOST_DIGITS = 400
"""A cost of more digits, before or after the point, is none: to compute with it could take all memory."""
_UNREADABLE = (ModelError, InvalidInputError, OSError, ValueError, TypeError, LookupError, ArithmeticError)


class _Told(msgspec.Struct):
    """A result's cost with all its digits, read again from its file."""

    cost: int | Decimal | None = None


def claim_words(run: Run, claims: str) -> str:
    """Return what is told of a run. Of one that came in a file: that the file says so, and what a check has found.

    Args:
        run: The run.
        claims: What its result says, in words.
    """
    if not run.record.opened or run.result is None:
        return claims
    return f"{say('opened.says', claims=claims)} {' '.join(_found(run, run.result))}"


def _found(run: Run, result: RunResult) -> list[str]:
    checked = run.record.checked
    if checked is None:
        return [say("opened.unchecked")]
    if checked != Checked.KEPT:
        return [say(f"opened.{checked}")]
    number = "" if result.cost is None else "-worth" if run.record.maximised else "-cost"
    proves = result.verdict == "optimal" or result.bound is not None
    return [say(f"opened.kept{number}"), *([say("opened.unproven")] if proves else [])]


def check(run: Run) -> None:
    """Check the answer of a run that has come in a file; its record says then what was found."""
    record, result = run.record, run.read_result()
    record.checked, record.maximised = None, False
    with suppress(*_UNREADABLE):
        drawn = bool(run.sketch.decisions)
        team, code = _drawn(run, result) if drawn else _of_files(run, result)
        record.maximised = not drawn and any(robot.costs.maximize for robot in team.robots)
        if result is not None and result.assignment:
            record.checked = _checked(team, code, result, (run.folder / RESULT).read_bytes())


_Code = Callable[[str, Value], int | None]
"""Returns the code of a variable's value; None: it is none."""


def _drawn(run: Run, result: RunResult | None) -> tuple[Team, _Code]:
    """Return the team that has answered in the end, as it was drawn, and what encodes the user's values."""
    changed = changed_to(run) if result is not None and len(result.epochs) > 1 else None
    sketch = run.sketch if changed is None else changed
    if errors_of(sketch):
        raise ValueError("the sketch is none")
    model = model_of(sketch)
    team, codes = model.team, dict[str, dict[Value, int]]()
    for decision in sketch.decisions:
        names = [f"{robot}.{decision.name}" for robot in sketch.deciders(decision)]
        if names:  # all have the same values
            own = {value_of(model, names[0], code): code for code in team.variables[names[0]].domain}
            codes |= dict.fromkeys(names, own)
    return team, lambda name, value: codes.get(name, {}).get(value)


def _of_files(run: Run, result: RunResult | None) -> tuple[Team, _Code]:
    """Return the team of files that has answered in the end, and what encodes values as files say them."""
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


def _checked(team: Team, code: _Code, result: RunResult, content: bytes) -> Checked | None:
    """Hold an answer against a team. None: there was not enough time."""
    aside = frozenset(result.withdrawn)
    flying = {name: one.domain for name, one in team.variables.items() if team.owner[name] not in aside}
    values = {name: known for name, value in result.assignment.items() if (known := code(name, value)) is not None}
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
    return Checked.KEPT if _costs_so_much(team, values, content, aside) else Checked.COST


def _costs_so_much(team: Team, values: Mapping[str, int], content: bytes, aside: frozenset[str]) -> bool:
    """Return whether values cost what a result says; its numbers are read again, with all their digits."""
    cost = msgspec.json.decode(content.partition(b"\n")[0], type=_Told).cost
    if isinstance(cost, Decimal) and not (cost.is_finite() and max(map(abs, _reach(cost))) <= _MOST_DIGITS):
        return False
    try:
        check_told_cost(team, values, cost, without=aside)
    except RefutedError:
        return False
    return True


def _reach(cost: Decimal) -> tuple[int, int]:
    """Return how far a number reaches before the point, and after it."""
    exponent = cost.as_tuple().exponent
    return cost.adjusted(), exponent if isinstance(exponent, int) else _MOST_DIGITS
