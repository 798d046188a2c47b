"""Journals as rows: plain values under the same keys, for pandas and polars."""

from __future__ import annotations

import json
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from random import Random

import pytest

import robochoc
from robochoc.journal.as_rows import COLUMNS
from robochoc.journal.events import Given, Heard, Improved
from robochoc.journal.journal import Header, JournalError, read_journal
from robochoc.journal.reader import lines_of
from robochoc.journal.recorder import JournalRecorder
from robochoc.journal.team_events import cost_in_user_units
from robochoc.model.assembly import assemble
from robochoc.model.costs import normalized
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Optima, Outcome
from robochoc.model.problem import Constraint, CostUnits, Domain, Function, ProblemKind, Team, Variable
from robochoc.replay.replay import replay
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.verification.objective import Objective
from tests.support.program import ROOT, robochoc_within
from tests.support.random_outcomes import random_outcome

TEAM = ROOT / "docs/examples/patrol"


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    path = tmp_path / "run.journal"
    done = robochoc_within("solve", str(TEAM), "--protocol", "dpop", "--runtime", "simulator", "--journal", str(path))
    assert done.returncode == 0, done.stderr
    return path


def test_rows_have_the_same_keys_and_plain_values(journal: Path) -> None:
    rows = robochoc.journal.rows(journal)
    assert all(tuple(row) == COLUMNS for row in rows)
    assert {type(value) for row in rows for value in row.values()} <= {str, int, float, type(None)}
    sent = [row for row in rows if row["event"] == "Sent"]
    received = [row for row in rows if row["event"] == "Received"]
    assert len(sent) == len(received) == 40
    assert sum(row["bytes"] for row in sent) == 678
    assert {(row["robot"], row["other"]) for row in sent} == {(row["other"], row["robot"]) for row in received}
    assert all(isinstance(json.loads(row["content"]), dict) for row in sent)


def test_columns_hold_the_same(journal: Path) -> None:
    rows, columns = robochoc.journal.rows(journal), robochoc.journal.by_column(journal)
    assert tuple(columns) == COLUMNS
    assert [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)] == rows


def test_damage_is_told_and_the_rows_before_it_are_there(journal: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.journal"
    cut.write_bytes(journal.read_bytes()[:-20])
    with pytest.warns(UserWarning, match="cut.journal"):
        robochoc.journal.rows(cut)
    cut.write_text("no journal")
    with pytest.raises(JournalError):
        robochoc.journal.rows(cut)


# The outcome at the end


def check(outcome: Outcome) -> None:
    """Check that a journal, and its text form, hold `outcome`."""
    recorder = JournalRecorder(Header(team="t", protocol="abt", runtime="simulator", seed=1))
    recorder.outcome = outcome
    journal = read_journal(recorder.content())
    assert journal.outcome == outcome
    assert read_journal(b"".join(lines_of(journal))).outcome == outcome


def test_every_field_survives() -> None:
    chance = Random(6)
    for _ in range(100):
        check(random_outcome(chance))


def test_numbers_of_solutions_of_any_length() -> None:
    outcome = random_outcome(Random(1))
    for number in (2**63 - 1, 2**63, 2**64, 10**40):
        check(replace(outcome, count=number, optima=Optima(number, ({"a.x": 1},))))
        check(replace(outcome, count=number, optima=None))


# Costs in the user's numbers


def utilities() -> Team:
    product = Function("product", ("X", "Y"), parse("sub(mul(X,Y),1)", ("X", "Y"), Type.INTEGER))
    values = Domain("D", (range(3),))
    return assemble(
        "utilities",
        {"a": [Variable("x", values)], "b": [Variable("y", values)]},
        [Constraint("C", product, ("x", "y"), ("x", "y"))],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=1, constant=5),
    )


def test_a_journal_tells_costs_as_the_user_counts_them() -> None:
    team = utilities()
    recorder = JournalRecorder(
        Header(team=team.name, protocol="syncbb", runtime="simulator", seed=0), lambda: Objective(normalized(team))
    )
    outcome = solve(team, Options(protocol="syncbb", runtime=Runtime.SIMULATOR), observer=recorder)
    recorder.outcome = outcome
    content = recorder.content()
    journal = read_journal(content)
    assert journal.outcome == outcome
    assert outcome.cost == Decimal("3.5")
    costs = [event.cost for event in journal.events if isinstance(event, Improved)]
    assert costs == sorted(costs)
    assert costs[-1] == Decimal("3.5")
    given = next(event for event in journal.events if isinstance(event, Given))
    heard = [cost_in_user_units(given, event.cost) for event in journal.events if isinstance(event, Heard)]
    assert heard
    assert heard[-1] == Decimal("3.5")
    assert not replay(journal).contradictions
