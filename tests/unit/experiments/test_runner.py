"""A study is carried out, broken off, changed, and gone on with: its results are the same as in one go."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from robochoc.experiments import read
from robochoc.experiments.agreement import DisagreementError
from robochoc.experiments.plan import plan_of
from robochoc.experiments.results import read_results
from robochoc.experiments.runner import StudyProgress
from robochoc.experiments.store import Store, StudyInUseError
from robochoc.experiments.task import Row, Status, Task
from robochoc.experiments.workers import LocalWorkers
from robochoc.formats.diagnostics import InvalidInputError
from tests.support.cases import cases
from tests.support.studies import COSTS, SMALL, altered, comparable, finished, results_of, study


class _EnoughError(Exception):
    pass


def test_a_study_that_was_broken_off_goes_on(tmp_path: Path) -> None:
    whole = finished(SMALL)
    assert [row["status"] for row in whole.rows] == ["done"] * 12
    path = tmp_path / "broken.sqlite"
    for enough, jobs in ((1, 0), (4, 2)):
        seen: list[StudyProgress] = []

        def stop(now: StudyProgress, seen: list[StudyProgress] = seen, enough: int = enough) -> None:
            seen.append(now)
            if len(seen) == enough:
                raise _EnoughError

        with pytest.raises(_EnoughError):
            results_of(SMALL, path, jobs, progress=stop)
    there = len(read(path))
    assert 5 <= there < 12
    seen = []
    assert comparable(results_of(SMALL, path, progress=seen.append)) == comparable(whole) == comparable(path)
    assert [(now.done, now.planned) for now in seen] == [(done, 12) for done in range(there + 1, 13)]
    seen.clear()
    results_of(SMALL, path, progress=seen.append)
    assert seen == []


def test_a_changed_study_runs_what_is_new(tmp_path: Path) -> None:
    path = tmp_path / "study.sqlite"
    finished(SMALL, path)
    changed = SMALL.replace("[0.2, 0.5]", "[0.5, 0.3]").replace('"afc-ng"', '"awc"')
    seen: list[StudyProgress] = []
    found = results_of(changed, path, progress=seen.append)
    assert len(seen) == 9
    assert comparable(found) == comparable(finished(changed))
    seen.clear()
    assert comparable(results_of(SMALL, path, progress=seen.append)) == comparable(finished(SMALL))
    assert seen == []
    assert found.text == changed


def test_all_is_read_as_it_was_written(tmp_path: Path) -> None:
    found = results_of(COSTS, tmp_path / "costs.sqlite")
    assert (found.name, found.title, found.planned) == ("study", "Costs", 32)
    assert read_results(tmp_path / "costs.sqlite") == found
    assert sorted(tmp_path.iterdir()) == [tmp_path / "costs.sqlite"]
    first = found.rows[0]
    assert list(first)[:4] == ["agents", "degree", "problem_seed", "key"]
    assert (first["label"], first["verdict"], first["settings"]) == ("sfb", "optimal", {})
    assert isinstance(first["cost"], int)
    assert first["cost_over_time"][-1][3] == first["cost"]
    assert sum(load[1] for load in first["loads"]) == first["messages"]


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="is not a file"):
        read(tmp_path / "nothing.sqlite")
    (tmp_path / "text.sqlite").write_text("no database, but long enough to be one" * 100)
    altered(tmp_path / "other.sqlite", "CREATE TABLE mine (x)")
    for name in ("text", "other"):
        before = (tmp_path / f"{name}.sqlite").read_bytes()
        with pytest.raises(InvalidInputError, match=r"contains no results|not written by 'robochoc experiment run'"):
            read(tmp_path / f"{name}.sqlite")
        with pytest.raises(InvalidInputError, match=r"contains no results|not written by 'robochoc experiment run'"):
            Store(tmp_path / f"{name}.sqlite")
        assert (tmp_path / f"{name}.sqlite").read_bytes() == before


def test_results_that_somebody_has_altered_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.sqlite"
    with cases() as each:
        for change in [
            "UPDATE runs SET messages = 'many'",
            "UPDATE runs SET loads = '{'",
            "UPDATE runs SET messages_by_type = NULL",
            "UPDATE plan SET parameters = '[1]'",
            "UPDATE plan SET settings = x'ff'",
            "DROP TABLE runs",
        ]:
            with each(change):
                finished(SMALL, path)
                altered(path, change)
                with pytest.raises(InvalidInputError, match=r"study\.sqlite: contains no results of a study"):
                    read(path)


def test_a_file_that_cannot_be_written_to_is_told(tmp_path: Path) -> None:
    path = tmp_path / "study.sqlite"
    finished(SMALL, path)
    altered(path, "CREATE TRIGGER full BEFORE INSERT ON plan BEGIN SELECT RAISE(ABORT, 'disk is full'); END")
    with pytest.raises(InvalidInputError, match=r"study\.sqlite: cannot be written to: disk is full"):
        results_of(SMALL, path)


def test_two_at_once_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.sqlite"
    finished(SMALL, path)
    with Store(path):
        with pytest.raises(StudyInUseError, match=r"is being written to by another"):
            Store(path)
        assert len(read(path)) == 12
    with Store(path):
        pass


def test_a_worker_that_is_killed_costs_the_run_that_it_was_at() -> None:
    """The run is a row that says so, others take over, and the next start tries again."""
    tasks = [*plan_of(study(SMALL)).values()]
    with LocalWorkers(1) as workers:
        rows = workers.rows([tasks])
        found = dict([_keyed(*next(rows))])
        (pid,) = workers.pids
        os.kill(pid, signal.SIGKILL)
        found |= dict(_keyed(*one) for one in rows)
        assert workers.pids != [pid]
    assert set(found) == {task.key for task in tasks}
    assert sorted(row.status for row in found.values()) == ["crashed", *["done"] * 11]
    (crashed,) = [row for row in found.values() if row.status is Status.CRASHED]
    assert crashed.reason == "the process was ended by SIGKILL; perhaps there was not enough memory"


def test_workers_skip_empty_bundles() -> None:
    with LocalWorkers(1) as workers:
        assert list(workers.rows([[], []])) == []


def _keyed(task: Task, row: Row) -> tuple[str, Row]:
    return task.key, row


def test_what_has_crashed_is_tried_again(tmp_path: Path) -> None:
    path = tmp_path / "study.sqlite"
    plan = plan_of(study(SMALL))
    with Store(path) as store:
        store.start(study(SMALL), plan)
        store.add([(key, Row(status=Status.CRASHED)) for key in list(plan)[:3]])
    assert comparable(results_of(SMALL, path)) == comparable(finished(SMALL))


def test_answers_that_contradict_each_other_stop_the_study(tmp_path: Path) -> None:
    path = tmp_path / "study.sqlite"
    with Store(path) as store:
        plan = plan_of(study(SMALL))
        store.start(study(SMALL), plan)
        digest = finished(SMALL).rows[0]["digest"]
        wrong = Row(status=Status.DONE, verdict="no-solution", digest=digest, team="wrong")
        store.add([(next(iter(plan)), wrong)])
    with pytest.raises(DisagreementError, match="contradict each other"):
        results_of(SMALL, path)
    kept = read(path)
    assert kept[0]["verdict"] == "no-solution"
    with pytest.raises(DisagreementError):
        results_of(SMALL, path)
