"""`robochoc solve --order`, and files that list an order."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robochoc.cli.options.order import NAMES
from robochoc.formats import InvalidInputError, read_team, write_team
from robochoc.formats.order_file import read_order
from robochoc.journal.journal import read_journal
from robochoc.model.orders import Order
from tests.support.journal_entries import entries_of
from tests.support.program import robochoc_within
from tests.support.small_teams import graph_team, pkc_team


def test_the_command_line_knows_every_order() -> None:
    assert set(NAMES) == set(Order)


@pytest.mark.parametrize("runtime", ["simulator", pytest.param("processes", marks=pytest.mark.more)])
def test_solve_in_an_order_by_name(four: Path, runtime: str) -> None:
    journal = four.parent / "run.jsonl"
    words = ["solve", four, "--json", "--runtime", runtime, "--seed", 5, "--journal", journal]
    done = robochoc_within(*words, "--order", "random")
    assert (done.returncode, json.loads(done.stdout)["verdict"]) == (0, "no-solution")
    assert read_journal(journal.read_bytes()).header.order == "random"
    assert robochoc_within(*words, "--order", "given").returncode == 0
    assert "order" not in entries_of(journal)[0]
    assert robochoc_within(*words, "--protocol", "abt").returncode == 0
    assert "order" not in entries_of(journal)[0]
    assert robochoc_within(*words).returncode == 0
    assert entries_of(journal)[0]["order"] == "min-width"


def test_solve_in_the_order_of_a_file(four: Path) -> None:
    names = list(reversed(read_team(four).order))
    listed, journal = four.parent / "order.txt", four.parent / "run.jsonl"
    listed.write_text("# from the end\n\n" + "\n".join(f"  {name}  # {name}" for name in names), encoding="utf-8-sig")
    words = ["solve", four, "--order", listed, "--runtime", "simulator", "--json", "--journal", journal]
    done = robochoc_within(*words)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "no-solution"
    lines = entries_of(journal)
    assert lines[0]["order"] == names
    assert lines[-1]["outcome"]["witness"] == "Robot4.4"


def test_every_mistake_of_an_order_file_is_told_with_its_line(tmp_path: Path) -> None:
    for content, told in [
        ("RA\nRB\n", [(2, "1 robot is missing: RC")]),
        ("", [(1, "3 robots are missing: RA RB RC")]),
        ("RA\n\nRX # who\nRC\nRB\n", [(3, "'RX' is not a robot of random")]),
        ("RC\nRB\nRA\nRB\n", [(4, "'RB' is listed twice")]),
        ("RC\nRC\nRX\nRA RB\n", [(2, "twice"), (3, "'RX'"), (4, "'RA RB'"), (4, "2 robots are missing: RA RB")]),
    ]:
        listed = tmp_path / "order.txt"
        listed.write_text(content)
        with pytest.raises(InvalidInputError) as caught:
            read_order(listed, graph_team(["AB", "BC"]))
        found = caught.value.diagnostics
        assert [one.line for one in found] == [line for line, _ in told]
        assert all(words in one.message for one, (_, words) in zip(found, told, strict=True))
        assert all(one.file == str(listed) and one.hint for one in found)


def test_a_wrong_order_file_is_invalid_input(four: Path) -> None:
    listed = four.parent / "order.txt"
    listed.write_text("Robot1.1\nRobot9.9\n")
    done = robochoc_within("solve", four, "--order", listed)
    assert done.returncode == 1
    assert done.stdout == ""
    first, second = done.stderr.splitlines()
    assert first.startswith(f"{listed}:2: 'Robot9.9' is not a robot of queens3d-4")
    assert second.startswith(f"{listed}:2: 15 robots are missing: Robot1.2")


@pytest.mark.parametrize(
    ("content", "said"), [(b"\xff\xfe", "UTF-8"), (b"#" * 2_000_000, "MiB"), (None, "cannot be read: Is a directory")]
)
def test_what_is_no_text_is_no_order(tmp_path: Path, content: bytes | None, said: str) -> None:
    listed = tmp_path / "order.txt"
    listed.mkdir() if content is None else listed.write_bytes(content)
    with pytest.raises(InvalidInputError, match=said):
        read_order(listed, graph_team(["AB"]))


def test_links_that_cannot_be_turned_are_said_in_one_sentence(tmp_path: Path) -> None:
    write_team(pkc_team(), tmp_path / "private")
    listed = tmp_path / "order.txt"
    listed.write_text("RX\nRB\nRA\n")
    done = robochoc_within("solve", tmp_path / "private", "--order", listed)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "choose an order with RA before it" in done.stderr


def test_dom_deg_may_be_written_as_elsewhere(four: Path) -> None:
    words = ["solve", four, "--json", "--runtime", "simulator"]
    assert [
        json.loads(robochoc_within(*words, "--order", name).stdout)["metrics"]["messages"]
        for name in ("dom/deg", "dom-deg")
    ] == [json.loads(robochoc_within(*words, "--order", "dom-deg").stdout)["metrics"]["messages"]] * 2
