"""The largest message: counted in every runtime, told in the result, and in words where it is a large one."""

from __future__ import annotations

import json
from dataclasses import replace

from robochoc.cli.reports.outcome import outcome_report
from robochoc.formats.result import read_result, result_json
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Sent
from robochoc.journal.journal import metrics_of
from robochoc.model.outcome import Metrics
from robochoc.run import solve
from robochoc.run.options import Options, Runtime, Withdrawal
from tests.support.cases import looped
from tests.support.problems import ON_ONE_MACHINE


@looped("runtime", ON_ONE_MACHINE)
def test_the_largest_message_is_the_largest_that_was_sent(runtime: Runtime) -> None:
    events: list[AnyEvent] = []
    options = Options(protocol="sfb", runtime=runtime, withdraw=Withdrawal.MINIMUM, cache=False)
    outcome = solve(queens3d(3), options, observer=events.append)
    largest = max(event.bytes for event in events if isinstance(event, Sent))
    assert outcome.metrics.largest == largest > 100
    assert metrics_of(events).largest == largest
    assert json.loads(result_json(outcome))["metrics"]["largest"] == largest
    assert read_result(result_json(outcome)).metrics.largest == largest


def test_of_two_runs_the_larger_counts() -> None:
    assert (Metrics(largest=3) + Metrics(largest=7) + Metrics(largest=5)).largest == 7


def test_a_large_one_is_told_of() -> None:
    team = queens3d(2)
    outcome = solve(team, Options(protocol="abt", cache=False))
    assert "largest" not in outcome_report(team, outcome)
    large = replace(outcome, metrics=replace(outcome.metrics, largest=1_588_746))
    assert "bytes (the largest message 1,588,746), " in outcome_report(team, large)
