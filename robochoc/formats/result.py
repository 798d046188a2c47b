"""The JSON result: one object for one team and run (docs/reference/result.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal
from types import MappingProxyType
from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from robochoc.model.outcome import (
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


class ResultError(ValueError):
    """The text is no JSON result."""


class _MetricsForm(msgspec.Struct):
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


class _ImprovementForm(msgspec.Struct, omit_defaults=True):
    seconds: float
    verdict: Verdict
    cost: int | Decimal | None
    withdrawn: list[str] = []


class _EpochForm(msgspec.Struct, omit_defaults=True):
    verdict: Verdict
    opened_by: str
    robots: list[str]
    assignment: dict[str, int | str]
    cost: int | Decimal | None
    messages: int
    bytes: int
    ncccs: int
    checks: int
    wall_s: float
    verified: bool
    lost: list[str] = []
    confirmed: bool = False
    simulated_s: float | UnsetType = UNSET
    cycles: int | UnsetType = UNSET
    lost_messages: int | UnsetType = UNSET
    improvements: list[_ImprovementForm] = []


class _CheckedForm(msgspec.Struct):
    by_both: int
    by_owner: int


class _OptimaForm(msgspec.Struct):
    number: Decimal
    assignments: list[dict[str, int | str]]


class _PreprocessingForm(msgspec.Struct):
    name: str
    metrics: _MetricsForm
    removed: int
    values: int


class _Form(msgspec.Struct, omit_defaults=True):
    team: str
    protocol: str
    runtime: str
    seed: int
    verdict: Verdict
    assignment: dict[str, int | str]
    cost: int | Decimal | None
    withdrawn: list[str]
    epochs: list[_EpochForm]
    metrics: _MetricsForm
    verified: bool
    count: Decimal | None = None
    reason: str | None = None
    lost: list[str] = []
    order: str | None = None
    bound: int | Decimal | None = None
    placed_by: str | None = None
    tree: dict[str, PseudoTreeNode] = {}
    confirmed: bool = False
    channel: str | None = None
    claimed_by: str | None = None
    checked: _CheckedForm | None = None
    names: dict[str, str] = {}
    chosen: dict[str, str] = {}
    preprocessing: _PreprocessingForm | None = None
    optima: _OptimaForm | None = None
    deadline: float | None = None
    improvements: list[_ImprovementForm] = []
    places: dict[str, tuple[float, ...]] = {}


_SAME = (
    *("team", "protocol", "runtime", "seed", "verdict", "cost", "verified", "reason", "order"),
    *("bound", "placed_by", "tree", "confirmed", "channel", "claimed_by", "chosen", "deadline"),
)
"""The fields that are the same in an outcome and in its JSON form."""


_ENCODER = msgspec.json.Encoder(decimal_format="number")


def result_json(
    outcome: Outcome,
    names: Mapping[str, str] = MappingProxyType({}),
    places: Mapping[str, tuple[float, ...]] = MappingProxyType({}),
) -> bytes:
    """Return `outcome` as one line of JSON, without the line's end.

    Args:
        outcome: The outcome.
        names: What robots and variables are called elsewhere, by the names in `outcome`.
        places: Where on a map the values of variables are, in metres.
    """
    same: dict[str, Any] = {name: getattr(outcome, name) for name in _SAME}
    form = _Form(
        **same,
        assignment=outcome.labelled(outcome.assignment),
        withdrawn=list(outcome.withdrawn),
        lost=list(outcome.lost),
        count=None if outcome.count is None else Decimal(outcome.count),  # an integer has 64 bits at most in msgspec
        epochs=[_epoch(epoch, outcome) for epoch in outcome.epochs],
        metrics=_metrics(outcome.metrics),
        checked=_CheckedForm(*outcome.checked) if outcome.checked else None,
        names=dict(names),
        places=dict(places),
        preprocessing=_preprocessing(outcome.preprocessing),
        optima=_optima(outcome),
        improvements=_improvements(outcome.improvements),
    )
    return _ENCODER.encode(form)


def _improvements(found: Sequence[Improvement]) -> list[_ImprovementForm]:
    return [_ImprovementForm(round(one.at_s, 6), one.verdict, one.cost, list(one.withdrawn)) for one in found]


def _improvements_of(forms: Sequence[_ImprovementForm]) -> tuple[Improvement, ...]:
    return tuple([Improvement(one.seconds, one.verdict, one.cost, tuple(one.withdrawn)) for one in forms])


def _optima(outcome: Outcome) -> _OptimaForm | None:
    if outcome.optima is None:
        return None
    return _OptimaForm(Decimal(outcome.optima.number), [outcome.labelled(one) for one in outcome.optima.assignments])


def _metrics(spent: Metrics) -> _MetricsForm:
    return _MetricsForm(
        messages=sum(spent.messages.values()),
        bytes=spent.bytes,
        ncccs=spent.ncccs,
        checks=spent.checks,
        wall_s=round(spent.wall_s, 6),
        messages_by_type=dict(sorted(spent.messages.items())),
        compile_s=round(spent.compile_s, 6),
        memory=spent.memory,
        simulated_s=spent.simulated_s,
        largest=spent.largest,
        cycles=spent.cycles,
        lost_messages=spent.lost_messages,
    )


def _preprocessing(done: Preprocessing | None) -> _PreprocessingForm | None:
    return _PreprocessingForm(done.name, _metrics(done.metrics), done.removed, done.values) if done else None


def _epoch(epoch: EpochOutcome, outcome: Outcome) -> _EpochForm:
    spent = epoch.metrics
    return _EpochForm(
        verdict=epoch.verdict,
        opened_by=epoch.opened_by,
        robots=list(epoch.robots),
        assignment=outcome.labelled(epoch.assignment),
        cost=epoch.cost,
        messages=sum(spent.messages.values()),
        bytes=spent.bytes,
        ncccs=spent.ncccs,
        checks=spent.checks,
        wall_s=round(spent.wall_s, 6),
        verified=epoch.verified,
        lost=list(epoch.lost),
        confirmed=epoch.confirmed,
        simulated_s=spent.simulated_s or UNSET,
        cycles=spent.cycles or UNSET,
        lost_messages=spent.lost_messages or UNSET,
        improvements=_improvements(epoch.improvements),
    )


class _Symbols:
    """The names that stand for values in a JSON result. It says no codes: there they get some of its own."""

    def __init__(self) -> None:
        self.codes: dict[str, int] = {}
        self.variables: dict[str, None] = {}

    def values(self, assignment: dict[str, int | str]) -> dict[str, int]:
        """Return an assignment in codes."""
        return {name: self._value(name, value) for name, value in assignment.items()}

    def _value(self, name: str, value: int | str) -> int:
        if isinstance(value, int):
            return value
        self.variables[name] = None
        return self.codes.setdefault(value, len(self.codes))


def _epoch_of(form: _EpochForm, symbols: _Symbols) -> EpochOutcome:
    counts = form.bytes, form.ncccs, form.checks, form.wall_s
    metrics = Metrics(
        {"messages": form.messages},
        *counts,
        simulated_s=form.simulated_s or 0.0,
        cycles=form.cycles or 0,
        lost_messages=form.lost_messages or 0,
    )
    return EpochOutcome(
        verdict=form.verdict,
        robots=tuple(form.robots),
        opened_by=form.opened_by,
        assignment=symbols.values(form.assignment),
        cost=form.cost,
        metrics=metrics,
        verified=form.verified,
        lost=tuple(form.lost),
        confirmed=form.confirmed,
        improvements=_improvements_of(form.improvements),
    )


def read_result(content: bytes) -> Outcome:
    """Return the outcome in a JSON result. Raises `ResultError`, which says what is wrong."""
    try:
        form = msgspec.json.decode(content, type=_Form)
    except UnicodeDecodeError as error:
        raise ResultError("it is not UTF-8") from error
    except RecursionError as error:
        raise ResultError("it is nested too deep") from error
    except msgspec.MsgspecError as error:
        raise ResultError(describe_decode_error(error, _Form)) from error
    same: dict[str, Any] = {name: getattr(form, name) for name in _SAME}
    symbols = _Symbols()
    assignment = symbols.values(form.assignment)
    epochs = tuple(_epoch_of(epoch, symbols) for epoch in form.epochs)
    told = form.optima
    listed = Optima(int(told.number), tuple(map(symbols.values, told.assignments))) if told else None
    return Outcome(
        **same,
        assignment=assignment,
        symbols=tuple(symbols.codes),
        symbolic=tuple(symbols.variables),
        withdrawn=tuple(form.withdrawn),
        lost=tuple(form.lost),
        epochs=epochs,
        metrics=_metrics_of(form.metrics),
        checked=CheckCounts(form.checked.by_both, form.checked.by_owner) if form.checked else None,
        preprocessing=_preprocessing_of(form.preprocessing),
        optima=listed,
        improvements=_improvements_of(form.improvements),
    )


def _preprocessing_of(form: _PreprocessingForm | None) -> Preprocessing | None:
    return Preprocessing(form.name, _metrics_of(form.metrics), form.removed, form.values) if form else None


def _metrics_of(form: _MetricsForm) -> Metrics:
    messages = form.messages_by_type or {"messages": form.messages}
    counts = form.bytes, form.ncccs, form.checks, form.wall_s, form.compile_s, form.memory, form.simulated_s
    rest = {"largest": form.largest, "cycles": form.cycles, "lost_messages": form.lost_messages}
    return Metrics(messages, *counts, **rest)
