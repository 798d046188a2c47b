"""The benchmark against other libraries tells what each found, and which of them are not there."""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from robochoc.generators.coloring import coloring
from robochoc.generators.random_csp import random_csp
from tests.support.limits import HANG_S
from tests.support.program import ROOT

VARIABLES = tuple(f"ROBOCHOC_BENCH_{name}" for name in ("RAVEN", "PYDCOP", "FRODO", "PROPFLOW", "CENTRAL"))
FAMILIES = ("COLOURING", "LOOSE", "TIGHT", "COSTS", "LOCAL")


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 - a module's names are known when it is there
    """Import a module of benchmarks/, as its scripts do, where no other library is installed."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    for variable in VARIABLES:
        monkeypatch.delenv(variable, raising=False)

    def module(name: str) -> ModuleType:
        return importlib.import_module(name)

    return module


def result(load: Any, found: str | None, seed: int = 0) -> Any:  # noqa: ANN401
    run = load("peer_runs").Run(1.5, 1.25, 30.0, None if found is None else 0, "", "")
    answer = None if found is None else load("contestants").Answer(found, 7)
    return load("peers").Result(seed, run, answer)


def row(load: Any, family: str, *results: tuple[str | None, str]) -> tuple[str, ...]:  # noqa: ANN401
    """The line of a contestant that found so much where something else is right."""
    one = load("contestants").robochoc("abt", "simulator")
    told = [(result(load, found, seed), truth) for seed, (found, truth) in enumerate(results)]
    line: tuple[str, ...] = load("peers").row_of(one, getattr(load("peer_problems"), family), told)
    return line


def test_a_run_is_timed_and_its_output_kept(load: Any) -> None:  # noqa: ANN401
    run = load("peer_runs").watched([sys.executable, "-c", "import sys; print('ja'); sys.exit(3)"], HANG_S)
    assert (run.status, run.output, run.errors) == (3, "ja\n", "")
    assert run.cpu_s > 0
    assert 0 < run.wall_s < HANG_S
    assert run.peak_mb > 1
    small = load("peer_runs").watched(["true"], 60)
    ballast = b"x" * (40 << 20)
    assert load("peer_runs").watched(["true"], 60).peak_mb < small.peak_mb + len(ballast) / (1 << 20) / 2


def test_a_run_is_cut_off_with_all_that_it_started(load: Any) -> None:  # noqa: ANN401
    """A child that held the pipe of its parent open would keep it waiting."""
    endless = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'while True: pass'])"
    run = load("peer_runs").watched([sys.executable, "-c", endless], 0.2)
    assert run.status is None
    assert run.wall_s < HANG_S


def test_nobody_is_left_behind(load: Any, tmp_path: Path) -> None:  # noqa: ANN401
    """A child that holds a pipe for writing: its reader is at the end once the child is gone."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    child = "import subprocess, sys; subprocess.Popen(['sh', '-c', 'exec sleep 1000'], stdout=open(sys.argv[1], 'w'))"
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    load("peer_runs").watched([sys.executable, "-c", child, str(pipe)], 60)
    os.set_blocking(reader, True)
    assert os.read(reader, 1) == b""
    os.close(reader)


@pytest.mark.more
def test_a_run_is_cut_off_when_its_cpu_is_spent(load: Any) -> None:  # noqa: ANN401
    run = load("peer_runs").watched([sys.executable, "-c", "while True: pass"], 100, 1)
    assert run.status is None
    assert run.wall_s < 100


@pytest.mark.parametrize("family", FAMILIES)
def test_absence_is_told(load: Any, family: str) -> None:  # noqa: ANN401
    problems, peers = load("peer_problems"), load("peers")
    chosen = getattr(problems, family)
    entries = load("contestants").contestants(chosen)
    assert len(set(entries)) == len(entries)
    rows = [peers.row_of(one, chosen, []) for one in entries if one.library != "robochoc"]
    assert rows
    assert all(row[3].startswith("skipped: ") and row[4:] == ("-",) * 4 for row in rows)
    assert all(len(row) == len(peers.HEAD) for row in rows)
    assert not [one for one in entries if one.library == "robochoc" and one.missing]


