"""Results survive their way through JSON, with every field of their type."""

from __future__ import annotations

from dataclasses import fields, replace
from decimal import Decimal
from random import Random

import msgspec
import pytest

from robochoc.formats.result import ResultError, read_result, result_json
from robochoc.model.outcome import EpochOutcome, Metrics, Optima, Outcome, Verdict
from tests.support.random_outcomes import random_outcome

PLAIN = Outcome(Verdict.SOLUTION, team="team", protocol="abt", runtime="simulator", seed=1)


def test_every_field_survives_a_round_trip() -> None:
    chance = Random(36)
    outcomes = [random_outcome(chance) for _ in range(300)]
    for outcome in outcomes:
        assert read_result(result_json(outcome)) == outcome
    for name in [one.name for one in fields(Outcome)]:
        assert len({repr(getattr(one, name)) for one in outcomes}) > (name != "symbols"), name
    for name in [one.name for one in fields(EpochOutcome)]:
        assert len({repr(getattr(epoch, name)) for one in outcomes for epoch in one.epochs}) > 1, name


def test_plain_results_stay_short() -> None:
    assert read_result(result_json(PLAIN)) == PLAIN
    told = msgspec.json.decode(result_json(replace(PLAIN, epochs=(EpochOutcome(Verdict.SOLUTION, robots=("a",)),))))
    assert list(told) == [
        *("team", "protocol", "runtime", "seed", "verdict", "assignment", "cost", "withdrawn", "epochs", "metrics"),
        "verified",
    ]
    assert list(told["epochs"][0]) == [
        *("verdict", "opened_by", "robots", "assignment", "cost", "withdrawn", "verified"),
        *(one.name for one in fields(Metrics)),
        "messages_by_type",
    ]


@pytest.mark.parametrize("number", [2**63 - 1, 2**63, -(2**63) - 1, 10**40])
def test_numbers_of_any_length(number: int) -> None:
    epoch = EpochOutcome(Verdict.OPTIMAL, robots=("a",), cost=number, bound=number)
    outcome = replace(PLAIN, cost=number, bound=number, count=number, optima=Optima(number, ()), epochs=(epoch,))
    read = read_result(result_json(outcome))
    assert read == outcome
    assert {type(one) for one in (read.cost, read.bound, read.count, read.epochs[0].cost)} == {int}


def test_results_of_earlier_versions_are_read() -> None:
    """They list neither symbols nor the types of the messages of an epoch."""
    told = msgspec.json.decode(result_json(PLAIN))
    epoch = {"verdict": "solution", "opened_by": "the start", "robots": ["a"], "assignment": {"a": "red"}, "cost": 0}
    epoch |= {"messages": 3, "bytes": 5, "ncccs": 7, "checks": 9, "wall_s": 0.5, "verified": True}
    told |= {"assignment": {"b": "green", "a": "red"}, "epochs": [epoch]}
    read = read_result(msgspec.json.encode(told))
    assert read.labelled(read.assignment) == {"b": "green", "a": "red"}
    assert read.labelled(read.epochs[0].assignment) == {"a": "red"}
    assert read.epochs[0].metrics == Metrics({"messages": 3}, 5, 7, 9, 0.5)


@pytest.mark.parametrize(
    ("key", "wrong", "text"),
    [
        ("count", "1.5", "count: expected an integer or null"),
        ("count", "NaN", "NaN is not a number"),
        ("count", "1e999999999", "too large or has too many digits"),
        ("deadline", "1e9000", "too large or has too many digits"),
        ("metrics", '{"wall_s":-1e-9000}', "too large or has too many digits"),
        ("cost", "-1e-999999999", "too large or has too many digits"),
        ("cost", "1" * 10_001, "more than 10,000 digits"),
        ("bound", '"3"', "bound: expected "),
        ("checked", '{"by_both":1}', "checked.*: expected an integer"),
        ("checked", "[]", "checked: "),
        ("optima", '{"number":1,"assignments":[{"a":[]}]}', "optima.*: expected an integer"),
        ("improvements", '[{"seconds":1,"verdict":"none","cost":1}]', "improvements.*: 'none' is not allowed"),
        ("improvements", "{}", "improvements: expected a list"),
        ("epochs", "[3]", "epochs.*: expected an object"),
        ("epochs", '[{"verdict":"solution","robots":[],"wall_s":"1"}]', "wall_s: expected a number"),
        ("metrics", "[]", "metrics: expected an object"),
        ("metrics", '{"messages":"many"}', "messages.*: expected "),
        ("preprocessing", '{"name":"ac"}', "preprocessing.metrics: expected an object"),
        ("seed", "null", "seed: expected an integer"),
        ("verdict", '"none"', "'none' is not allowed"),
    ],
)
def test_invalid_values_are_refused_with_their_place(key: str, wrong: str, text: str) -> None:
    plain = msgspec.json.decode(result_json(PLAIN))
    plain.pop(key, None)
    content = f'{{"{key}":{wrong},'.encode() + msgspec.json.encode(plain)[1:]
    with pytest.raises(ResultError, match=text):
        read_result(content)


def test_costs_are_exact() -> None:
    for cost in (Decimal("0.3"), Decimal("-1E-9"), Decimal("2.50")):
        assert read_result(result_json(replace(PLAIN, cost=cost))).cost == cost
