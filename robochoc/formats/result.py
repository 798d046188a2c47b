"""The JSON result: one object for one team and run (docs/reference/result.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from decimal import Decimal
from types import MappingProxyType
from typing import Any

import msgspec

from robochoc.model.absence import DroppedConstraint
from robochoc.model.cost_units import Cost
from robochoc.model.outcome import (
    Answer,
    CheckCounts,
    EpochOutcome,
    Improvement,
    Metrics,
    Optima,
    Outcome,
    Preprocessing,
    PseudoTreeNode,
    Verdict,
)
from robochoc.system.decode_errors import describe_decode_error

Value = int | float | Decimal | str
"""A value in a JSON result: a number, or a text for any other value."""


class ResultError(ValueError):
    """The text is no JSON result."""


_ZERO = 0.0
"""msgspec leaves out a float that is the same object as its default."""


class MetricsForm(msgspec.Struct, frozen=True):
    """`Metrics` in JSON."""

    messages: int
    bytes: int
    ncccs: int
    checks: int
    wall_s: float
    messages_by_type: dict[str, int] = {}
    compile_s: float = 0.0
    memory: int = 0
    simulated_s: float = 0.0
    largest: int = 0
    cycles: int = 0
    lost_messages: int = 0


class ImprovementForm(msgspec.Struct, omit_defaults=True, frozen=True):
    """`Improvement` in JSON."""

    at_s: float = msgspec.field(name="seconds")
    verdict: Verdict
    cost: int | Decimal | None
    withdrawn: tuple[str, ...] = ()


class EpochForm(msgspec.Struct, omit_defaults=True, frozen=True):
    """`EpochOutcome` in JSON, with its metrics."""

    verdict: Verdict
    opened_by: str
    robots: tuple[str, ...]
    assignment: dict[str, int | str]
    cost: int | Decimal | None
    messages: int
    bytes: int
    ncccs: int
    checks: int
    wall_s: float
    verified: bool
    lost: tuple[str, ...] = ()
    confirmed: bool = False
    simulated_s: float = _ZERO
    cycles: int = 0
    lost_messages: int = 0
    improvements: tuple[ImprovementForm, ...] = ()
    messages_by_type: dict[str, int] = {}
    compile_s: float = _ZERO
    memory: int = 0
    largest: int = 0
    witness: str | None = None
    bound: int | Decimal | None = None
    tree: dict[str, PseudoTreeNode] = {}
    dropped_constraints: tuple[DroppedConstraint, ...] = ()
    withdrawn: tuple[str, ...] = ()
    reason: str | None = None
    count: Decimal | None = None
    confirmed_by: tuple[str, ...] = ()
    checked: CheckedForm | None = None
    preprocessing: PreprocessingForm | None = None
    optima: OptimaForm | None = None
    deadline: float | None = None


class CheckedForm(msgspec.Struct, frozen=True):
    """`CheckCounts` in JSON."""

    by_both: int
    by_owner: int


class OptimaForm(msgspec.Struct, frozen=True):
    """`Optima` in JSON."""

    number: Decimal
    assignments: tuple[dict[str, int | str], ...]


class PreprocessingForm(msgspec.Struct, frozen=True):
    """`Preprocessing` in JSON."""

    name: str
    metrics: MetricsForm
    removed: int
    values: int


class ResultForm(msgspec.Struct, omit_defaults=True, frozen=True):
    """`Outcome` in JSON, with original names, places and values."""

    team: str
    protocol: str
    runtime: str
    seed: int
    verdict: Verdict
    assignment: dict[str, int | str]
    cost: int | Decimal | None
    withdrawn: tuple[str, ...]
    epochs: tuple[EpochForm, ...]
    metrics: MetricsForm
    verified: bool
    count: Decimal | None = None
    reason: str | None = None
    lost: tuple[str, ...] = ()
    order: str | None = None
    bound: int | Decimal | None = None
    placed_by: str | None = None
    tree: dict[str, PseudoTreeNode] = {}
    confirmed: bool = False
    channel: str | None = None
    claimed_by: str | None = None
    checked: CheckedForm | None = None
    names: dict[str, str] = {}
    chosen: dict[str, str] = {}
    preprocessing: PreprocessingForm | None = None
    optima: OptimaForm | None = None
    deadline: float | None = None
    improvements: tuple[ImprovementForm, ...] = ()
    places: dict[str, tuple[float, ...]] = {}
    values: dict[str, Any] = {}
    witness: str | None = None
    confirmed_by: tuple[str, ...] = ()
    symbols: tuple[str, ...] = ()
    symbolic: tuple[str, ...] = ()
    dropped_constraints: tuple[DroppedConstraint, ...] = ()


_ENCODER = msgspec.json.Encoder(decimal_format="number")
_MOST_DIGITS = 10_000
"""The maximum number of digits of a number of solutions: 1e999999999 would take all memory."""
_DIGITS_S = 6
"""The number of decimal places of seconds that were measured."""


def result_json(
    outcome: Outcome,
    names: Mapping[str, str] = MappingProxyType({}),
    places: Mapping[str, tuple[float, ...]] = MappingProxyType({}),
    values: Mapping[str, Value] = MappingProxyType({}),
) -> bytes:
    """Return `outcome` as one line of JSON, without the line's end.

    Args:
        outcome: The outcome.
        names: What robots and variables are called elsewhere, by the names in `outcome`.
        places: Where on a map the values of variables are, in metres.
        values: The user's values of variables, where they differ from the integers in the assignment.
    """
    form = ResultForm(
        **_fields(outcome, Outcome)
        | _answer(outcome, outcome)
        | {
            "epochs": tuple([_epoch(epoch, outcome) for epoch in outcome.epochs]),
            "metrics": MetricsForm(**_metrics(outcome.metrics)),
        },
        names=dict(names),
        places=dict(places),
        values=dict(values),
    )
    return _ENCODER.encode(form)


# Fields are copied by the names in the types of `model/outcome.py`: one that the form of the JSON result lacks is a
# `TypeError` when a result is written, and an `AttributeError` when one is read.


def _fields(source: object, kind: type) -> dict[str, Any]:
    """Return the values of the fields of the dataclass `kind` in `source`, by name."""
    return {one.name: getattr(source, one.name) for one in fields(kind)}


def _answer(answer: Answer, outcome: Outcome) -> dict[str, Any]:
    """Return the fields of an answer of `outcome` whose form in JSON differs."""
    optima = answer.optima
    return {
        "assignment": outcome.labelled(answer.assignment),
        "cost": _number(answer.cost),
        "bound": _number(answer.bound),
        "count": None if answer.count is None else Decimal(answer.count),
        "checked": answer.checked and CheckedForm(**answer.checked._asdict()),
        "preprocessing": _preprocessing(answer.preprocessing),
        "optima": optima and OptimaForm(Decimal(optima.number), tuple(map(outcome.labelled, optima.assignments))),
        "improvements": _improvements(answer.improvements),
    }


def _number(number: Cost | None) -> Cost | None:
    """Return a number that msgspec can write: it writes integers of at most 64 bits."""
    return Decimal(number) if isinstance(number, int) and number.bit_length() > 63 else number  # noqa: PLR2004 - bits


def _improvements(found: Sequence[Improvement]) -> tuple[ImprovementForm, ...]:
    given = [one._replace(at_s=round(one.at_s, _DIGITS_S), cost=_number(one.cost)) for one in found]
    return tuple([ImprovementForm(**one._asdict()) for one in given])


def _metrics(spent: Metrics) -> dict[str, Any]:
    return _fields(spent, Metrics) | {
        "messages": sum(spent.messages.values()),
        "messages_by_type": dict(sorted(spent.messages.items())),
        "wall_s": round(spent.wall_s, _DIGITS_S),
        "compile_s": round(spent.compile_s, _DIGITS_S),
    }


def _preprocessing(done: Preprocessing | None) -> PreprocessingForm | None:
    if done is None:
        return None
    return PreprocessingForm(**_fields(done, Preprocessing) | {"metrics": MetricsForm(**_metrics(done.metrics))})


def _epoch(epoch: EpochOutcome, outcome: Outcome) -> EpochForm:
    given = _fields(epoch, EpochOutcome)
    spent = _metrics(given.pop("metrics"))
    spent |= {name: spent[name] or _ZERO for name in ("compile_s", "simulated_s")}
    return EpochForm(**given | _answer(epoch, outcome), **spent)


class _Symbols:
    """The symbols in a JSON result, and the symbolic variables.

    Results of earlier versions do not list the symbols: these get codes in the order of their first use.
    """

    def __init__(self, symbols: Sequence[str], variables: Sequence[str]) -> None:
        self.codes = {symbol: code for code, symbol in enumerate(symbols)}
        self.variables = dict.fromkeys(variables)

    def values(self, assignment: dict[str, int | str]) -> dict[str, int]:
        """Return an assignment in codes."""
        return {name: self._value(name, value) for name, value in assignment.items()}

    def _value(self, name: str, value: int | str) -> int:
        if isinstance(value, int):
            return value
        self.variables[name] = None
        return self.codes.setdefault(value, len(self.codes))


def read_result(content: bytes) -> Outcome:
    """Return the outcome in a JSON result. Raises `ResultError`, which says what is wrong."""
    try:
        form = msgspec.json.decode(content, type=ResultForm)
    except UnicodeDecodeError as error:
        raise ResultError("it is not UTF-8") from error
    except RecursionError as error:
        raise ResultError("it is nested too deep") from error
    except msgspec.MsgspecError as error:
        raise ResultError(describe_decode_error(error, ResultForm)) from error
    symbols = _Symbols(form.symbols, form.symbolic)
    different = _answer_of(form, symbols) | {
        "epochs": tuple([_epoch_of(epoch, symbols) for epoch in form.epochs]),
        "metrics": _metrics_of(form.metrics),
    }
    different |= {"symbols": tuple(symbols.codes), "symbolic": tuple(symbols.variables)}  # when all values were read
    return Outcome(**_fields(form, Outcome) | different)


def _answer_of(form: ResultForm | EpochForm, symbols: _Symbols) -> dict[str, Any]:
    """Return the fields of an `Answer` whose form in JSON differs."""
    optima = form.optima
    return {
        "assignment": symbols.values(form.assignment),
        "count": None if form.count is None else _whole("count", form.count),
        "checked": form.checked and CheckCounts(**msgspec.structs.asdict(form.checked)),
        "preprocessing": _preprocessing_of(form.preprocessing),
        "optima": optima and Optima(_whole("optima", optima.number), tuple(map(symbols.values, optima.assignments))),
        "improvements": _improvements_of(form.improvements),
    }


def _whole(key: str, number: Decimal) -> int:
    if not number.is_finite() or number.adjusted() > _MOST_DIGITS or number != int(number):
        raise ResultError(f"{key} is {number}; expected an integer of at most {_MOST_DIGITS:,} digits")
    return int(number)


def _improvements_of(forms: Sequence[ImprovementForm]) -> tuple[Improvement, ...]:
    return tuple([Improvement(**msgspec.structs.asdict(one)) for one in forms])


def _epoch_of(form: EpochForm, symbols: _Symbols) -> EpochOutcome:
    same = {one.name: getattr(form, one.name) for one in fields(EpochOutcome) if one.name != "metrics"}
    return EpochOutcome(**same | _answer_of(form, symbols), metrics=_metrics_of(form))


def _preprocessing_of(form: PreprocessingForm | None) -> Preprocessing | None:
    if form is None:
        return None
    return Preprocessing(**_fields(form, Preprocessing) | {"metrics": _metrics_of(form.metrics)})


def _metrics_of(form: MetricsForm | EpochForm) -> Metrics:
    messages = form.messages_by_type or ({"messages": form.messages} if form.messages else {})
    return Metrics(**_fields(form, Metrics) | {"messages": messages})
