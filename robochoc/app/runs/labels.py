"""Conversion of the robots' integer codes, and of symbols in files, to the user's values."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.app.sketch.sketch import Sketch, Value
from robochoc.app.sketch.words import value_in_short
from robochoc.modelling.model import Model


def value_of(model: Model, variable: str, code: int) -> Value:
    """Return the user's value of a variable's code."""
    user_values = model.variables[variable].codes.user_values or {}
    value = user_values.get(code, code)
    return value if isinstance(value, (int, str)) else str(value)


def label_of(model: Model, variable: str, code: int) -> Value:
    """Return the user's value of a variable's code; the code itself, if the team has no such variable."""
    return value_of(model, variable, code) if variable in model.variables else code


def labels_of(model: Model) -> dict[str, str]:
    """Return the user's values with another spelling in files, such as `two words`, by that spelling: `two_words`."""
    found: dict[str, str] = {}
    for name, variable in model.team.variables.items():
        if not variable.domain.symbols or name not in model.variables:
            continue
        for code in variable.domain:
            label, value = str(variable.domain.label(code)), str(value_of(model, name, code))
            if label != value:
                found[label] = value
    return found


def called_in(model: Model, sketch: Sketch) -> Callable[[str, int], str]:
    """Return a function that converts a variable's code to a short text for the user: a cell to `(2, 3)`."""
    decisions = {f"{robot}.{one.name}": one for one in sketch.decisions for robot in sketch.deciders(one)}

    def called(variable: str, code: int) -> str:
        if variable not in model.variables:
            return str(code)
        value, decision = value_of(model, variable, code), decisions.get(variable)
        return value_in_short(sketch, decision, value) if decision else str(value)

    return called
