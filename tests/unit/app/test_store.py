"""Teams on disk, and in memory: saved whole, undone step by step, told to all who look; nothing is lost."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robochoc.app import projects as app_projects
from robochoc.app import store as app_store
from robochoc.app.projects import Project, Projects
from robochoc.app.runs.runs import Runs
from robochoc.app.sketch.edits import EditError, renamed, with_robot
from robochoc.app.sketch.history import MAX_STEPS, History
from robochoc.app.sketch.sketch import (
    MAX_ROBOTS,
    MAX_SIDE,
    MAX_VALUES,
    Area,
    Cell,
    Decision,
    DecisionKind,
    Sketch,
    SketchRobot,
    SketchRule,
)
from robochoc.app.store import InUseError, TeamStore
from tests.support.cases import looped
from tests.support.limits import wait_until

SKETCH = with_robot(
    Sketch(
        "charging",
        decisions=(
            Decision("slot", DecisionKind.SLOT, (1, 2, 3)),
            Decision("task", DecisionKind.TASK, ("look", "carry")),
        ),
        rules=(SketchRule("R1", "table", "task", ("A", "B"), {"rows": [["look", "carry"]], "n": 1}, 3),),
    ),
    Cell(1, 2),
    "A",
)


@pytest.fixture
def store(tmp_path: Path) -> TeamStore:
    """An empty store."""
    return TeamStore(tmp_path / "teams")


def test_a_team_comes_back_as_it_was(store: TeamStore) -> None:
    history = History(SKETCH).edited(renamed(SKETCH, "other")).undone()
    name = store.add(Sketch())
    store.save(name, history)
    assert store.load(name) == history


def test_a_relative_folder_is_the_same_in_all_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    project = Projects(TeamStore(Path("teams"))).add(Sketch("a"))
    assert project.folder == tmp_path / "teams" / project.id


def test_the_team_that_was_changed_last_is_the_first(store: TeamStore) -> None:

    names = [store.add(Sketch()) for _ in range(3)]
    for second, name in enumerate(names):
        os.utime(store.path(name) / "history.json", (second, second))
    assert store.ids() == names[::-1]


def test_nothing_is_left_of_a_team_that_is_removed(store: TeamStore) -> None:
    name = store.add(SKETCH)
    store.remove(name)
    assert (store.ids(), [*store.folder.iterdir()]) == ([], [])


@looped("name", ["", "..", "../../etc", "a" * 11, "a" * 13, "a/../b/../c/", "ä" * 12, "A.b.C.d.E.f."])
def test_what_is_no_id_is_no_path(store: TeamStore, name: str) -> None:
    with pytest.raises(KeyError):
        store.load(name)


@looped(
    "content",
    [
        b"", b"{", b"[1]", b'{"now": {"robots": [{}]}}', b"\xff\xfe", b"\0",
        b'{"x":' + b"[" * 200_000, b'{"now":{"rules":[{"settings":' + b"[" * 200_000,
    ],
)  # fmt: skip
def test_a_damaged_file_is_told(store: TeamStore, content: bytes) -> None:
    name = store.add(SKETCH)
    (store.path(name) / "history.json").write_bytes(content)
    for read in (store.load, store.now):
        with pytest.raises(ValueError, match=r"history\.json"):
            read(name)


def test_an_edit_is_saved_by_itself(store: TeamStore) -> None:
    name = store.add(SKETCH)

    async def edit() -> None:
        project = Project(store, name)
        project.edit(lambda sketch: renamed(sketch, "renamed"))
        assert store.load(name).now.name == "charging"
        await asyncio.to_thread(wait_until, lambda: store.load(name).now.name == "renamed", "it is not saved")

    asyncio.run(edit())


def test_all_that_look_are_told_of_each_change(store: TeamStore) -> None:
    async def edit() -> list[str]:
        projects = Projects(store)
        project = projects.add(SKETCH)
        assert projects.open(project.id) is project
        seen: list[str] = []
        end = project.on_change(lambda: seen.append(project.sketch.name))
        project.edit(lambda sketch: renamed(sketch, "second"))
        project.undo()
        project.undo()
        project.redo()
        with pytest.raises(EditError):
            project.edit(lambda sketch: renamed(sketch, "no name"))
        end()
        project.undo()
        projects.save()
        return seen

    assert asyncio.run(edit()) == ["second", "charging", "second"]


def test_the_number_of_steps_back_is_limited() -> None:
    history = History(Sketch())
    for step in range(MAX_STEPS + 10):
        history = history.edited(Sketch(f"n{step}"))
    assert len(history.before) == MAX_STEPS


def test_an_edit_forgets_what_was_undone() -> None:
    history = History(Sketch("a")).edited(Sketch("b")).undone().edited(Sketch("c"))
    assert (history.redone().now.name, history.undone().now.name) == ("c", "a")


# Hostile files, full disks, and two applications over one folder


UNSOUND = {
    "robots": Sketch(robots=tuple(SketchRobot(f"R{number}", Cell(0, 0)) for number in range(MAX_ROBOTS + 1))),
    "twins": Sketch(robots=(SketchRobot("A", Cell(0, 0)),) * 2),
    "map": Sketch(area=Area(MAX_SIDE + 1, 1)),
    "no map": Sketch(area=Area(0, 1)),
    "values": Sketch(decisions=(Decision("slot", DecisionKind.SLOT, tuple(range(MAX_VALUES + 1))),)),
    "number": Sketch(decisions=(Decision("slot", DecisionKind.SLOT, (10**400,)),)),
    "far away": Sketch(robots=(SketchRobot("A", Cell(-(10**30), 0)),)),
    "name": Sketch("n" * 100_000),
    "story": Sketch(story="s" * 100_000),
    "setting": Sketch(rules=(SketchRule("R1", "apart", "slot", settings={"distance": 10**400}),)),
    "rows": Sketch(rules=(SketchRule("R1", "table", "slot", settings={"rows": [[10**20, "x"]]}),)),
    "cost": Sketch(rules=(SketchRule("R1", "apart", "slot", cost=10**20),)),
}


@pytest.fixture
def full(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Let the disk be full, or not."""
    free = os.fsync
    is_full = [False]

    def fsync(descriptor: int) -> None:
        if is_full[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        free(descriptor)

    monkeypatch.setattr("os.fsync", fsync)
    return lambda now: is_full.__setitem__(0, now)


@looped("why", UNSOUND)
def test_a_sketch_beyond_all_bounds_is_damaged(store: TeamStore, why: str) -> None:
    name = store.add(Sketch())
    (store.path(name) / "history.json").write_bytes(msgspec.json.encode(History(UNSOUND[why])))
    for read in (store.load, store.now):
        with pytest.raises(ValueError, match=r"history\.json"):
            read(name)


def test_steps_beyond_all_bounds_cannot_be_undone(store: TeamStore) -> None:
    name = store.add(Sketch())
    hostile = History(Sketch("now"), (UNSOUND["number"],), (Sketch("next"),))
    (store.path(name) / "history.json").write_bytes(msgspec.json.encode(hostile))
    assert store.load(name) == History(Sketch("now"))


def test_a_file_that_is_too_large_is_damaged(store: TeamStore, monkeypatch: pytest.MonkeyPatch) -> None:
    name = store.add(Sketch())
    monkeypatch.setattr(app_store, "MAX_BYTES", 10)
    with pytest.raises(ValueError, match="more than"):
        store.load(name)


def test_a_long_history_is_kept_with_fewer_steps(store: TeamStore, monkeypatch: pytest.MonkeyPatch) -> None:
    name = store.add(Sketch())
    monkeypatch.setattr(app_store, "MAX_BYTES", 3_000)
    store.save(name, History(Sketch("now"), tuple(Sketch(f"s{step}") for step in range(100))))
    kept = store.load(name)
    assert kept.now == Sketch("now")
    assert kept.before[-1] == Sketch("s99")
    assert 1 < len(kept.before) < 100


def test_an_edit_that_could_not_be_read_again_is_refused(store: TeamStore) -> None:
    project = Project(store, store.add(Sketch()))
    for sketch in UNSOUND.values():
        with pytest.raises(EditError, match="unsound"):
            project.edit(lambda _, sketch=sketch: sketch)  # type: ignore[misc]


def test_a_full_disk_is_told_and_tried_again(
    store: TeamStore, full: Callable[[bool], None], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(app_projects, "SAVE_S", 0.0)
    monkeypatch.setattr(app_projects, "AGAIN_S", 0.0)
    name = store.add(Sketch("before"))
    heard: list[str] = []

    async def edit() -> None:
        told, saved = asyncio.Event(), asyncio.Event()
        projects = Projects(store)
        project = projects.open(name)
        full(True)

        def listen() -> None:
            heard.append(project.unsaved)
            (told if project.unsaved else saved).set()

        project.edit(lambda sketch: renamed(sketch, "after"))
        project.on_change(listen)
        await told.wait()
        assert store.load(name).now.name == "before"
        monkeypatch.setattr(logging.getLogger("robochoc.app"), "propagate", True)
        projects.save()
        full(False)
        await saved.wait()

    asyncio.run(edit())
    assert heard == [os.strerror(errno.ENOSPC), ""]
    assert store.load(name).now.name == "after"
    assert [file.name for file in store.path(name).iterdir()] == ["history.json"]
    assert "the last edits of after could not be saved" in caplog.text


def test_a_full_disk_leaves_no_half_of_a_new_team(store: TeamStore, full: Callable[[bool], None]) -> None:
    full(True)
    with pytest.raises(OSError, match="space"):
        store.add(Sketch())
    assert [*store.folder.iterdir()] == []


def test_a_team_that_was_removed_is_not_edited_and_not_made_again(store: TeamStore) -> None:
    async def edit() -> None:
        projects = Projects(store)
        project = projects.add(Sketch())
        heard: list[bool] = []
        project.on_change(lambda: heard.append(project.removed))
        project.edit(lambda sketch: renamed(sketch, "edited"))
        projects.remove(project.id)
        assert heard == [False, True]
        with pytest.raises(EditError, match="removed"):
            project.edit(lambda sketch: renamed(sketch, "again"))
        project.undo()
        project.save()
        with pytest.raises(EditError, match="removed"):
            Runs(project).start()

    asyncio.run(edit())
    wait_until(lambda: not [*store.folder.iterdir()], "something is left of it")


def test_two_applications_do_not_share_a_folder(store: TeamStore) -> None:
    with store.locked():
        with pytest.raises(InUseError, match="--folder"), TeamStore(store.folder).locked():
            pass
        assert store.ids() == []
    with TeamStore(store.folder).locked():
        pass


_SAVES = """
import sys
from pathlib import Path
from robochoc.app.sketch.history import History
from robochoc.app.sketch.sketch import Cell, Sketch, SketchRobot
from robochoc.app.store import TeamStore
store = TeamStore(Path(sys.argv[1]))
history = History(Sketch(robots=tuple(SketchRobot(f"R{i}", Cell(0, 0)) for i in range(900))))
while True:
    history = history.edited(Sketch(f"n{len(history.before)}", robots=history.now.robots))
    store.save(sys.argv[2], history)
    print(flush=True)
"""


def test_a_history_is_never_half_whenever_the_server_dies(store: TeamStore) -> None:
    name = store.add(Sketch())
    command: list[Any] = [sys.executable, "-c", _SAVES, store.folder, name]
    with store.locked(), subprocess.Popen(command, stdout=subprocess.PIPE) as saving:
        assert saving.stdout is not None
        for _ in range(12):
            saving.stdout.readline()
        saving.kill()
    assert len(store.load(name).before) >= 12
