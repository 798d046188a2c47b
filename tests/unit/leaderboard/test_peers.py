"""Other tools on the leaderboard: their answers are checked, their claims compared, and their programs ended.

The programs are scripts that write what a tool documents. Nothing here runs the tools themselves.
"""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import pytest

from robochoc.experiments.task import Status
from robochoc.leaderboard.instances import instance_named
from robochoc.leaderboard.peers import running
from robochoc.leaderboard.peers.claims import wrong_claims_of_peers
from robochoc.leaderboard.peers.frodo import Frodo
from robochoc.leaderboard.peers.peer import Algorithm, PeerError, UnusablePeerError
from robochoc.leaderboard.peers.program import EndedProgram
from robochoc.leaderboard.peers.running import PEERS, peer_entrants, with_peers
from robochoc.leaderboard.results import PEER_NAMES, Budget, LeaderboardResults, RunResult, read_results, write_results
from robochoc.leaderboard.running import run_leaderboard
from robochoc.leaderboard.scores import family_scores
from robochoc.leaderboard.verification import Repetition, wrong_answers
from tests.support.cases import cases
from tests.support.limits import wait_until
from tests.support.program import robochoc_within

OPTIMUM = {f"V{place}": value for place, value in enumerate((5, 1, 2, 2, 1, 2, 1, 2, 3, 5), 1)}
"""The optimum of random-small-0, whose cost is 399."""
OTHER = {**OPTIMUM, "V1": 1}
ANSWER = {"status": "FINISHED", "assignment": OPTIMUM, "cost": 399, "msg_count": 94, "msg_size": 603}


def program(folder: Path, text: str) -> Path:
    """Write a program that stands for the Python of a tool: it prints a version, or executes `text`."""
    path = folder / "python"
    path.write_text(f'#!/bin/sh\ncase "$*" in *--version) echo pydcop 0.1.2a1; exit;; esac\n{text}\n')
    path.chmod(0o755)
    return path


def reporting(folder: Path, answer: object) -> Path:
    """Return a program that writes an answer as pyDCOP does."""
    (folder / "answer").write_text(answer if isinstance(answer, str) else json.dumps(answer))
    return program(folder, f"cp {folder / 'answer'} result.json")


def results(place: Path, *words: str, instance: str = "random-small-0", time_s: float = 60.0) -> LeaderboardResults:
    """Return the results of peers, all with the same program, on one instance."""
    places = {word.partition(":")[0]: place for word in words}
    empty = run_leaderboard([], [], Budget(time_s=time_s))
    return with_peers(empty, peer_entrants(words, places), [instance_named(instance)])


def result(place: Path, word: str = "pydcop:dpop", **others: Any) -> RunResult:  # noqa: ANN401
    (run,) = results(place, word, **others).runs
    return run


def test_a_right_answer_is_checked_and_its_missing_counts_stay_missing(tmp_path: Path) -> None:
    found = results(reporting(tmp_path, ANSWER), "pydcop:dpop", "pydcop:dsa")
    proof, other = found.runs
    assert (proof.status, proof.verdict, proof.cost, proof.messages) == (Status.DONE, "optimal", 399, 94)
    assert (proof.bytes, proof.ncccs, proof.privacy, proof.cpu_s) == (None,) * 4
    assert (other.verdict, other.cost, other.claimed_verdict) == ("solution", 399, "solution")
    assert list(wrong_claims_of_peers(found.runs)) == list(wrong_answers(found)) == []
    write_results(found, tmp_path / "results.json")
    assert read_results(tmp_path / "results.json") == found
    assert [one.package for one in found.entrants] == ["pydcop 0.1.2a1"] * 2
    repetition = Repetition(found, None)
    assert repetition.runs == []
    assert "only the answers of peers are checked" in repetition.remarks[0]
    scores = {one.protocol: one for one in family_scores(found, "random", "small").scores}
    assert (scores["pydcop:dpop"].messages, scores["pydcop:dpop"].bytes, scores["pydcop:dpop"].area) == (94, None, None)


