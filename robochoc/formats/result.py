"""The JSON result (docs/reference/result.md): one object for one team and run."""

from __future__ import annotations

import msgspec
from msgspec import UNSET, UnsetType

from robochoc.model.outcome import CheckCounts, EpochOutcome, Metrics, Outcome, PseudoTreeNode, Verdict
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


class _EpochForm(msgspec.Struct, omit_defaults=True):
    verdict: Verdict
    opened_by: str
    robots: list[str]
    assignment: dict[str, int]
    cost: float | int | None
    messages: int
    bytes: int
    ncccs: int
    checks: int
    wall_s: float
    verified: bool
    lost: list[str] = []
    confirmed: bool = False
    simulated_s: float | UnsetType = UNSET


class _CheckedForm(msgspec.Struct):
    by_both: int
    by_owner: int


class _Form(msgspec.Struct, omit_defaults=True):
    team: str
    protocol: str
    runtime: str
    seed: int
    verdict: Verdict
    assignment: dict[str, int]
    cost: float | int | None
    withdrawn: list[str]
    epochs: list[_EpochForm]
    metrics: _MetricsForm
    verified: bool
    count: int | None = None
    reason: str | None = None
    lost: list[str] = []
    order: str | None = None
    bound: float | int | None = None
    placed_by: str | None = None
    tree: dict[str, PseudoTreeNode] = {}
    confirmed: bool = False
    channel: str | None = None
    claimed_by: str | None = None
    checked: _CheckedForm | None = None


def result_json(outcome: Outcome) -> bytes:
    """Return `outcome` as one line of JSON, without the line's end."""
    spent = outcome.metrics
    metrics = _MetricsForm(
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
    )
    form = _Form(
        team=outcome.team,
        protocol=outcome.protocol,
        runtime=outcome.runtime,
        seed=outcome.seed,
        verdict=outcome.verdict,
        assignment=outcome.assignment,
        cost=outcome.cost,
        withdrawn=list(outcome.withdrawn),
        epochs=[_epoch(epoch) for epoch in outcome.epochs],
        metrics=metrics,
        verified=outcome.verified,
        count=outcome.count,
        reason=outcome.reason,
        lost=list(outcome.lost),
        order=outcome.order,
        bound=outcome.bound,
        placed_by=outcome.placed_by,
        tree=outcome.tree,
        confirmed=outcome.confirmed,
        channel=outcome.channel,
        claimed_by=outcome.claimed_by,
        checked=_CheckedForm(*outcome.checked) if outcome.checked else None,
    )
    return msgspec.json.encode(form)


def _epoch(epoch: EpochOutcome) -> _EpochForm:
    spent = epoch.metrics
    return _EpochForm(
        verdict=epoch.verdict,
        opened_by=epoch.opened_by,
        robots=list(epoch.robots),
        assignment=epoch.assignment,
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
    )


def _epoch_of(form: _EpochForm) -> EpochOutcome:
    counts = form.bytes, form.ncccs, form.checks, form.wall_s
    metrics = Metrics({"messages": form.messages}, *counts, simulated_s=form.simulated_s or 0.0)
    return EpochOutcome(
        verdict=form.verdict,
        robots=tuple(form.robots),
        opened_by=form.opened_by,
        assignment=form.assignment,
        cost=form.cost,
        metrics=metrics,
        verified=form.verified,
        lost=tuple(form.lost),
        confirmed=form.confirmed,
    )


def read_result(content: bytes) -> Outcome:
    """Return the outcome that a JSON result tells of. Raises `ResultError`, saying what is wrong."""
    try:
        form = msgspec.json.decode(content, type=_Form)
    except UnicodeDecodeError as error:
        raise ResultError("it is not UTF-8") from error
    except RecursionError as error:
        raise ResultError("it is nested too deep") from error
    except msgspec.MsgspecError as error:
        raise ResultError(describe_decode_error(error, _Form)) from error
    spent = form.metrics
    messages = spent.messages_by_type or {"messages": spent.messages}
    counts = spent.bytes, spent.ncccs, spent.checks, spent.wall_s, spent.compile_s, spent.memory, spent.simulated_s
    return Outcome(
        team=form.team,
        protocol=form.protocol,
        runtime=form.runtime,
        seed=form.seed,
        verdict=form.verdict,
        assignment=form.assignment,
        cost=form.cost,
        withdrawn=tuple(form.withdrawn),
        metrics=Metrics(messages, *counts, largest=spent.largest),
        verified=form.verified,
        count=form.count,
        reason=form.reason,
        lost=tuple(form.lost),
        order=form.order,
        bound=form.bound,
        placed_by=form.placed_by,
        tree=form.tree,
        confirmed=form.confirmed,
        channel=form.channel,
        claimed_by=form.claimed_by,
        checked=CheckCounts(form.checked.by_both, form.checked.by_owner) if form.checked else None,
        epochs=tuple(map(_epoch_of, form.epochs)),
    )
