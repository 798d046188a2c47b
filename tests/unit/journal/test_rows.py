"""Journals as rows: plain values under the same keys, for pandas and polars."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import robochoc
from robochoc.journal.as_rows import COLUMNS
from robochoc.journal.journal import JournalError
from tests.support.program import ROOT, robochoc_within

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