def test_wrong_claims_are_named_and_do_not_count(tmp_path: Path) -> None:
    cost = 430
    wrong: list[tuple[dict[str, Any], str, str | None]] = [
        ({"cost": 398}, "claims the cost 398, but its assignment costs 399", "solution"),
        (
            {"assignment": OTHER, "cost": cost},
            f"claims the optimum {cost}, but toulbar2 and dpop proved 399",
            "solution",
        ),
        ({"assignment": {"V1": 5}}, "claims a valid assignment of cost 399, but it has none", "unknown"),
        ({"assignment": {**OPTIMUM, "V1": 99}}, "claims a valid assignment", "unknown"),
    ]
    with cases() as each:
        for change, text, verdict in wrong:
            with each(text):
                found = results(reporting(tmp_path, {**ANSWER, **change}), "pydcop:dpop")
                (claim,) = wrong_claims_of_peers(found.runs)
                assert claim.startswith(f"pydcop:dpop on random-small-0 {text}")
                assert found.runs[0].verdict == verdict
                assert list(wrong_answers(found)) == []


def test_an_answer_at_the_time_limit_proves_nothing(tmp_path: Path) -> None:
    place = reporting(tmp_path, {**ANSWER, "status": "TIMEOUT"})
    late = result(place)
    assert (late.status, late.verdict, late.cost, late.claimed_verdict) == (Status.LIMIT, "unknown", 399, "solution")
    endless = result(place, "pydcop:gdba")
    assert (endless.status, endless.verdict) == (Status.DONE, "solution")


def test_hard_constraints_are_checked(tmp_path: Path) -> None:
    equal = dict.fromkeys((f"V{place}" for place in range(1, 21)), 1)
    place = reporting(tmp_path, {**ANSWER, "assignment": equal, "cost": 10_000})
    hard = result(place, instance="coloring-hard-small-0")
    assert (hard.verdict, hard.status, hard.claimed_verdict) == ("no-solution", Status.DONE, "no-solution")
    place = reporting(tmp_path, {**ANSWER, "assignment": {}, "cost": -9_991})  # it is 9 without the violation
    assert result(place, "pydcop:dsa", instance="meetings-small-0").claimed_verdict is None
    place = reporting(tmp_path, {**ANSWER, "assignment": equal, "cost": 10_000})
    local = result(place, "pydcop:dsa", instance="coloring-hard-small-0")
    assert (local.verdict, local.claimed_verdict) == ("unknown", None)
    assert local.reason == "its assignment violates 42 of 42 hard constraints"
    (wrong,) = wrong_claims_of_peers([result(reporting(tmp_path, {**ANSWER, "assignment": {}, "cost": 10_000}),
                                             instance="sensors-small-0")])  # fmt: skip
    assert wrong.endswith("claims no-solution, but toulbar2 found one")


def test_faulty_programs_have_one_line(tmp_path: Path) -> None:
    faults: list[tuple[Path | str, str]] = [
        ("{", "its result cannot be read"),
        ('{"status": "STOPPED", "assignment": {}}', "its status is STOPPED"),
        ('{"status": "FINISHED", "assignment": {"V1": [1]}}', "its result cannot be read"),
        ("[" * 100_000, "its result cannot be read"),
    ]
    with cases() as each:
        for content, text in faults:
            with each(text):
                run = result(reporting(tmp_path, content))
                assert (run.status, run.verdict) == (Status.ERROR, None)
                assert text in (run.reason or "")
    odd = result(reporting(tmp_path, {**ANSWER, "msg_count": -1}))
    assert (odd.cost, odd.messages) == (399, None)
    fifo = result(program(tmp_path, "mkfifo result.json"))
    assert (fifo.status, fifo.reason) == (Status.ERROR, "ended with status 0, and wrote no result")
    crashed = result(program(tmp_path, "echo 'first'; printf 'bad \\033[31m' >&2; exit 3"))
    assert (crashed.status, crashed.reason) == (Status.ERROR, "bad \\x1b[31m")


