"""Results: the same bytes from the same command, and each fault of a file is found."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robochoc.experiments.task import Status
from robochoc.formats.diagnostics import InvalidInputError
from robochoc.leaderboard.board import read_board, submit
from robochoc.leaderboard.instances import instances
from robochoc.leaderboard.results import Budget, LeaderboardResults, RunResult, read_results, write_results
from robochoc.leaderboard.running import entrants, run_leaderboard
from robochoc.leaderboard.saved_runs import SavedRuns, command_line
from robochoc.leaderboard.verification import Repetition, wrong_answers
from robochoc.run.registry import UnknownProtocolError
from tests.support.cases import cases
from tests.support.studies import RunsHere

BUDGET = Budget(messages=1000)
FEW = list(instances(["random", "coloring-hard", "dynamic", "privacy"], ["small"], [0]))


@pytest.fixture(autouse=True)
def runs_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process run what workers would."""
    monkeypatch.setattr("robochoc.leaderboard.running.LocalWorkers", lambda *_: RunsHere())


@pytest.fixture(scope="module")
def results() -> Iterator[LeaderboardResults]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("robochoc.leaderboard.running.LocalWorkers", lambda *_: RunsHere())
        yield run_leaderboard(entrants(["dpop", "mgm", "afc-ng"]), FEW, BUDGET)


def test_the_same_runs_are_the_same_bytes(results: LeaderboardResults, tmp_path: Path) -> None:
    again = run_leaderboard(entrants(["dpop", "mgm", "afc-ng"]), FEW, BUDGET)
    write_results(results, tmp_path / "one.json")
    write_results(again, tmp_path / "two.json")
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()
    assert read_results(tmp_path / "one.json") == results


class Interrupted(SavedRuns):
    """Saved runs whose command is interrupted after four of them."""

    def add(self, run: RunResult) -> None:
        super().add(run)
        if len(self.found) == 4:
            raise KeyboardInterrupt


def test_an_interrupted_command_continues_with_the_same_bytes(results: LeaderboardResults, tmp_path: Path) -> None:
    path, chosen = tmp_path / "runs.part", entrants(["dpop", "mgm", "afc-ng"])
    command = command_line(chosen, FEW, BUDGET, seed=0, times=False)
    with pytest.raises(KeyboardInterrupt), Interrupted(path, command) as saved:
        run_leaderboard(chosen, FEW, BUDGET, saved=saved)
    path.write_bytes(path.read_bytes()[:-1])  # as if the last line were written in part
    done: list[int] = []
    with SavedRuns(path, command) as saved:
        assert list(saved.found.values()) == results.runs[:3]
        with pytest.raises(InvalidInputError, match="is being written by another"):
            SavedRuns(path, command)
        again = run_leaderboard(chosen, FEW, BUDGET, saved=saved, progress=lambda now, _: done.append(now))
    write_results(results, tmp_path / "one.json")
    write_results(again, tmp_path / "two.json")
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()
    assert done == list(range(4, len(results.runs) + 1))
    other = command_line(chosen, FEW, BUDGET, seed=1, times=False)
    with pytest.raises(InvalidInputError, match="has the runs of another command"):
        SavedRuns(path, other)
    path.unlink()
    with SavedRuns(path, other) as saved:
        saved.add(msgspec.structs.replace(results.runs[0], status=Status.CRASHED))
    assert not path.exists()  # a failed run is repeated
    os.mkfifo(path)
    with pytest.raises(InvalidInputError, match="is not a regular file"):
        SavedRuns(path, other)


def test_answers_are_right_and_runs_are_repeated(results: LeaderboardResults) -> None:
    assert list(wrong_answers(results)) == []
    assert list(Repetition(results, 4).changed_runs()) == []
    by_name = {(run.instance, run.protocol): run for run in results.runs}
    assert by_name["random-small-0", "dpop"].verdict == "optimal"
    assert by_name["random-small-0", "afc-ng"].status == Status.REFUSED
    assert by_name["dynamic-small-0", "dpop"].assignment
    loss = by_name["privacy-small-0", "dpop"].privacy
    assert loss is not None
    assert 0 < loss <= 1


def test_the_reason_of_a_refusal_names_no_other_protocols(results: LeaderboardResults) -> None:
    """Their number depends on the installed packages, but the bytes must not."""
    (run,) = [one for one in results.runs if (one.instance, one.protocol) == ("random-small-0", "afc-ng")]
    assert run.reason == "Robot1 has costs to minimise (DCOP), which afc-ng does not support"
    other = changed(results, "random-small-0", "afc-ng", reason=f"{run.reason}; these do: another (--protocol)")
    assert list(Repetition(other, None).changed_runs()) == []


