"""The JSON result: one object for one team and run (docs/reference/result.md).

It is converted from and to the types in `model/outcome.py`; no field is declared here. The object differs from an
`Outcome` only in these points:

* Fields of an answer with their default value are omitted, except those in `_FIRST`.
* Values of symbolic variables are their symbols, and values of real variables are numbers in the user's unit.
* `metrics` has the number of `messages`, and `messages_by_type`. The metrics of an epoch are in the epoch's object.
* `at_s` is called `seconds`. Measured seconds have six decimal places.
* `names`, `places` and `values` are added by the caller.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from decimal import Decimal
from types import MappingProxyType
from typing import Any, NoReturn

import msgspec

from robochoc.model.outcome import (
    Answer,
    CheckCounts,
    FrontPoint,
    GridSearch,
    Improvement,
    Metrics,
    Optima,
    Outcome,
    SearchStage,
)
from robochoc.model.real import MOST_PLACES
from robochoc.system.decode_errors import describe_decode_error
from robochoc.system.errors import RobochocError

Value = int | float | Decimal | str
"""A value in a JSON result: a number, or a text for any other value."""
Json = dict[str, Any]


class ResultError(RobochocError, ValueError):
    """Raised if the text is not a valid JSON result."""


_FIRST = (
    *("team", "protocol", "runtime", "seed", "verdict", "opened_by", "robots"),
    *("assignment", "cost", "withdrawn", "epochs", "metrics", "verified"),
)
"""The first keys of an answer, in this order. They are never omitted."""
_MEASURED = frozenset({"at_s", "wall_s", "compile_s"})
_DIGITS_S = 6
"""The number of decimal places for measured seconds."""
_MOST_DIGITS = 10_000
"""The maximum number of digits in a number: 1e999999999 as an integer would exhaust the memory."""
_LARGEST_EXPONENT = 300
"""The largest exponent of a decimal: a larger number would be infinite as a float."""
_ENCODER = msgspec.json.Encoder(decimal_format="number")


def result_json(
    outcome: Outcome,
    names: Mapping[str, str] = MappingProxyType({}),
    places: Mapping[str, tuple[float, ...]] = MappingProxyType({}),
    values: Mapping[str, Value] = MappingProxyType({}),
) -> bytes:
    """Return `outcome` as one line of JSON, without the line break.

    Args:
        outcome: The outcome.
        names: The original names of robots and variables, by their names in `outcome`.
        places: The positions that the values of variables represent, in metres on a map.
        values: The user's values of variables, if they differ from the integers in the assignment.
    """
    added = {"names": names, "places": places, "values": values}
    result = _answer(outcome, outcome) | {key: dict(one) for key, one in added.items() if one}
    return _ENCODER.encode(result)


def _answer(answer: Answer, outcome: Outcome) -> Json:
    """Return an answer as an object: `outcome`, or one of its epochs."""
    known = {one.name: one for one in fields(answer) if one.compare}  # the other fields are derived, as in `Solution`
    result: Json = {}
    for name in (*_FIRST, *known):
        if name in known and name not in result:
            value = getattr(answer, name)
            if name in _FIRST or value != _default(known[name]):
                result[name] = _in_json(name, value, outcome)
    if answer is not outcome:
        result |= result.pop("metrics")
    return result


def _default(one: Field[Any]) -> object:
    return one.default if one.default_factory is MISSING else one.default_factory()


def _in_json(name: str, value: Any, outcome: Outcome) -> Any:  # noqa: ANN401, C901, PLR0911 - any field
    """Return the JSON value of the field `name` in `outcome`, or in a part of it."""
    match value:
        case Answer():
            return _answer(value, outcome)
        case Metrics():
            counts = {one.name: _in_json(one.name, getattr(value, one.name), outcome) for one in fields(value)}
            by_type = dict(sorted(value.messages.items()))
            return counts | {"messages": sum(by_type.values()), "messages_by_type": by_type}
        case Improvement():
            found = {key: _in_json(key, one, outcome) for key, one in value._asdict().items()}
            return {"seconds": found.pop("at_s"), **found}
        case CheckCounts() | FrontPoint() | GridSearch() | Optima() | SearchStage():
            return {key: _in_json(key, one, outcome) for key, one in value._asdict().items()}
        case Mapping():
            if name == "assignment":
                return outcome.labelled(value)
            return {key: _in_json("", one, outcome) for key, one in value.items()}
        case tuple() if name == "assignments":
            return [outcome.labelled(one) for one in value]
        case tuple():
            return [_in_json("", one, outcome) for one in value]
        case int() if value.bit_length() > 63:  # noqa: PLR2004 - bits: of longer integers msgspec limits the digits
            return Decimal(value)
        case float() if name in _MEASURED:
            return round(value, _DIGITS_S)
        case _ if is_dataclass(value):
            return {one.name: _in_json(one.name, getattr(value, one.name), outcome) for one in fields(value)}
        case _:
            return value


def read_result(content: bytes) -> Outcome:
    """Return the outcome in a JSON result.

    Raises:
        ResultError: if the result is invalid. The message contains the key and the expected value.
    """
    try:
        result = _LOADS.decode(content.decode())
    except UnicodeDecodeError as error:
        raise ResultError("it is not UTF-8") from error
    except RecursionError as error:
        raise ResultError("it is nested too deep") from error
    except json.JSONDecodeError as error:
        raise ResultError(f"it is not valid JSON: {error}") from error
    try:
        return msgspec.convert(_outcome_fields(result), Outcome, builtin_types=(Decimal,))
    except msgspec.ValidationError as error:
        raise ResultError(describe_decode_error(error, Outcome)) from error


def _integer(digits: str) -> int:
    if len(digits) > _MOST_DIGITS:
        raise ResultError(f"the number {digits[:20]}... has more than {_MOST_DIGITS:,} digits")
    return int(Decimal(digits))  # `int` limits the number of digits


def _decimal(digits: str) -> Decimal:
    number = Decimal(digits)
    if abs(number.adjusted()) > _LARGEST_EXPONENT or len(digits) > _MOST_DIGITS:
        raise ResultError(f"the number {digits[:20]} is too large or has too many digits; write at most 1e300")
    return number


def _refuse(constant: str) -> NoReturn:
    raise ResultError(f"it is not valid JSON: {constant} is not a number")


_LOADS = json.JSONDecoder(parse_float=_decimal, parse_int=_integer, parse_constant=_refuse)


class _Symbols:
    """The symbols in a JSON result, and the symbolic variables.

    Results of earlier versions do not list the symbols. Then symbols get codes in the order of their first use.
    """

    def __init__(self, result: Json) -> None:
        self.codes = {symbol: code for code, symbol in enumerate(_texts(result, "symbols"))}
        self.variables = dict.fromkeys(_texts(result, "symbolic"))
        places = result.get("real_places")
        self._places: Json = places if isinstance(places, dict) else {}

    def codes_of(self, assignment: Any) -> Any:  # noqa: ANN401 - JSON; anything invalid is refused later
        """Return an assignment with codes instead of symbols."""
        if not isinstance(assignment, dict):
            return assignment
        return {name: self._code(name, value) for name, value in assignment.items()}

    def _code(self, name: str, value: object) -> object:
        places = self._places.get(name)
        if type(places) is int and 0 <= places <= MOST_PLACES and isinstance(value, int | Decimal):
            steps = Decimal(value).scaleb(places)
            return int(steps) if steps == int(steps) else value
        if not isinstance(value, str):
            return value
        self.variables[name] = None
        return self.codes.setdefault(value, len(self.codes))


# The functions below return the fields of a type in `model/outcome.py`. Invalid values stay unchanged: `convert`
# refuses them, and names their position.


def _outcome_fields(result: Any) -> Any:  # noqa: ANN401 - JSON
    if not isinstance(result, dict):
        return result
    symbols = _Symbols(result)
    found = _answer_fields(result, symbols)
    if isinstance(epochs := result.get("epochs"), list):
        found["epochs"] = [
            _answer_fields(one, symbols) | {"metrics": _metrics_fields(one)} if isinstance(one, dict) else one
            for one in epochs
        ]
    for key, kind in (("stages", SearchStage), ("grids", GridSearch)):
        if isinstance(listed := result.get(key), list):
            found[key] = [[one.get(name) for name in kind._fields] if isinstance(one, dict) else one for one in listed]
    if "metrics" in result:
        found["metrics"] = _metrics_fields(result["metrics"])
    return found | {"symbols": [*symbols.codes], "symbolic": [*symbols.variables]}  # after all values were read


def _answer_fields(answer: Json, symbols: _Symbols) -> Json:
    found = dict(answer)
    if "assignment" in found:
        found["assignment"] = symbols.codes_of(found["assignment"])
    if isinstance(counts := found.get("checked"), dict):
        found["checked"] = [counts.get(name) for name in CheckCounts._fields]
    if isinstance(optima := found.get("optima"), dict):
        found["optima"] = [optima.get("number"), [symbols.codes_of(one) for one in _items(optima.get("assignments"))]]
    if isinstance(front := found.get("front"), list):
        found["front"] = [
            [one.get("objectives"), symbols.codes_of(one.get("assignment"))] if isinstance(one, dict) else one
            for one in front
        ]
    if isinstance(found.get("improvements"), list):
        found["improvements"] = [*map(_improvement_fields, found["improvements"])]
    if isinstance(spent := found.get("preprocessing"), dict):
        found["preprocessing"] = spent | {"metrics": _metrics_fields(spent.get("metrics"))}
    return found


def _improvement_fields(one: Any) -> Any:  # noqa: ANN401 - JSON
    if not isinstance(one, dict):
        return one
    return [one.get("seconds"), one.get("verdict"), one.get("cost"), one.get("withdrawn", [])]


def _metrics_fields(metrics: Any) -> Any:  # noqa: ANN401 - JSON
    if not isinstance(metrics, dict):
        return metrics
    total = metrics.get("messages", 0)
    by_type = metrics.get("messages_by_type") or ({"messages": total} if total else {})  # earlier versions: no types
    return metrics | {"messages": by_type}


def _texts(result: Json, key: str) -> Sequence[str]:
    return [one for one in _items(result.get(key)) if isinstance(one, str)]


def _items(given: object) -> Sequence[Any]:
    return given if isinstance(given, list) else ()
