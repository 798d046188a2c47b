"""A random part of `make leaderboard`: digests, runs in worker processes and in this one, and a verification."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.experiments.digests import sha256_of_team
from robochoc.leaderboard.certificates import published
from robochoc.leaderboard.instances import FAMILIES, instances
from robochoc.leaderboard.results import Budget, read_results, write_results
from robochoc.leaderboard.running import entrants, met_time_limit, run_leaderboard
from robochoc.leaderboard.verification import Repetition, wrong_answers
from tests.support.examples import drawn
from tests.support.studies import RunsHere

PROTOCOLS = ("dpop", "sfb", "maxsum", "mgm2", "gdba", "afc-ng", "dba", "atwb")
BUDGET = Budget(messages=5000, time_s=600)


@pytest.mark.more
def test_two_runs_of_a_random_part_are_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chance = drawn("leaderboard")
    part = [chance.choice(list(instances([family], ["small"]))) for family in chance.sample(list(FAMILIES), 8)]
    assert [sha256_of_team(one.team()) for one in part] == [published()[one.name].sha256 for one in part]
    chosen = entrants(chance.sample(PROTOCOLS, 3))
    by_workers = run_leaderboard(chosen, part, BUDGET, jobs=2)
    monkeypatch.setattr("robochoc.leaderboard.running.LocalWorkers", lambda *_: RunsHere())
    again = run_leaderboard(chosen, part, BUDGET)
    write_results(by_workers, tmp_path / "one.json")
    write_results(again, tmp_path / "two.json")
    assert not any(met_time_limit(run) for run in by_workers.runs)
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()
    results = read_results(tmp_path / "one.json")
    assert list(wrong_answers(results)) == []
    repetition = Repetition(results, 10, BUDGET.time_s)
    assert list(repetition.changed_runs()) == []
    assert repetition.remarks == []