def changed(results: LeaderboardResults, instance: str, protocol: str, **values: Any) -> LeaderboardResults:  # noqa: ANN401
    runs = [
        msgspec.structs.replace(run, **values) if (run.instance, run.protocol) == (instance, protocol) else run
        for run in results.runs
    ]
    return msgspec.structs.replace(results, runs=runs)


def test_wrong_answers_are_found(results: LeaderboardResults) -> None:
    run = next(one for one in results.runs if (one.instance, one.protocol) == ("random-small-0", "mgm"))
    other = {**run.assignment, "V1": run.assignment["V1"] % 5 + 1}
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"cost": 1}, "but the protocol claims 1"),
        ({"assignment": other}, "but the protocol claims"),
        ({"assignment": {**run.assignment, "V1": 99}}, "V1 = 99 is not in its domain"),
        ({"assignment": {}}, "V1 has no value"),
        ({"cost": None, "verdict": "solution"}, "has an assignment, but no cost"),
        ({"verdict": "optimal"}, "claims the optimum"),
        ({"verdict": "no-solution"}, "claims no-solution, but toulbar2 found one"),
    ]
    with cases() as each:
        for values, fault in wrong:
            with each(fault):
                altered = changed(results, run.instance, run.protocol, **values)
                assert any(fault in line for line in wrong_answers(altered))


def test_other_results_of_a_repeated_run_are_found(results: LeaderboardResults) -> None:
    altered = changed(results, "random-small-0", "mgm", messages=3)
    assert list(Repetition(altered, None).changed_runs()) == ["mgm on random-small-0: repeated with different messages"]


def test_repeated_runs_have_a_time_limit_of_their_own(results: LeaderboardResults) -> None:
    budget = Budget(messages=BUDGET.messages, time_s=1e6)
    for_days = msgspec.structs.replace(changed(results, "random-small-0", "mgm", messages=3), budget=budget)
    short = Repetition(for_days, None, limit_s=1e-6)
    assert list(short.changed_runs()) == []
    assert short.unfinished == sum(run.status != Status.REFUSED for run in for_days.runs)
    assert "mgm on random-small-0 not compared: it met the time limit of 1e-06 s: increase --timeout" in short.remarks
    assert list(Repetition(for_days, None).changed_runs()) == [
        "mgm on random-small-0: repeated with different messages"
    ]


def curve_of(results: LeaderboardResults, protocol: str) -> list[tuple[int, int]]:
    return next(run.curve for run in results.runs if (run.instance, run.protocol) == ("random-small-0", protocol))


def test_contradictions_are_found_without_a_repetition(results: LeaderboardResults) -> None:
    curve = curve_of(results, "mgm")
    (first, dear), (last, cost) = curve[0], curve[-1]
    wrong: list[tuple[str, str, dict[str, Any], str]] = [
        ("random-small-0", "mgm", {"curve": [(first, 1)]}, "the curve reaches 1, but toulbar2"),
        (
            "random-small-0",
            "mgm",
            {"curve": [(first, dear)]},
            f"the curve ends with {dear}, but the answer costs {cost}",
        ),
        ("random-small-0", "mgm", {"curve": [*curve, (last, cost)]}, "is not better than the one before"),
        ("random-small-0", "mgm", {"curve": [(last + 1, dear), *curve[1:]]}, "the messages of the curve decrease"),
        ("random-small-0", "mgm", {"curve": [*curve[:-1], (10**6, cost)]}, "the curve has 1,000,000 messages, but"),
        ("random-small-0", "mgm", {"bytes": None}, "has a verdict, but not all of messages, bytes"),
        ("dynamic-small-0", "dpop", {"curve": [(1, 5)]}, "has a curve, although the problem changes"),
        ("coloring-hard-small-0", "mgm", {"curve": [(1, 5)]}, "has a curve, although the problem has no costs"),
        ("random-small-0", "afc-ng", {"verdict": "optimal"}, "the protocol does not minimise costs"),
        ("random-small-0", "afc-ng", {"messages": 5}, "was refused, but has an answer or messages"),
        ("random-small-0", "dpop", {"status": "limit"}, "has the status limit, but the verdict optimal"),
        ("random-small-0", "dpop", {"verdict": "unknown"}, "has the status done, but the verdict unknown"),
    ]
    with cases() as each:
        for instance, protocol, values, fault in wrong:
            with each(fault):
                altered = changed(results, instance, protocol, **values)
                assert any(fault in line for line in wrong_answers(altered)), list(wrong_answers(altered))


