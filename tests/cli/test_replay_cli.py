"""`robochoc replay`: the table, the first difference, JSON, and the exit status."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from click.testing import CliRunner, Result

from robochoc.cli.group import cli
from robochoc.cli.reports.failures import INVALID, LOST, USAGE
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Sent
from robochoc.journal.journal import Journal, JournalRecorder, lines_of
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics
from robochoc.run.options import Options, Runtime, Withdrawal
from tests.support.problems import team_of
from tests.support.replays import recorded, with_events, without_given

THE_SAME = """\
queens3d-2: abt, runtime simulator, seed 0
  runs                 2
  robots               4
  steps               31
  messages            41
  the same
"""


@pytest.fixture(scope="module")
def two() -> Journal:
    return recorded(queens3d(2), Options(protocol="abt", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM))


def written(journal: Journal, path: Path) -> Path:
    """The journal as a file."""
    recorder = JournalRecorder(journal.header)
    for event in journal.events:
        recorder(event)
    recorder.outcome = journal.outcome
    path.write_bytes(recorder.content())
    return path


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, ["replay", *map(str, words)])


def ended(*words: object) -> tuple[int, str]:
    """The exit status, and what was printed."""
    result = CliRunner().invoke(cli, ["replay", *map(str, words)], standalone_mode=False)
    assert isinstance(result.return_value, int), result.exception
    return result.return_value, result.output


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
  first difference: step 0 of Robot1.1 in run 0 (ABT)
    its start
    recorded  sent Ok to Robot1.2: {"value":[2]}, 6 bytes (clock 0)
    replayed  sent Ok to Robot1.2: {"value":[1]}, 6 bytes (clock 0)
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
    recorder = JournalRecorder(two.header)
    for event in two.events[: len(two.events) // 2]:
        recorder(event)
    (tmp_path / "journal").write_bytes(recorder.content())
    result = run(tmp_path / "journal")
    assert result.exit_code == 0
    assert "the journal does not contain the end of the run" in result.output
    assert result.output.endswith("the same, as far as the journal could be replayed\n")


def test_one_that_was_altered_is_invalid_and_names_the_place(two: Journal, tmp_path: Path) -> None:
    content = written(two, tmp_path / "journal").read_bytes()
    for place in (len(content) - 1, len(content) // 2):
        (tmp_path / "other").write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        status, said = ended(tmp_path / "other")
        assert status == INVALID
        assert "as far as it goes" not in said
        assert "the journal was altered: byte " in said
        assert "the checksum of a block is wrong" in said
    told: dict[str, Any] = msgspec.json.decode(ended(tmp_path / "other", "--json")[1])
    assert (told["truncated"], "checksum" in told["damage"]) == (False, True)


def test_what_stands_before_the_damage_is_played(two: Journal, tmp_path: Path) -> None:
    lines = list(lines_of(two))
    lines[-5] = b"{}\n"
    (tmp_path / "journal").write_bytes(b"".join(lines))
    status, said = ended(tmp_path / "journal")
    assert status == INVALID
    assert f"the journal was altered: line {len(lines) - 4}: " in said
    assert said.endswith("the same up to the damage; but the journal was altered after it was written\n")


def test_one_without_its_end_says_how_far_it_goes(two: Journal, tmp_path: Path) -> None:
    for content in (b"".join(lines_of(two)), many_blocks(two)):
        (tmp_path / "journal").write_bytes(content[:-9])
        status, said = ended(tmp_path / "journal")
        assert status == 0
        assert "the journal ends early: " in said
        assert said.endswith("the same, as far as the journal could be replayed\n")


def many_blocks(journal: Journal) -> bytes:
    """The journal of a run that told of each event at once."""
    recorder = JournalRecorder(journal.header)
    for event in journal.events:
        recorder(event)
        recorder.flush()
    return recorder.content()


def test_where_nothing_is_compared_there_is_no_success(two: Journal, tmp_path: Path) -> None:
    broken = replace(two, outcome=None)
    for journal in (replace(two, events=()), replace(broken, events=()), replace(broken, events=two.events[:2])):
        (tmp_path / "journal").write_bytes(b"".join(lines_of(journal)))
        status, said = ended(tmp_path / "journal")
        assert status == INVALID
        assert "nothing was compared" in said
        told: dict[str, Any] = msgspec.json.decode(ended(tmp_path / "journal", "--json")[1])
        assert told["identical"] is False


def test_a_run_that_was_decided_before_any_robot_began_is_no_failure(tmp_path: Path) -> None:
    none = Relation("none", 1, Semantics.CONFLICTS, ((1,), (2,)))
    differ = Relation("differ", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    constraints = [Constraint("D", differ, ("A", "B"), ("A", "B")), Constraint("N", none, ("B",), ("B",))]
    team = team_of(dict.fromkeys("AB", (1, 2)), constraints)
    journal = recorded(team, Options(protocol="abt", runtime=Runtime.SIMULATOR))
    status, said = ended(written(journal, tmp_path / "journal"))
    assert status == 0
    assert said.endswith("no steps to compare: the run was decided before it began, as RB has no local solution\n")
    assert msgspec.json.decode(ended(tmp_path / "journal", "--json")[1])["decided_before"] is True
    other = replace(journal, header=msgspec.structs.replace(journal.header, seed=7))
    assert ended(written(other, tmp_path / "other"))[0] == LOST


def test_a_run_without_robots_has_nothing_to_be_compared(tmp_path: Path) -> None:
    content = recorded(queens3d(2), Options(protocol="central"))
    assert ended(written(content, tmp_path / "journal"))[0] == INVALID


def test_a_verdict_that_does_not_follow_is_a_difference(two: Journal, tmp_path: Path) -> None:
    assert two.outcome is not None
    path = written(replace(two, outcome=replace(two.outcome, verdict=Verdict.SOLUTION)), tmp_path / "journal")
    status, said = ended(path)
    assert status == LOST
    assert said.endswith(
        """\
  different, although all steps are the same:
    the outcome's verdict
      recorded  "solution"
      replayed  "optimal"
"""
    )


def test_files_for_a_journal_that_has_none(two: Journal, tmp_path: Path) -> None:
    path = written(without_given(two), tmp_path / "journal")
    refused = run(path)
    assert refused.exit_code == USAGE
    assert "give the folder of the team's files: --team DIR" in refused.output
    write_team(queens3d(2), tmp_path / "team")
    result = run(path, "--team", tmp_path / "team")
    assert "robots               4" in result.output


@pytest.mark.parametrize("content", [b"", b"no journal", b'{"event":"Journal"'])
def test_what_is_no_journal(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "journal"
    path.write_bytes(content)
    result = run(path)
    assert result.exit_code == INVALID
    assert "give a file of 'robochoc solve --journal'" in result.output
    assert run(tmp_path / "nowhere").exit_code == INVALID
