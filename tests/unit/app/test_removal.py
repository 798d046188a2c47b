"""A team that is removed: whatever it does is ended, and nothing of it is left or made again."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robochoc.app.conflicts.search import ConflictSearch
from robochoc.app.flights.builder import FlightBuilder
from robochoc.app.jobs.job import Job, end_all, jobs_alive
from robochoc.app.projects import Projects
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import RunState
from robochoc.app.runs.runs import Runs, runs_of
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from robochoc.app.studies.question import MOST_SECONDS, StudyQuestion
from robochoc.app.studies.study import study_on
from tests.support.kept_runs import cube, kept_run
from tests.support.limits import HANG_S, wait_until
from tests.support.slot_sketches import slots


@pytest.fixture(autouse=True)
def nothing_stays() -> Iterator[None]:
    """End what a test has started; all tests look that nothing is left."""
    yield
    end_all(HANG_S)


@pytest.fixture
def projects(tmp_path: Path) -> Projects:
    """Teams in a folder of their own."""
    return Projects(TeamStore(tmp_path / "teams"))


def _nothing_left(projects: Projects) -> None:
    wait_until(lambda: jobs_alive() == [], lambda: f"at work: {[job.name for job in jobs_alive()]}")
    assert [*projects.store.folder.iterdir()] == []


def test_all_that_it_does_is_ended(projects: Projects) -> None:
    project, other = projects.add(slots(14, 14)), projects.add(slots(14, 14))
    kept = kept_run(project.folder, cube())
    run = runs_of(project).start(RunOptions(protocol="syncbb", runtime="processes"))
    its = runs_of(other).start(RunOptions(protocol="syncbb"))
    study_on(project).start(project.sketch, StudyQuestion(("syncbb", "afb"), timeout=MOST_SECONDS))
    search = ConflictSearch(project.sketch, folder=project.folder)
    FlightBuilder(kept).request(lambda: None)
    assert len(jobs_alive()) == 5
    wait_until(lambda: all(job.pid for job in jobs_alive()), "not all of them have begun")
    projects.remove(project.id)
    assert search.result() is None
    wait_until(lambda: len(jobs_alive()) == 1, lambda: f"at work: {[job.name for job in jobs_alive()]}")
    assert run.state is RunState.STOPPED
    assert its.state is RunState.RUNNING
    assert not study_on(project).running
    assert [path.name for path in projects.store.folder.iterdir()] == [other.id]
    projects.remove(other.id)
    _nothing_left(projects)


def test_who_cannot_be_interrupted_leaves_nothing_either(projects: Projects) -> None:
    project = projects.add(Sketch())
    release, began = threading.Event(), threading.Event()

    def computes(_: Job[None]) -> None:
        began.set()
        release.wait(HANG_S)
        project.folder.mkdir()
        (project.folder / "late").write_text("it did not know better", encoding="utf-8")

    Job("test", computes, folder=project.folder).start()
    assert began.wait(HANG_S)
    projects.remove(project.id)
    assert not project.folder.exists()
    release.set()
    _nothing_left(projects)


def test_what_was_broken_off_is_removed_the_next_time(projects: Projects) -> None:
    name = projects.add(Sketch()).id
    projects.store.move_to_removed(name)
    (left,) = projects.store.folder.iterdir()
    assert (left / "history.json").is_file()
    assert projects.store.ids() == []
    projects.sweep()
    _nothing_left(projects)


def test_nothing_begins_in_a_team_that_is_gone(projects: Projects) -> None:
    project = projects.add(slots(3, 3))
    projects.remove(project.id)
    with pytest.raises(EditError, match="removed"):
        Runs(project).start()
    study = study_on(project)
    study.start(project.sketch, StudyQuestion(("abt", "afc-ng")))
    wait_until(lambda: not study.running, "the study runs on")
    assert study.facts
    assert "No such file" in study.facts.message
    _nothing_left(projects)
