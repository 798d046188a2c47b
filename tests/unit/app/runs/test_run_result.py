"""The application reads results whole."""

from __future__ import annotations

from dataclasses import fields, replace
from random import Random

import msgspec

from robochoc.app.runs.result import RunResult, decoded
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import Outcome, Verdict
from tests.support.random_outcomes import random_outcome


def test_no_field_is_dropped() -> None:
    """Epochs are kept as they are in the file; decimals become floats."""
    assert {one.name for one in fields(Outcome)} <= set(RunResult.__struct_fields__)
    chance = Random(2)
    encode = msgspec.json.Encoder(decimal_format="number").encode
    for _ in range(100):
        content = result_json(random_outcome(chance))
        found = decoded(content + b"\n")
        assert found is not None
        again = read_result(encode(msgspec.structs.asdict(found)))
        once = read_result(content)
        assert replace(again, cost=once.cost, bound=once.bound, epochs=once.epochs) == once
        assert msgspec.json.encode(found.epochs) == msgspec.json.encode(msgspec.json.decode(content)["epochs"])


def test_a_result_with_many_missing_fields_is_read() -> None:
    assert decoded(b'{"verdict":"solution"}\n') == RunResult(Verdict.SOLUTION)
    assert decoded(b'{"verdict":"none"}\n') is None