def test_profits_that_are_maximised_rise_along_the_curve() -> None:
    results = run_leaderboard(entrants(["mgm2"]), list(instances(["meetings"], ["small"], [0])), BUDGET)
    (run,) = results.runs
    assert len(run.curve) > 1
    assert list(wrong_answers(results)) == []
    falling = msgspec.structs.replace(run, curve=run.curve[::-1])
    assert any("not better" in line for line in wrong_answers(msgspec.structs.replace(results, runs=[falling])))


def test_proofs_that_an_incomplete_protocol_claims_are_always_repeated(results: LeaderboardResults) -> None:
    best = next(run for run in results.runs if (run.instance, run.protocol) == ("random-small-0", "dpop"))
    answer = {"status": "done", "verdict": "optimal", "cost": best.cost, "assignment": best.assignment}
    altered = changed(results, "random-small-0", "mgm", **answer, curve=[(5, best.cost)])
    assert list(wrong_answers(altered)) == []
    repetition = Repetition(altered, 0)
    assert [(run.instance, run.protocol) for run in repetition.runs] == [("random-small-0", "mgm")]
    assert any("repeated with different status, verdict, cost" in line for line in repetition.changed_runs())


def with_entrant(results: LeaderboardResults, **values: str) -> LeaderboardResults:
    entrant = msgspec.structs.replace(results.entrants[0], **values)
    own = [msgspec.structs.replace(run, protocol=entrant.name) for run in results.runs if run.protocol == "dpop"]
    return msgspec.structs.replace(results, entrants=[entrant], runs=own)


def test_protocols_that_cannot_be_found_are_not_repeated(results: LeaderboardResults) -> None:
    absent = Repetition(with_entrant(results, name="mine", place="my_module:Mine", source="1"), None)
    assert absent.runs == []
    assert absent.remarks == [
        "4 runs of mine not repeated: its module is not installed; if you trust it, add --protocol my_module:Mine"
    ]
    other = Repetition(with_entrant(results, name="DPOP"), None)
    assert list(other.changed_runs()) == ["DPOP: the protocol is called dpop"]
    ours = Repetition(with_entrant(results, source="1"), 0)
    assert list(ours.changed_runs()) == ["dpop: is a protocol of robochoc, but the results have a digest of its files"]


def test_invalid_files_are_refused(results: LeaderboardResults, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    plain = msgspec.to_builtins(results)
    first = plain["runs"][0]
    with cases() as each:
        for content, message in [
            ({**plain, "format": 2}, "has format 2 and set 1"),
            ({**plain, "runs": [{**first, "instance": "nothing"}]}, "is not an instance of the set"),
            ({**plain, "runs": [{**first, "protocol": "abt"}]}, "is not among its entrants"),
            ({**plain, "runs": [first, first]}, "has two runs of dpop"),
            ({**plain, "runs": plain["runs"][1:]}, "has no run of dpop on"),
            ({**plain, "entrants": plain["entrants"] * 2}, "names an entrant twice"),
            ({**plain, "runs": [{**first, "cost": 2**60}]}, "has no valid results"),
            ({**plain, "runs": [{**first, "protocol": "\x1b[31m"}]}, "has no valid results"),
            ({**plain, "entrants": [{"name": "dpop", "place": "a:B\n"}]}, "has no valid results"),
            ({**plain, "runs": [{**first, "messages": -1}]}, "has no valid results"),
            ({**plain, "more": 1}, "has no valid results"),
            ([], "has no valid results"),
        ]:
            with each(message):
                path.write_bytes(msgspec.json.encode(content))
                with pytest.raises(InvalidInputError, match=message):
                    read_results(path)
    with pytest.raises(InvalidInputError, match="cannot be read"):
        read_results(tmp_path)


def test_a_board_has_each_run_once(results: LeaderboardResults, tmp_path: Path) -> None:
    board = tmp_path / "board"
    one, other = (
        msgspec.structs.replace(
            results,
            entrants=[entrant for entrant in results.entrants if (entrant.name == "dpop") is is_dpop],
            runs=[run for run in results.runs if (run.protocol == "dpop") is is_dpop],
        )
        for is_dpop in (True, False)
    )
    submit(one, "one.json", board)
    submit(other, "other.json", board)
    submit(one, "one.json", board)
    together = read_board([board])
    assert {(run.instance, run.protocol) for run in together.runs} == {
        (run.instance, run.protocol) for run in results.runs
    }
    with pytest.raises(InvalidInputError, match="is already on the board"):
        submit(one, "again.json", board)
    with pytest.raises(InvalidInputError, match="another budget"):
        submit(msgspec.structs.replace(one, seed=1), "seed.json", board)
    with pytest.raises(InvalidInputError, match="has no files of results"):
        read_board([tmp_path])


def test_unknown_protocols_are_refused() -> None:
    with pytest.raises(UnknownProtocolError, match="did you mean"):
        entrants(["dqop"])
