"""Functions of Python files that a problem names (`source:`). Reading them executes them: only where it is allowed."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.pydcop.python_values import NoValueError, Value


def functions_of(path: Path) -> dict[str, Callable[..., Value]]:
    """Execute the Python file at `path`, and return its functions.

    Raises:
        MistakeError: if that fails.
    """
    spec = importlib.util.spec_from_file_location("source", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise MistakeError(f"the source {shortened(str(path))} is no Python file", "it stands beside the first file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # noqa: BLE001 - whatever the user's code raises
        what = f"the source {shortened(str(path))} fails: {type(error).__name__}: {shortened(str(error))}"
        raise MistakeError(what, "mend the Python file") from None
    return {name: _guarded(thing) for name, thing in vars(module).items() if callable(thing)}


def _guarded(function: Callable[..., object]) -> Callable[..., Value]:
    """Return `function` of Python's own numbers as one of exact ones."""

    def call(*arguments: Value) -> Value:
        try:
            result = function(*[float(one) if isinstance(one, Fraction) else one for one in arguments])
        except Exception as error:  # noqa: BLE001 - whatever the user's code raises
            raise NoValueError(f"{type(error).__name__}: {error}") from None
        if isinstance(result, float) and result not in (float("inf"), float("-inf")):
            return Fraction(repr(result)) if result == result else result  # noqa: PLR0124 - only NaN differs from itself
        if result is None or isinstance(result, (int, float, str)):
            return result
        raise NoValueError(f"a {type(result).__name__} is no number")

    return call
