"""Files are opened in a process of their own, which ends in time."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from robochoc.app import open_file
from robochoc.app.open_file import open_file_job
from robochoc.app.sketch.open_from_disk import ImportedTeam
from robochoc.app.store import FILES, TeamStore
from tests.support.limits import HANG_S
from tests.support.small_teams import pair

PROBLEM = """name: t
objective: min
domains: {d: {values: [0, 1]}}
variables: {x: {domain: d}, y: {domain: d}}
constraints: {c: {type: intention, function: x * y}}
agents: [a1, a2]
"""


def opened(text: str, folder: Path, *, within_s: float = HANG_S) -> tuple[TeamStore, open_file.OpenedFile]:
    """Return a store, and the result of opening a file with `text` as a team of it."""
    file, store = folder / "t.yaml", TeamStore(folder / "store")
    file.write_text(text)
    return store, open_file_job(file, store, within_s=within_s).future.result(HANG_S)


def test_a_file_becomes_a_team(tmp_path: Path) -> None:
    store, found = opened(PROBLEM, tmp_path)
    assert found.mistakes == ""
    assert store.ids() == [found.team]
    assert store.facts(found.team).origin == "t.yaml"
    assert sorted(file.name for file in (store.path(found.team) / FILES).glob("*.xml")) == ["a1.xml", "a2.xml"]


def test_mistakes_and_a_reader_out_of_time_leave_no_team(tmp_path: Path) -> None:
    store, found = opened(PROBLEM.replace("x * y", "x * z"), tmp_path)
    assert "'z', which is not a variable" in found.mistakes
    _, late = opened(PROBLEM, tmp_path, within_s=0.0)
    assert "t.yaml could not be read within 0 s" in late.mistakes
    assert list(store.folder.iterdir()) == []
    assert (found.team, late.team) == ("", "")


def test_a_team_is_there_once_its_files_are_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        assert len(list(store.folder.iterdir())) == 1
        assert store.ids() == []
        raise OSError(errno.ENOSPC, "No space left on device")

    store = TeamStore(tmp_path)
    monkeypatch.setattr(ImportedTeam, "save", full)
    with pytest.raises(OSError, match="No space"):
        store.add_imported(ImportedTeam(tmp_path, pair()))
    assert list(store.folder.iterdir()) == []
    (tmp_path / ".new-0123").mkdir()
    with store.locked():
        assert [file.name for file in tmp_path.iterdir()] == [".lock"]
