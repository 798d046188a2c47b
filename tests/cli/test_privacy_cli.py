"""`robochoc privacy`: the table, JSON, the page, and the exit status."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner, Result

from robochoc.cli.group import cli
from robochoc.cli.reports.failures import INVALID, USAGE
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.modelling.model import Model


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, list(map(str, words)))


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The journal of a run of two queens' robots."""
    folder = tmp_path_factory.mktemp("privacy")
    write_team(queens3d(2), folder / "team")
    journal = folder / "run.journal"
    run("solve", folder / "team", "--protocol", "abt", "--runtime", "simulator", "--journal", journal, "--no-cache")
    return journal


def test_a_row_for_each_robot_and_each_measure_of_the_system(saved: Path) -> None:
    result = run("privacy", saved, "--no-cache")
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[2].split() == ["robot", "domain", "constraints"]
    assert [line.split("  ")[1] for line in lines[3:7]] == ["Robot1.1", "Robot1.2", "Robot2.1", "Robot2.2"]
    assert "no decisions: the run found no solution" in lines[-1]


def test_json_holds_every_pair(saved: Path) -> None:
    told = msgspec.json.decode(run("privacy", saved, "--json", "--no-cache").stdout)
    assert told["protocol"] == "abt"
    assert {(one["observer"], one["subject"]) for one in told["losses"] if one["kind"] == "domain"} == {
        (one, other) for one in told["robots"] for other in told["robots"] if one != other
    }


def test_a_folder_that_is_not_needed_is_not_ignored_without_a_word(saved: Path) -> None:
    plain, told = run("privacy", saved, "--no-cache"), run("privacy", saved, "--team", saved.parent / "team")
    assert told.exit_code == 0
    assert told.stderr == "--team is not used: the journal contains the robots' problems\n"
    assert told.stdout == plain.stdout
    assert not plain.stderr


def test_a_page_is_written_beside_the_table(saved: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert run("privacy", saved, "--html", page, "--measure", "known", "--no-cache").exit_code == 0
    assert "Loss by known" in page.read_text()


def test_a_run_that_is_not_there_is_wrong_usage(saved: Path) -> None:
    result = run("privacy", saved, "--run", 3, "--no-cache")
    assert result.exit_code == USAGE
    assert "the journal has no run 3, only 1" in result.output


def test_a_journal_that_ends_before_a_run_begins_is_not_measured(saved: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.journal"
    cut.write_bytes(saved.read_bytes()[:700])
    result = run("privacy", cut, "--no-cache")
    assert result.exit_code == USAGE
    assert result.output.strip().endswith("cut.journal: the journal ends before the beginning of a run")


def test_a_run_of_the_central_solver_has_no_messages(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    Model.of(queens3d(2)).solve("central", journal=path)
    result = run("privacy", path, "--no-cache")
    assert result.exit_code == USAGE
    assert "the central solver got the problems of all robots" in result.output


def test_what_is_no_journal_is_invalid(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("hello")
    assert run("privacy", tmp_path / "file").exit_code == INVALID


def test_a_run_that_has_lost_messages_is_refused_in_one_line(saved: Path, tmp_path: Path) -> None:
    journal = tmp_path / "lossy.journal"
    lossy = ["--protocol", "dba", "--runtime", "simulator", "--message-loss", "0.2", "--messages", "50"]
    run("solve", saved.parent / "team", *lossy, "--journal", journal, "--no-cache")
    refused = run("privacy", journal, "--no-cache")
    assert (refused.exit_code, refused.stdout) == (USAGE, "")
    assert refused.stderr == f"{journal}: messages were lost (--message-loss), and journals do not record which\n"
