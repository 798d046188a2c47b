"""`robochoc replay`: the table, the first difference, JSON, and the exit status."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from click.testing import CliRunner, Result
from replays import recorded, with_events
from test_replay import FOUR, without_given

from robochoc.cli.commands import cli
from robochoc.cli.failure import INVALID, LOST, USAGE
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.observers.events import Sent
from robochoc.observers.journal import Journal, Recorder

THE_SAME = """\
queens3d-2: abt, runtime simulator, seed 0
  runs                 2
  robots               4
  steps               31
  messages            42
  the same
"""


@pytest.fixture(scope="module")
def two() -> Journal:
    return recorded(queens3d(2), FOUR)


def written(journal: Journal, path: Path) -> Path:
    """The journal as a file."""
    recorder = Recorder(journal.header)
    for event in journal.events:
        recorder(event)
    recorder.outcome = journal.outcome
    path.write_bytes(recorder.content())
    return path


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, ["replay", *map(str, words)])


def changed(journal: Journal) -> Journal:
    events = list(journal.events)
    place = next(place for place, event in enumerate(events) if isinstance(event, Sent))
    events[place] = msgspec.structs.replace(events[place], content={"value": [2]})
    return with_events(journal, events)


def test_the_same(two: Journal, tmp_path: Path) -> None:
    result = run(written(two, tmp_path / "journal"), "--no-cache")
    assert result.output == THE_SAME
    assert result.exit_code == 0


def test_the_first_difference(two: Journal, tmp_path: Path) -> None:
    result = CliRunner().invoke(
        cli, ["replay", str(written(changed(two), tmp_path / "journal"))], standalone_mode=False
    )
    assert result.return_value == LOST
    assert result.output.endswith(
        """\
  different, first in step 0 of Robot1.1 in run 0 (ABT)
    it began
    recorded  said Ok to Robot1.2: {"value":[2]}, 6 bytes (clock 0)
    replayed  said Ok to Robot1.2: {"value":[1]}, 6 bytes (clock 0)
    differs   in value
"""
    )


def test_the_same_in_json(two: Journal, tmp_path: Path) -> None:
    told: dict[str, Any] = msgspec.json.decode(run(written(two, tmp_path / "journal"), "--json").output)
    assert told["identical"] is True
    assert (told["robots"], told["difference"], told["stopped"], told["ended"]) == (4, None, [], True)
    told = msgspec.json.decode(run(written(changed(two), tmp_path / "other"), "--json").output)
    assert told["identical"] is False
    assert told["difference"]["recorded"]["content"] == {"value": [2]}
    assert told["difference"]["replayed"]["content"] == {"value": [1]}


def test_one_that_breaks_off(two: Journal, tmp_path: Path) -> None:
    recorder = Recorder(two.header)
    for event in two.events[: len(two.events) // 2]:
        recorder(event)
    (tmp_path / "journal").write_bytes(recorder.content())
    result = run(tmp_path / "journal")
    assert result.exit_code == 0
    assert "the journal does not say how the run ended" in result.output
    assert result.output.endswith("the same, as far as it goes\n")


def test_files_for_a_journal_that_has_none(two: Journal, tmp_path: Path) -> None:
    path = written(without_given(two), tmp_path / "journal")
    refused = run(path)
    assert refused.exit_code == USAGE
    assert "name the folder with the team's files: --team DIR" in refused.output
    write_team(queens3d(2), tmp_path / "team")
    result = run(path, "--team", tmp_path / "team")
    assert "robots               4" in result.output


@pytest.mark.parametrize("content", [b"", b"no journal", b'{"event":"Journal"'])
def test_what_is_no_journal(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "journal"
    path.write_bytes(content)
    result = run(path)
    assert result.exit_code == INVALID
    assert "give what 'robochoc solve --journal' wrote" in result.output
    assert run(tmp_path / "nowhere").exit_code == INVALID
