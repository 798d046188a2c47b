"""Results: the same bytes from the same command, and each fault of a file is found."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robochoc.experiments.task import Status
from robochoc.formats.diagnostics import InvalidInputError
from robochoc.leaderboard.board import read_board, submit
from robochoc.leaderboard.instances import instances
from robochoc.leaderboard.results import Budget, LeaderboardResults, read_results, write_results
from robochoc.leaderboard.running import entrants, run_leaderboard
from robochoc.leaderboard.verification import changed_runs, selected, wrong_answers
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


def test_answers_are_right_and_runs_are_repeated(results: LeaderboardResults) -> None:
    assert list(wrong_answers(results)) == []
    assert list(changed_runs(results, selected(results.runs, 4))) == []
    by_name = {(run.instance, run.protocol): run for run in results.runs}
    assert by_name["random-small-0", "dpop"].verdict == "optimal"
    assert by_name["random-small-0", "afc-ng"].status == Status.REFUSED
    assert by_name["dynamic-small-0", "dpop"].assignment
    loss = by_name["privacy-small-0", "dpop"].privacy
    assert loss is not None
    assert 0 < loss <= 1


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
    assert list(changed_runs(altered, altered.runs[:3])) == ["mgm on random-small-0: another messages"]


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
            ({**plain, "entrants": plain["entrants"] * 2}, "names an entrant twice"),
            ({**plain, "runs": [{**first, "cost": 2**60}]}, "has no valid results"),
            ({**plain, "runs": [{**first, "protocol": "\x1b[31m"}]}, "has no valid results"),
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
    one = msgspec.structs.replace(results, runs=[run for run in results.runs if run.protocol == "dpop"])
    other = msgspec.structs.replace(results, runs=[run for run in results.runs if run.protocol != "dpop"])
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
