"""Values as the user says them, from the codes that robots compute with, and from the symbols that files have."""

from __future__ import annotations

from robochoc.app.sketch.sketch import Value
from robochoc.modelling.model import Model


def value_of(model: Model, variable: str, code: int) -> Value:
    """Return the user's value that a code of a variable stands for."""
    told = model.variables[variable].codes.told or {}
    value = told.get(code, code)
    return value if isinstance(value, (int, str)) else str(value)


def labels_of(model: Model) -> dict[str, str]:
    """Return the user's values that files say otherwise, such as `two words`, by what files say: `two_words`."""
    found: dict[str, str] = {}
    for name, variable in model.team.variables.items():
        if not variable.domain.symbols or name not in model.variables:
            continue
        for code in variable.domain:
            label, value = str(variable.domain.label(code)), str(value_of(model, name, code))
            if label != value:
                found[label] = value
    return found
