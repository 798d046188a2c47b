"""What the command line writes and reads again: journals, pages, standard streams, folders with odd names."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.journal import read_journal
from tests.support.cases import cases
from tests.support.journal_entries import entries_of
from tests.support.limits import HANG_S
from tests.support.program import PROGRAM, ROOT, robochoc_within


def test_a_journal_and_a_result_give_the_page_that_solve_gives(four: Path) -> None:
    folder = four.parent
    done = robochoc_within(
        *("solve", four, "--withdraw", "--runtime", "simulator", "--json"),
        *("--journal", folder / "run.jsonl", "--html", folder / "solve.html"),
    )
    (folder / "result.json").write_text(done.stdout)
    for words in (("run.jsonl",), ("run.jsonl", "--team", four), ("result.json", "--team", four)):
        page = folder / "animated.html"
        assert robochoc_within("animate", folder / words[0], *words[1:], "-o", page).returncode == 0
        assert page.read_bytes() == (folder / "solve.html").read_bytes()
    assert robochoc_within("animate", folder / "result.json", "-o", folder / "alone.html").returncode == 0


def test_animate_refuses_what_is_neither(tmp_path: Path) -> None:
    with cases() as each:
        for content in [
            "",
            "{}",
            "nonsense",
            '{"event":"Journal"}',
            '{"event":"Journal","team":"x"}\n{',
            "[" * 100_000,
            "\xff",
        ]:
            with each(content[:20]):
                saved = tmp_path / "saved"
                saved.write_text(content, encoding="latin-1")
                done = robochoc_within("animate", saved, "-o", tmp_path / "page.html")
                assert done.returncode == 1
                assert len(done.stderr.splitlines()) == 1
                assert not (tmp_path / "page.html").exists()


def test_animate_refuses_another_team(four: Path) -> None:
    saved = four.parent / "result.json"
    saved.write_text(robochoc_within("solve", four, "--withdraw", "--runtime", "simulator", "--json").stdout)
    other = ROOT / "docs" / "examples" / "scouts"
    done = robochoc_within("animate", saved, "--team", other, "-o", four.parent / "page.html")
    assert done.returncode == 1
    assert "the team in this folder is not" in done.stderr


def test_animate_says_what_is_missing(tmp_path: Path) -> None:
    assert robochoc_within("animate", tmp_path / "nothing", "-o", tmp_path / "page.html").returncode == 1
    assert robochoc_within("animate", tmp_path / "nothing").returncode == 2


def test_an_output_that_cannot_be_written_is_said_before_the_work(four: Path) -> None:
    for place in ["no/such/folder/page", "queens3d-4", "queens3d-4/Robot1.1.xml/page"]:
        for option in ("--html", "--journal"):
            done = robochoc_within("solve", four, option, four.parent / place)
            assert done.returncode == 2
            assert option in done.stderr
            assert done.stdout == ""


def test_what_goes_to_standard_output_does_not_replace_it(four: Path) -> None:
    log = four.parent / "log"
    log.write_text("precious\n")
    with log.open("a") as out:
        words = [PROGRAM, "solve", str(four), "--json", "--runtime", "simulator", "--journal", "/dev/stdout"]
        subprocess.run(words, stdout=out, check=True)
    precious, _, journal = log.read_bytes().partition(b"\n")
    assert precious == b"precious"
    found = read_journal(journal)
    assert found.outcome is not None
    assert found.outcome.verdict == "no-solution"
    assert str(found.damage).endswith("there are entries after the end")
    told = journal[journal.rindex(b'{"team":') :]
    assert json.loads(told)["verdict"] == "no-solution"


@pytest.mark.parametrize(
    ("runtime", "closed"),
    [
        *((runtime, "0<&- 1>&- 2>&-") for runtime in ("processes", "simulator")),
        *(
            pytest.param(runtime, closed, marks=pytest.mark.more)
            for runtime in ("processes", "simulator")
            for closed in ("0<&-", "1>&-", "2>&-")
        ),
    ],
)
def test_closed_streams_do_no_harm(four: Path, runtime: str, closed: str) -> None:
    journal = four.parent / "run.jsonl"
    command = f"{PROGRAM} solve {four} --json --runtime {runtime} --journal {journal} {closed}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=HANG_S, check=False)  # noqa: S602
    assert done.returncode == 0
    assert done.stderr == ""
    assert entries_of(journal)[-1]["outcome"]["verdict"] == "no-solution"


def test_a_run_that_is_refused_leaves_an_older_journal_alone(four: Path, tmp_path: Path) -> None:
    older = tmp_path / "older.journal"
    older.write_bytes(b"older")
    done = robochoc_within("solve", four, "--protocol", "dsa", "--withdraw", "--journal", older)
    assert done.returncode == 2, done.stderr
    assert older.read_bytes() == b"older"


def test_a_full_disk_is_said_after_the_verdict(four: Path) -> None:
    done = robochoc_within("solve", four, "--runtime", "simulator", "--journal", "/dev/full")
    assert done.returncode == 1
    assert done.stderr.startswith("/dev/full: the journal could not be written completely: No space left on device (")
    assert len(done.stderr.splitlines()) == 1
    assert "no solution" in done.stdout


def test_folders_whose_names_are_no_text(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe\n\x1b[31m"))
    write_team(queens3d(2), folder)
    for words in (["validate"], ["validate", "--json"], ["solve"], ["solve", "--json"]):
        done = robochoc_within(*words, folder)
        assert done.returncode == 0
        assert "\x1b" not in done.stdout


def test_deeply_nested_folders_are_searched(tmp_path: Path) -> None:
    bottom = tmp_path.joinpath(*["d"] * 1200)
    subprocess.run(["mkdir", "-p", str(bottom)], check=True)
    try:
        write_team(queens3d(1), bottom / "team")
        assert robochoc_within("validate", tmp_path).returncode == 0
    finally:  # pytest, which cleans up by recursion, could not
        subprocess.run(["rm", "-r", str(tmp_path / "d")], check=True)


def test_generate_into_this_folder(tmp_path: Path) -> None:
    done = robochoc_within("generate", "queens3d", "--n", 2, "-o", ".", "--force", folder=tmp_path)
    assert done.returncode == 0
    assert read_team(tmp_path) == replace(queens3d(2), name=tmp_path.name)
