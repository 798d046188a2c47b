"""Teams on disk, and in memory: saved whole, undone step by step, told to all who look."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from robochoc.app.projects import Project, Projects
from robochoc.app.sketch.edits import EditError, renamed, with_robot
from robochoc.app.sketch.history import MAX_STEPS, History
from robochoc.app.sketch.sketch import Cell, Decision, Kind, Sketch, SketchRule
from robochoc.app.store import Store
from tests.support.cases import looped
from tests.support.limits import wait_until

SKETCH = with_robot(
    Sketch(
        "charging",
        decisions=(Decision("slot", Kind.SLOT, (1, 2, 3)), Decision("task", Kind.TASK, ("look", "carry"))),
        rules=(SketchRule("R1", "table", "task", ("A", "B"), {"rows": [["look", "carry"]], "n": 1}, 3),),
    ),
    Cell(1, 2),
    "A",
)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty store."""
    return Store(tmp_path / "teams")


def test_a_team_comes_back_as_it_was(store: Store) -> None:
    history = History(SKETCH).edited(renamed(SKETCH, "other")).undone()
    name = store.add(Sketch())
    store.save(name, history)
    assert store.load(name) == history


def test_a_relative_folder_is_the_same_in_all_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    project = Projects(Store(Path("teams"))).add(Sketch("a"))
    assert project.folder == tmp_path / "teams" / project.id


def test_the_team_that_was_changed_last_is_the_first(store: Store) -> None:

    names = [store.add(Sketch()) for _ in range(3)]
    for second, name in enumerate(names):
        os.utime(store.path(name) / "history.json", (second, second))
    assert store.ids() == names[::-1]


def test_nothing_is_left_of_a_team_that_is_removed(store: Store) -> None:
    name = store.add(SKETCH)
    store.remove(name)
    assert (store.ids(), [*store.folder.iterdir()]) == ([], [])


@looped("name", ["", "..", "../../etc", "a" * 11, "a" * 13, "a/../b/../c/", "ä" * 12, "A.b.C.d.E.f."])
def test_what_is_no_id_is_no_path(store: Store, name: str) -> None:
    with pytest.raises(KeyError):
        store.load(name)


@looped("content", [b"", b"{", b"[1]", b'{"now": {"robots": [{}]}}', b"\xff\xfe"])
def test_a_damaged_file_is_told(store: Store, content: bytes) -> None:
    name = store.add(SKETCH)
    (store.path(name) / "history.json").write_bytes(content)
    with pytest.raises(ValueError, match=r"history\.json"):
        store.load(name)


def test_an_edit_is_saved_by_itself(store: Store) -> None:
    name = store.add(SKETCH)

    async def edit() -> None:
        project = Project(store, name)
        project.edit(lambda sketch: renamed(sketch, "renamed"))
        assert store.load(name).now.name == "charging"
        await asyncio.to_thread(wait_until, lambda: store.load(name).now.name == "renamed", "it is not saved")

    asyncio.run(edit())


def test_all_that_look_are_told_of_each_change(store: Store) -> None:
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