def test_a_program_is_killed_with_its_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "GRACE_S", 0.0)
    number = tmp_path / "number"
    start = f"sleep 1000 & echo $! > {number}"
    run = result(program(tmp_path, start), time_s=600.0)
    assert run.status == Status.ERROR
    wait_until(lambda: _is_ended(int(number.read_text())), "the program's process is still running")
    number.unlink()
    for limit_s in (0.5, 5.0, 50.0):  # a busy machine needs time for the start
        run = result(program(tmp_path, f"{start}; wait"), time_s=limit_s)
        assert (run.status, run.reason) == (Status.LIMIT, "killed at the time limit without an answer")
        if number.exists() and number.read_text():
            break
    wait_until(lambda: _is_ended(int(number.read_text())), "the program's process is still running")


def _is_ended(pid: int) -> bool:
    """Return whether a process has ended; the system may not have removed it yet."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] in "ZX"


def test_propflow_answers_by_places_and_with_the_sign_of_the_costs(tmp_path: Path) -> None:
    best = {
        "V2.3": 2,
        "V2.4": 4,
        "V3.2": 4,
        "V3.5": 0,
        "V4.1": 0,
        "V4.4": 4,
        "V4.5": 0,
        "V5.1": 0,
        "V5.2": 4,
        "V5.3": 2,
    }
    place = program(tmp_path, f"echo noise; echo '{json.dumps({'assignment': best, 'cost': -18.0})}'")
    run = result(place, "propflow:maxsum-damped", instance="meetings-small-0")
    assert (run.cost, run.claimed_cost, run.verdict) == (18, 18, "solution")
    wrong = result(program(tmp_path, 'echo \'{"assignment": {"V1": 99}, "cost": 1}\''), "propflow:maxsum")
    assert "its result cannot be read" in (wrong.reason or "")


def test_problems_that_would_change_in_the_export_are_refused(tmp_path: Path) -> None:
    place = reporting(tmp_path, ANSWER)
    with cases() as each:
        for instance, text in (("dynamic-small-0", "do not change"), ("asymmetric-small-0", "asymmetric constraint")):
            with each(instance):
                run = result(place, instance=instance)
                assert (run.status, text in (run.reason or "")) == (Status.REFUSED, True)


SOLUTION = '<solution valuation="{}">{}</solution>'
OUTPUT = """Number of NCCCs = 3,675
Number of messages sent (by type):
\t[ALL, UTIL]:\t9
\t- Total:\t1,108
Amount of information sent (by type, in bytes):
\t- Total:\t32,537
"""


def frodo(folder: Path) -> Frodo:
    """Return FRODO with a jar that has only a description of agents."""
    with zipfile.ZipFile(folder / "frodo2.jar", "w") as jar:
        text = '<agentDescription measureMsgs = "false"><parser displayGraph = "true"/></agentDescription>'
        jar.writestr("frodo2/algorithms/dpop/DPOPagent.xml", text)
    return Frodo(folder / "frodo2.jar")


def test_frodo_is_called_and_its_solution_is_read(tmp_path: Path) -> None:
    peer, algorithm = frodo(tmp_path), Frodo.algorithms["dpop"]
    command = peer.command(instance_named("random-small-0").team(), algorithm, tmp_path, 1.5)
    assert command[command.index("-timeout") :] == [
        "-timeout",
        "1500",
        "-o",
        "solution.xml",
        "problem.xml",
        "agents.xml",
    ]
    assert 'measureMsgs = "true"><parser displayGraph = "false"' in (tmp_path / "agents.xml").read_text()
    assert b'format="XCSP 2.1_FRODO"' in (tmp_path / "problem.xml").read_bytes()
    ended = EndedProgram(0, OUTPUT, "", 0.1)
    values = "".join(f'<assignment variable="{name}" value="{value}"/>' for name, value in OPTIMUM.items())
    (tmp_path / "solution.xml").write_text(SOLUTION.format(399, values))
    answer = peer.answer(tmp_path, ended)
    assert (answer.assignment, answer.cost, answer.is_finished) == (OPTIMUM, 399, True)
    assert (answer.messages, answer.bytes, answer.ncccs) == (1108, 32537, 3675)
    late = peer.answer(tmp_path, EndedProgram(0, "", "Timed out after 1500 ms", 0.1))
    assert (late.is_finished, late.messages) == (False, None)
    (tmp_path / "solution.xml").write_text(SOLUTION.format("-infinity", ""))
    assert peer.answer(tmp_path, ended).cost == float("inf")
    with cases() as each:
        for text in ("<!DOCTYPE a [<!ENTITY b 'c'>]><a/>", SOLUTION.format("x", ""), "<", SOLUTION.format(
            1, '<assignment variable="V1" value="x"/>')):  # fmt: skip
            with each(text):
                (tmp_path / "solution.xml").write_text(text)
                with pytest.raises(PeerError):
                    peer.answer(tmp_path, ended)
    with pytest.raises(UnusablePeerError, match="is not FRODO's jar, with frodo2/algorithms/none"):
        peer.command(instance_named("random-small-0").team(), Algorithm(("none",)), tmp_path, 1)
    encrypted = bytearray(peer.place.read_bytes())
    encrypted[encrypted.index(b"PK\x01\x02") + 8] |= 1
    peer.place.write_bytes(encrypted)
    with pytest.raises(UnusablePeerError, match="is not FRODO's jar"):
        peer.version()


def test_a_missing_peer_has_one_sentence(tmp_path: Path) -> None:
    assert {*PEERS} == {*PEER_NAMES}
    file = tmp_path / "file"
    file.write_text("text")
    run = (
        "leaderboard",
        "run",
        "--family",
        "random",
        "--size",
        "small",
        "--seeds",
        "1",
        "--jobs",
        "1",
        "-o",
        tmp_path / "results.json",
    )
    wrong: list[tuple[tuple[str, ...], str]] = [
        (("pydcop:dpop",), "pydcop:dpop requires --peer pydcop=PYTHON; install pyDCOP"),
        (("pydcop:dpopp", "--peer", f"pydcop={file}"), "pyDCOP has no algorithm 'dpopp'; did you mean 'dpop'?"),
        (("pydcop:dpop", "--peer", f"pydcop={file}"), "cannot be started (Permission denied)"),
        (("pydcop:dpop", "--peer", "pydcop=/none"), "--peer pydcop=/none: cannot be started"),
        (("frodo:dpop", "--peer", f"frodo={file}"), "is not FRODO's jar"),
        (("frodo:dpop", "--peer", "frodo=/none"), "--peer frodo=/none: does not exist; FRODO 2.18 is at"),
        (("dpop", "--peer", "pydcopp=/none"), "did you mean 'pydcop'?"),
        (("dpop", "--peer", "pydcop"), "is not of the form NAME=PATH"),
    ]
    with cases() as each:
        for words, text in wrong:
            with each(text):
                done = robochoc_within(*run, *words)
                assert (done.returncode, text in done.stderr) == (2, True), done.stderr
                assert len(done.stderr.strip().splitlines()) <= 4


def test_the_command_runs_peers_beside_protocols(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reporting(tmp_path, {**ANSWER, "cost": 1})
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "results.json"
    words = (
        "dpop",
        "pydcop:dpop",
        "--peer",
        "pydcop=./python",
        "--family",
        "random",
        "--size",
        "small",
        "--seeds",
        "1",
        "--jobs",
        "1",
    )
    done = robochoc_within("leaderboard", "run", *words, "-o", path)
    assert done.stderr == "pydcop:dpop on random-small-0 claims the cost 1, but its assignment costs 399\n"
    assert [run["protocol"] for run in json.loads(path.read_text())["runs"]] == ["dpop", "pydcop:dpop"]
    alone = robochoc_within("leaderboard", "run", *words[1:], "-o", tmp_path / "alone.json")
    assert (alone.returncode, alone.stdout.partition(";")[0]) == (0, f"{tmp_path / 'alone.json'}: 1 run")
    checked = robochoc_within("leaderboard", "verify", path, "--rerun", "1", "--jobs", "1")
    assert (checked.returncode, "2 runs, 2 answers, no fault" in checked.stdout) == (0, True)
