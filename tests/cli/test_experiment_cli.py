"""`robochoc experiment` and `robochoc compare`, as people use them."""

from __future__ import annotations

import csv
import io
import json
import os
import random
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest

from robochoc.experiments import read
from robochoc.experiments.plan import plan_of
from robochoc.experiments.results import journals
from robochoc.experiments.store import Store
from robochoc.experiments.task import Row, Status
from robochoc.formats import write_team
from robochoc.formats.diagnostics import InvalidInputError
from robochoc.generators.queens3d import queens3d
from robochoc.journal.journal import read_journal
from tests.support.cases import cases
from tests.support.faults import PROGRAM, running
from tests.support.limits import wait_until
from tests.support.program import robochoc_within
from tests.support.studies import COSTS, SMALL, RunsHere, altered, comparable, finished, results_of, study


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture
def runs_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process run what workers would."""
    monkeypatch.setattr("robochoc.experiments.runner.LocalWorkers", lambda *_: RunsHere())


def test_run_show_and_export(small: Path) -> None:
    planned = robochoc_within("experiment", "run", small, "--dry-run")
    assert planned.stdout.splitlines() == [
        "small: 12 runs: 6 problems, 2 ways to run (abt, afc-ng)",
        f"{small.with_suffix('.sqlite')}: 0 done, 12 to be run",
    ]
    assert not small.with_suffix(".sqlite").exists()
    done = robochoc_within("experiment", "run", small, "--jobs", 1)
    results = small.with_suffix(".sqlite")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == f"small: 12 runs: 12 done\n{results}: next: robochoc experiment show {results}\n"
    shown = robochoc_within("experiment", "show", results).stdout
    assert "small: 12 runs\n\nmessages, median\ntightness" in shown
    assert shown.count("median\n") == 3
    rows = read(results)
    median = sorted(row["ncccs"] for row in rows if row["label"] == "abt" and row["tightness"] == 0.5)[1]
    only = robochoc_within("experiment", "show", results, "--metric", "ncccs").stdout.splitlines()
    assert [line.split()[:2] for line in only if line.startswith("0.5")] == [["0.5", f"{median:,}"]]
    again = robochoc_within("experiment", "run", small, "--dry-run").stdout
    assert "12 done, 0 to be run" in again
    longer = small.with_name("longer.toml")
    longer.write_text(SMALL.replace("1..3", "1..5"))
    told = robochoc_within("experiment", "run", longer, "-o", results, "--dry-run").stdout
    assert "12 done, 8 to be run; about " in told


@pytest.mark.usefixtures("runs_here")
def test_journals_are_files_that_other_commands_read(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(f'record = "journal"\n{SMALL}')
    assert robochoc_within("experiment", "run", tmp_path / "study.toml").returncode == 0
    path = tmp_path / "study.sqlite"
    export = ("experiment", "export", path, "--format", "journals")
    refused = robochoc_within(*export)
    assert (refused.returncode, "name it with -o" in refused.stderr) == (2, True)
    done = robochoc_within(*export, "-o", tmp_path / "journals")
    assert (done.returncode, "12 journals" in done.stderr) == (0, True)
    rows = {row["key"]: row for row in read(path)}
    files = list((tmp_path / "journals").iterdir())
    assert {file.name for file in files} == {f"{key}.journal" for key in rows}
    for file in files:
        assert read_journal(file.read_bytes()).header.protocol == rows[file.stem]["protocol"]
    altered(path, "UPDATE journals SET content = x'00'", "UPDATE runs SET status = 'error'")
    assert robochoc_within("experiment", "run", tmp_path / "study.toml").returncode == 0
    assert {key for key, content in journals(path) if content != b"\0"} == set(rows)
    # A key that would be a path to another folder is refused.
    for table in ("plan", "journals"):
        altered(path, f"UPDATE {table} SET key = '../out' WHERE key = (SELECT min(key) FROM journals)")  # noqa: S608
    refused = robochoc_within(*export, "-o", tmp_path / "other")
    assert refused.returncode == 1
    assert "../out is not the key of a run" in refused.stderr
    assert not (tmp_path / "out.journal").exists()


def test_export(tmp_path: Path) -> None:
    finished(COSTS, tmp_path / "costs.sqlite")
    path = tmp_path / "costs.sqlite"
    rows = read(path)
    table = list(csv.DictReader(io.StringIO(robochoc_within("experiment", "export", path).stdout)))
    assert [(row["label"], int(row["messages"])) for row in table] == [(r["label"], r["messages"]) for r in rows]
    assert json.loads(table[0]["loads"]) == rows[0]["loads"]
    lines = robochoc_within("experiment", "export", path, "--format", "json").stdout.splitlines()
    assert [json.loads(line) for line in lines] == rows
    assert robochoc_within("experiment", "export", path, "-o", tmp_path / "table.tex").returncode == 0
    latex = (tmp_path / "table.tex").read_text()
    assert latex.count(r"\midrule") == 2 * 4 - 1
    assert latex.rstrip().endswith(r"\end{tabular}")
    assert r"dsa variant=A & dsa variant=B \\" in latex
    by_team = robochoc_within("experiment", "export", path, "--format", "summary", "--over", "team").stdout
    of_all = [row for row in csv.DictReader(io.StringIO(by_team)) if (row["team"], row["metric"]) == ("all", "cost")]
    assert [(row["label"], int(row["runs"])) for row in of_all] == [
        (label, sum(row["label"] == label for row in rows)) for label in dict.fromkeys(row["label"] for row in rows)
    ]
    refused = robochoc_within("experiment", "export", path, "--format", "parquet")
    assert (refused.returncode, "name a file with -o" in refused.stderr) == (2, True)
    parquet = pytest.importorskip("pyarrow.parquet")
    assert robochoc_within("experiment", "export", path, "-o", tmp_path / "costs.parquet").returncode == 0
    table = parquet.read_table(tmp_path / "costs.parquet").to_pylist()
    assert [row["messages"] for row in table] == [row["messages"] for row in rows]


def test_a_report_in_markdown(tmp_path: Path) -> None:
    pytest.importorskip("scipy")
    finished(COSTS + '[report]\neach = "agents"\nover = "cycles"\nmetrics = ["cost"]\n', tmp_path / "costs.sqlite")
    done = robochoc_within("experiment", "report", tmp_path / "costs.sqlite", "-o", tmp_path / "costs.md")
    assert (done.returncode, done.stderr) == (0, f"{tmp_path / 'costs.md'}: written\n")
    assert "### cost: agents 5\n\n| cycles | sfb |" in (tmp_path / "costs.md").read_text()
    shown = robochoc_within("experiment", "show", tmp_path / "costs.sqlite").stdout
    assert "cost, median, agents 5\ncycles" in shown


def test_ways_to_run_have_the_same_names_in_all_tables(tmp_path: Path) -> None:
    path = tmp_path / "costs.sqlite"
    names = 'names = { sfb = "SFB", "dsa variant=B" = "DSA-B" }'
    finished(f'{COSTS}[report]\n{names}\nover = "agents"\n', path)
    shown = robochoc_within("experiment", "show", path).stdout
    latex = robochoc_within("experiment", "export", path, "--format", "latex").stdout
    ways = ["SFB", "syncbb", "dsa variant=A", "DSA-B"]
    assert " & ".join(["messages, agents", *ways]) in latex
    assert all(way in shown for way in ways)
    assert "sfb" not in shown


def test_a_dry_run_knows_runs_that_another_plan_has_made(small: Path) -> None:
    finished(SMALL, small.with_suffix(".sqlite"))
    altered(small.with_suffix(".sqlite"), "DELETE FROM plan")
    planned = robochoc_within("experiment", "run", small, "--dry-run").stdout
    assert "12 done, 0 to be run" in planned


def test_what_a_file_says_does_not_reach_the_terminal_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text('title = "\\u001b[2J"\n' + SMALL)
    refused = robochoc_within("experiment", "run", path)
    assert (refused.returncode, "without control characters" in refused.stderr) == (1, True)
    path.write_text(SMALL)
    results = path.with_suffix(".sqlite")
    finished(SMALL, results)
    altered(
        results,
        "UPDATE plan SET label = char(27) || '[2J' || label, parameters = '{\"tightness\": \"\\u001b[3J\"}'",
        "UPDATE study SET title = char(27) || '[2J' || title, stopped = char(27) || '[2J'",
    )
    told = [robochoc_within("experiment", "show", results)]
    told.append(robochoc_within("experiment", "export", results, "--format", "latex"))
    assert [done.returncode for done in told] == [0, 0]
    assert not any("\x1b" in done.stdout + done.stderr for done in told)
    assert all("[2J" in done.stdout for done in told)


STRANGE = {
    "no study": "UPDATE study SET text = 'report = 5'",
    "a study of bytes": "UPDATE study SET text = x'ff'",
    "settings of a number": "UPDATE plan SET settings = '5'",
    "no settings": "UPDATE plan SET settings = 'null'",
    "endless messages": "UPDATE runs SET messages = 9e999",
    "a word for a number": "UPDATE runs SET messages = 'many'",
    "an unknown status": "UPDATE runs SET status = 'foo'",
    "no status": "UPDATE runs SET status = NULL",
    "no cost": "UPDATE runs SET cost = 'NaN'",
    "a cost without end": "UPDATE runs SET cost = '1e999999999'",
    "a cost beyond floats": "UPDATE runs SET cost = '1e350'",
    "broken points": "UPDATE runs SET cost_over_time = '[[5]]'",
    "points of a word": "UPDATE runs SET cost_over_time = '\"x\"'",
    "another view": "DROP VIEW results; CREATE VIEW results AS SELECT 1 AS one FROM plan",
}


def test_strange_content_is_a_message(small: Path) -> None:
    with cases() as each:
        for name, change in STRANGE.items():
            with each(name):
                path = small.with_suffix(".sqlite")
                finished(SMALL, path)
                altered(path, change)
                for words in (["show"], ["export"], ["export", "--format", "latex"]):
                    done = robochoc_within("experiment", *words, path)
                    assert (done.returncode, "contains no results of a study" in done.stderr) == (1, True), done.stderr


@pytest.mark.usefixtures("runs_here")
def test_what_has_failed_can_be_run_again(small: Path) -> None:
    path = small.with_suffix(".sqlite")
    whole = finished(SMALL, path)
    for status, row in zip(("invalid", "crashed", "refused", "memory"), whole.rows, strict=False):
        altered(path, f"UPDATE runs SET status = '{status}', messages = 1 WHERE key = '{row['key']}'")  # noqa: S608
    planned = robochoc_within("experiment", "run", small, "--dry-run")
    assert "10 done, 2 to be run" in planned.stdout
    assert robochoc_within("experiment", "run", small).returncode == 0
    assert [row["status"] for row in read(path)] == ["done", "done", "refused", "memory", *["done"] * 8]
    again = ["--again", "refused", "--again", "memory"]
    planned = robochoc_within("experiment", "run", small, "--dry-run", *again)
    assert "10 done, 2 to be run" in planned.stdout
    done = robochoc_within("experiment", "run", small, *again)
    assert done.returncode == 0
    assert comparable(path) == comparable(whole)


def test_results_that_are_removed_meanwhile_are_missed(small: Path) -> None:
    with Store(small.with_suffix(".sqlite")) as store:
        small.with_suffix(".sqlite").unlink()
        with pytest.raises(InvalidInputError, match="was removed while it was written to"):
            store.check_place()


def test_a_study_that_another_process_carries_out_is_refused(small: Path) -> None:
    with Store(small.with_suffix(".sqlite")):
        refused = robochoc_within("experiment", "run", small)
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "is being written to by another 'robochoc experiment run'" in refused.stderr


def test_mistakes_are_told(tmp_path: Path) -> None:
    with cases() as each:
        for words, status, said in [
            (["run", "nothing.toml"], 1, "nothing.toml: cannot be read"),
            (["show", "nothing.sqlite"], 1, "is not a file (give the file that 'robochoc experiment run' writes)"),
            (["export", "{}", "--format", "summary", "--over", "tight"], 2, "there is no parameter 'tight'; there are"),
            (["export", "{}", "--over", "team"], 2, "--over is for --format latex and summary, not for csv"),
            (["show", "{}", "--over", "tight"], 2, "there is no parameter 'tight'; there are agents,"),
            (["show", "{}", "--metric", "nccs"], 2, "there is no metric 'nccs'; there are messages,"),
            (["report", "{}", "-o", "page.html", "--over", "x"], 1, "there is no parameter 'x'"),
            (
                ["report", "{}", "-o", "figures.pdf"],
                2,
                "or a folder (without an extension) for figures in SVG and PDF",
            ),
            (["run", "{}.toml", "--scheduler", "tcp://x:1", "--dask", "y"], 1, "cannot be read"),
            (["run", "{}.toml", "-o", "/nothing/here.sqlite"], 2, "the folder /nothing does not exist"),
        ]:
            with each(words):
                if "report" in words:
                    pytest.importorskip("matplotlib")
                finished(SMALL, tmp_path / "s.sqlite")
                done = robochoc_within(
                    "experiment", *(word.format(tmp_path / "s.sqlite") for word in words), folder=tmp_path
                )
                assert done.returncode == status
                assert said in done.stderr
                assert not (tmp_path / "page.html").exists()


@pytest.mark.usefixtures("runs_here")
def test_a_contradiction_ends_with_status_4(small: Path) -> None:
    path = small.with_suffix(".sqlite")
    digest = finished(SMALL).rows[0]["digest"]
    with Store(path) as store:
        plan = plan_of(study(SMALL))
        store.start(study(SMALL), plan)
        store.add([(next(iter(plan)), Row(status=Status.DONE, verdict="no-solution", digest=digest, team="wrong"))])
    done = robochoc_within("experiment", "run", small)
    assert done.returncode == 4
    assert "small: stopped: " in done.stderr
    assert done.stderr.count("robochoc generate random --agents 6") == 2
    shown = robochoc_within("experiment", "show", path)
    assert "stopped: " in shown.stdout
    assert "contradict each other" in shown.stdout


@pytest.mark.usefixtures("runs_here")
def test_compare_a_family_and_folders(tmp_path: Path) -> None:
    words = "random agents=6 domain=3 density=0.5 tightness=0.2,0.5 seed=1..3 --protocols abt,AFC-ng"
    done = robochoc_within("compare", *words.split(), "--save", tmp_path / "kept.sqlite")
    assert done.returncode == 0, done.stderr
    assert "messages, median\ntightness" in done.stdout
    found, expected = (
        [(row["label"], row["messages"], row["ncccs"]) for row in rows]
        for rows in (read(tmp_path / "kept.sqlite"), finished(SMALL).rows)
    )
    assert found == expected
    for size in (2, 3):
        write_team(queens3d(size), tmp_path / f"queens-{size}")
    done = robochoc_within("compare", "queens-2", "queens-3", "--protocols", "abt,afc-ng", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "instance" in done.stdout
    assert not list(tmp_path.glob("compare*"))


@pytest.mark.usefixtures("runs_here")
def test_compare_combines_objectives_or_says_why_no_run_is_possible(tmp_path: Path) -> None:
    words = ("compare", "heights", "agents=3", "levels=2", "seed=1..2", "--protocols", "dpop,mgm")
    refused = robochoc_within(*words, folder=tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith("compare: every run was refused: heights-3-2-")
    assert len(refused.stderr.splitlines()) == 1
    done = robochoc_within(*words, "--objectives", "weighted:energy=1,risk=1", folder=tmp_path)
    assert done.returncode == 0
    assert "dpop        2" in done.stdout
    invalid = robochoc_within(*words, "--objectives", "energy", folder=tmp_path)
    assert (invalid.returncode, "is not a way to combine objectives" in invalid.stderr) == (2, True)


def test_objectives_of_a_study(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    for objectives, said in [
        ('"energy"', "'energy' is not a way to combine objectives"),
        ('["pareto", "lexicographic:a,b"]', "costs of different objectives cannot be compared"),
    ]:
        path.write_text(SMALL.replace("[runs]", f"[runs]\nobjectives = {objectives}"))
        refused = robochoc_within("experiment", "run", path)
        assert (refused.returncode, refused.stdout) == (1, "")
        assert said in refused.stderr


def test_what_compare_cannot_take_is_wrong_usage() -> None:
    for words, said in [
        ("random --protocols ,", "--protocols is empty"),
        ("rando --protocols abt", "did you mean 'random'?"),
        ("random agents --protocols abt", "random requires NAME=VALUE, not 'agents'"),
        ("random agents=3 --protocols abt --set x", "--set requires NAME=VALUE"),
    ]:
        done = robochoc_within("compare", *words.split())
        assert (done.returncode, said in done.stderr) == (2, True), done.stderr


@pytest.mark.parametrize(
    "strikes",
    [pytest.param(3, id="three", marks=pytest.mark.more), pytest.param(50, id="fifty", marks=pytest.mark.slow)],
)
def test_whoever_is_killed_nothing_is_lost_and_nothing_is_there_twice(strikes: int, tmp_path: Path) -> None:
    """The runner, or one of its workers, or both at once, at random moments; SIGINT and SIGTERM, too."""
    text = SMALL.replace("1..3", "1..20")
    (tmp_path / "study.toml").write_text(text)
    results = tmp_path / "study.sqlite"
    chance = random.Random(strikes)
    for strike in range(strikes):
        if strike % 10 == 0:
            results.unlink(missing_ok=True)
        command = [PROGRAM, "experiment", "run", str(tmp_path / "study.toml"), "--jobs", "2"]
        with running(command, tmp_path / f"run{strike}") as run:
            run.wait_until_listening()
            time.sleep(chance.uniform(0, 1.5))
            victims = run.processes() if strike % 3 == 0 else [run.pid]
            for pid in victims:
                if pid == run.pid or chance.random() < 0.5:
                    _strike(pid, chance.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT]))
            run.end()
            assert run.left_behind() == []
            assert "Traceback" not in run.errors()
    done = robochoc_within("experiment", "run", tmp_path / "study.toml")
    assert done.returncode == 0, done.stderr
    assert comparable(results) == comparable(results_of(text))


def _strike(pid: int, signum: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signum)


def test_workers_end_with_their_runner(tmp_path: Path) -> None:
    """A worker that is at a long run does not outlive the runner, and leaves nothing."""
    (tmp_path / "study.toml").write_text(_LONG)
    command = [PROGRAM, "experiment", "run", str(tmp_path / "study.toml"), "--jobs", "2"]
    with running(command, tmp_path / "run") as run:
        wait_until(lambda: len(run.processes()) == 3, "the workers never start")
        run.strike(signal.SIGKILL)
        run.end()
        assert run.left_behind() == []


_LONG = """
[problems]
family = "random"
agents = 40
domain = 10
density = 0.2
tightness = 0.45
seed = "1..4"
[runs]
protocol = "awc"
"""