def test_a_wrong_path_to_frodo_is_told(
    load: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setenv("ROBOCHOC_BENCH_FRODO", str(tmp_path))
    entries = load("contestants").contestants(load("peer_problems").TIGHT)
    missing = {one.missing for one in entries if one.library == "FRODO"}
    assert missing == {
        f"ROBOCHOC_BENCH_FRODO: no agents/{name}.xml there" for name in ("AFB/AFBagent", "SynchBB/SynchBBagent")
    }


def test_answers_are_held_against_the_right_one(load: Any) -> None:  # noqa: ANN401
    line = row(
        load, "TIGHT", ("solution", "solution"), ("0", "solution"), ("no-solution", "solution"), (None, "solution")
    )
    assert line[3] == "2 of 4 right; WRONG (no-solution, not solution): seed 2; over the limit: seed 3; not run: seed 4"
    assert line[4:] == ("7", "1.25", "1.50", "30")
    assert row(load, "TIGHT", ("0", "no-solution"))[3] == "0 of 1 right; WRONG (0, not no-solution): seed 0"
    assert row(load, "COSTS", ("17", "17"), ("18", "17"))[3] == "1 of 2 right; WRONG (18, not 17): seed 1"
    assert row(load, "COSTS", ("failed: no memory", "17"))[3] == "0 of 1 right; failed: no memory: seed 0"
    assert row(load, "TIGHT", ("not in this version", "solution"))[3:] == ("not in this version", *["-"] * 4)


def test_who_is_cut_off_is_spared_the_others(load: Any) -> None:  # noqa: ANN401
    line = row(load, "TIGHT", ("solution", "solution"), (None, "solution"))
    assert line[3] == "1 of 2 right; over the limit: seed 1; not run: seed 2, 3, 4"


def test_local_search_is_told_by_its_costs(load: Any) -> None:  # noqa: ANN401
    assert row(load, "LOCAL", ("110", ""), ("120", ""), (None, ""))[3] == "cost 115 (110..120); over the limit: seed 2"


def test_only_who_answers_everything_is_fastest(load: Any) -> None:  # noqa: ANN401
    tight, contestants = load("peer_problems").TIGHT, load("contestants")
    able, quick = contestants.robochoc("sfb", "simulator"), contestants.robochoc("abt", "simulator")
    slow = result(load, "solution")
    fast = load("peers").Result(0, slow.run._replace(cpu_s=0.1), None)
    rows = load("peers").fastest({tight: {quick: [(fast, "solution")], able: [(slow, "solution")]}})
    assert rows[1:] == [("<20,10,.25,.72>", "robochoc", "sfb", "simulator", "1.25", "1.50")]


def test_problems_are_written_for_all(load: Any, tmp_path: Path) -> None:  # noqa: ANN401
    problems = load("peer_problems")
    problems.write_problem(coloring(2, 2, 1, conflicts="hard"), tmp_path / "hard")
    told = json.loads((tmp_path / "hard" / "raven.json").read_text())
    assert told == {"domains": {"V1": [1, 2], "V2": [1, 2]}, "constraints": [[["V1", "V2"], [[1, 1], [2, 2]]]]}
    assert b"<predicate" not in (tmp_path / "hard" / "frodo.xml").read_bytes()
    colouring = load("colouring").colouring(0)
    tables = problems.in_tables(colouring)
    assert [one.variables for one in tables.constraints()] == [one.variables for one in colouring.constraints()]
    assert {one.definition.tuples for one in tables.constraints()} == {((0, 0), (1, 1), (2, 2))}
    problems.write_problem(random_csp(3, 2, 1, 0, max_cost=5), tmp_path / "costs")
    files = {"team", "frodo.xml", "pydcop.yaml", "problem.xml", "tables.json"}
    assert {path.name for path in (tmp_path / "costs").iterdir()} == files
    told = json.loads((tmp_path / "hard" / "tables.json").read_text())
    assert told["constraints"] == [[["V1", "V2"], [None, 0, 0, None]]]


@pytest.mark.more
def test_a_contestant_solves(load: Any, tmp_path: Path) -> None:  # noqa: ANN401
    load("peer_problems").write_problem(coloring(3, 2, 2, conflicts="hard"), tmp_path / "triangle")
    one = load("contestants").robochoc("abt", "simulator")
    found = load("peers").solved(one, tmp_path / "triangle", 0, load("peer_problems").TIGHT)
    assert found.answer.found == "no-solution"
    assert found.answer.messages > 0
    unknown = load("contestants").robochoc("nobody", "simulator")
    assert (
        load("peers").solved(unknown, tmp_path / "triangle", 0, load("peer_problems").TIGHT).answer.found
        == "not in this version"
    )


def test_frodo_is_set_and_read(load: Any, tmp_path: Path) -> None:  # noqa: ANN401
    contestants = load("contestants")
    text = '<agent measureTime = "true" measureMsgs="true"> displayGraph = "true" countNCCCs = "true"'
    expected = '<agent measureTime = "false" measureMsgs="true"> displayGraph = "false" countNCCCs = "true"'
    assert contestants.described(text, simulates_time=False, counts=True) == expected
    frodo = next(one for one in contestants.contestants(load("peer_problems").TIGHT) if one.library == "FRODO")
    table = tmp_path / "frodo.csv"
    head = "timed out;number of messages;true cost\n1;2147483647;NaN\n"
    run = result(load, "").run
    for line, answer in (
        ("", ("its time is over", None)),
        ("0;0;infinity\n", ("no-solution", None)),
        ("0;9;null\n", ("no answer", None)),
        ("0;12;7\n", ("7", 12)),
    ):
        table.write_text(head + line)
        assert frodo.answer(tmp_path, run) == answer


def test_pydcop_and_raven_are_read(load: Any, tmp_path: Path) -> None:  # noqa: ANN401
    entries = load("contestants").contestants(load("peer_problems").TIGHT)
    read = {one.library: one.answer for one in entries}
    run = result(load, "").run
    for told, answer in (
        ({"status": "FINISHED", "cost": 10100, "msg_count": 5}, ("no-solution", 5)),
        ({"status": "FINISHED", "cost": 0.0, "msg_count": 5}, ("0", 5)),
        ({"status": "TIMEOUT", "cost": 0, "msg_count": 5}, ("status TIMEOUT", None)),
    ):
        assert read["pyDCOP"](tmp_path, run._replace(output=f"Deploy\n{json.dumps(told)}")) == answer
    for solved, verdict in ((True, "solution"), (False, "no-solution")):
        output = json.dumps({"solved": solved, "messages": 9})
        assert read["raven-csp"](tmp_path, run._replace(output=output)) == (verdict, 9)


def test_the_load_of_the_machine_is_told(load: Any) -> None:  # noqa: ANN401
    told = load("peers").load_told([3.2, 90.7, 12.0])
    assert told == f"The machine's load meanwhile: 3 to 91 on {os.cpu_count()} cores."


def test_tables_of_a_section_may_have_captions(load: Any) -> None:  # noqa: ANN401
    rows = [("a", "b"), ("1", "2")]
    section = load("report").Section("part", "Title", "Notes.", (rows, rows), ("first", "second"))
    lines = [line for line in str(section).splitlines() if line]
    assert [line for line in lines if line.startswith("#")] == ["## Title", "### first", "### second"]
    assert lines.count("| 1 | 2 |") == 2
