"""The state of a team as one file: packed here, opened there."""

from __future__ import annotations

import errno
import io
import shutil
import zipfile
from pathlib import Path
from random import Random

import msgspec
import pytest

from robochoc.app.flights import saved_state
from robochoc.app.flights.saved_state import MAX_BYTES, MAX_JOURNAL_BYTES, file_name, is_too_long, packed, unpack_run
from robochoc.app.imported.picture import picture_sketch
from robochoc.app.runs.options import JOURNAL
from robochoc.app.runs.run import CHANGE, SKETCH, Checked
from robochoc.app.runs.runs import Runs
from robochoc.app.sketch import open_from_disk
from robochoc.app.sketch.open_from_disk import ImportedTeam, open_team
from robochoc.app.sketch.sketch import MAX_ROBOTS, Area, Cell, Sketch, SketchRobot
from robochoc.app.store import TeamStore
from robochoc.formats import read_team
from tests.support.cases import looped
from tests.support.kept_runs import cube, kept_run
from tests.support.program import ROOT


class Team:
    """A team that is no project."""

    def __init__(self, sketch: Sketch, folder: Path) -> None:
        self.sketch = sketch
        self.folder = folder


def _file(folder: Path, content: bytes) -> Path:
    file = folder / "Cube.robochoc.zip"
    file.write_bytes(content)
    return file


def _changed(content: bytes, **entries: bytes) -> bytes:
    """Return an archive with other contents for the files of the run of these names (`_` is a dot)."""
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(changed, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            key = name.rpartition("/")[2].replace(".", "_")
            new.writestr(name, entries.get(key, old.read(name)) if "/run/" in name else old.read(name))
    return changed.getvalue()


def test_what_is_packed_is_the_same_elsewhere(tmp_path: Path) -> None:
    run = kept_run(tmp_path / "here", cube())
    file = _file(tmp_path, packed(run))
    assert open_team(file) == run.sketch
    assert unpack_run(file, tmp_path / "there")
    again = Runs(Team(Sketch(), tmp_path / "there")).latest
    assert again is not None
    assert (again.sketch, again.result, again.state) == (run.sketch, run.result, run.state)
    assert again.record == msgspec.structs.replace(run.record, opened=True, checked=Checked.KEPT)
    assert (again.folder / "run.journal").read_bytes() == b"what was said"


def test_the_same_run_makes_the_same_file(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    assert packed(run) == packed(run)


def test_a_file_without_a_run_makes_none(tmp_path: Path) -> None:
    assert not unpack_run(_file(tmp_path, b"no archive"), tmp_path / "there")
    empty = io.BytesIO()
    zipfile.ZipFile(empty, "w").close()
    assert not unpack_run(_file(tmp_path, empty.getvalue()), tmp_path / "there")
    assert not (tmp_path / "there").exists()


@pytest.mark.parametrize("missing", ["run.json", "sketch.json"])
def test_a_damaged_run_is_left_out(tmp_path: Path, missing: str) -> None:
    content = packed(kept_run(tmp_path, cube()))
    broken = _changed(content, **{missing.replace(".", "_"): b"{"})
    assert not unpack_run(_file(tmp_path, broken), tmp_path / "there")


def test_a_run_of_too_many_robots_is_left_out(tmp_path: Path) -> None:
    many = msgspec.structs.replace(
        cube(), robots=tuple(SketchRobot(f"R{number}", Cell(0, 0)) for number in range(MAX_ROBOTS + 1))
    )
    content = _changed(packed(kept_run(tmp_path, cube())), sketch_json=msgspec.json.encode(many))
    assert not unpack_run(_file(tmp_path, content), tmp_path / "there")


def test_names_in_an_archive_are_no_paths(tmp_path: Path) -> None:
    content = io.BytesIO(packed(kept_run(tmp_path / "here", cube())))
    with zipfile.ZipFile(content, "a") as archive:
        for name in ("Cube/run/1/../../../../evil", "/run/1/evil", "Cube/run/1/run.json/../evil", "Cube/run/1/x.html"):
            archive.writestr(name, b"evil")
    assert unpack_run(_file(tmp_path, content.getvalue()), tmp_path / "there")
    assert sorted(one.name for one in (tmp_path / "there").rglob("*") if one.is_file()) == [
        "result.json",
        "run.journal",
        "run.json",
        "sketch.json",
    ]


def test_a_bomb_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_BYTES < 1 << 30
    monkeypatch.setattr("robochoc.app.flights.saved_state.MAX_BYTES", 1 << 20)
    content = _changed(packed(kept_run(tmp_path, cube())), run_journal=bytes(1 << 22))
    assert not unpack_run(_file(tmp_path, content), tmp_path / "there")


def test_the_run_of_a_team_of_files_comes_back_with_its_files(tmp_path: Path) -> None:
    files = ROOT / "docs/examples/rescue"
    found = open_team(files)
    assert isinstance(found, ImportedTeam)
    run = kept_run(tmp_path / "here", picture_sketch(found))
    shutil.copytree(files, run.team)
    file = _file(tmp_path, packed(run))
    again = open_team(file)
    assert isinstance(again, ImportedTeam)
    assert again.team.robots == found.team.robots
    store = TeamStore(tmp_path / "there")
    name = store.add_imported(again)
    assert unpack_run(file, store.path(name))
    there = Runs(Team(store.now(name), store.path(name))).latest
    assert there is not None
    assert there.result == run.read_result()
    assert read_team(there.team) == read_team(files)


def test_a_full_disk_leaves_no_part_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = _file(tmp_path, packed(kept_run(tmp_path / "here", cube())))
    (tmp_path / "there").mkdir()
    write = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if path.name == SKETCH:
            raise OSError(errno.ENOSPC, "full")
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="full"):
        unpack_run(file, tmp_path / "there")
    assert [*(tmp_path / "there" / "runs").iterdir()] == []


def test_too_long_a_journal_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = kept_run(tmp_path, cube())
    monkeypatch.setattr("robochoc.app.flights.saved_state.MAX_JOURNAL_BYTES", 12)
    assert is_too_long(run)
    with zipfile.ZipFile(io.BytesIO(packed(run))) as archive:
        assert not any(name.endswith("run.journal") for name in archive.namelist())
        assert any(name.endswith("result.json") for name in archive.namelist())


def test_the_messages_that_are_packed_can_be_opened_again(tmp_path: Path) -> None:
    run = kept_run(tmp_path / "here", cube())
    (run.folder / JOURNAL).write_bytes(Random(0).randbytes(1 << 20))  # nothing makes this any smaller
    others = len(packed(run)) - (1 << 20)
    assert MAX_JOURNAL_BYTES + others <= open_from_disk.MAX_BYTES
    with (run.folder / JOURNAL).open("r+b") as journal:
        journal.truncate(MAX_JOURNAL_BYTES)
    assert not is_too_long(run)
    with (run.folder / JOURNAL).open("r+b") as journal:
        journal.truncate(MAX_JOURNAL_BYTES + 1)
    assert is_too_long(run)


@looped(
    "change",
    [
        b"{",
        b'{"after": 3}',
        b"[" * 100_000,
        msgspec.json.encode({"after": Sketch("n" * 100_000), "happened": []}),
        msgspec.json.encode({"after": Sketch(area=Area(10**6, 10**6)), "happened": []}),
        msgspec.json.encode({"after": cube(), "happened": ["told" * 10] * 10_000}),
    ],
)
def test_a_run_with_an_unsound_change_is_left_out(tmp_path: Path, change: bytes) -> None:
    run = kept_run(tmp_path / "here", cube())
    (run.folder / CHANGE).write_bytes(msgspec.json.encode({"after": cube(2), "happened": ["Drone3 fails."]}))
    content = packed(run)
    assert unpack_run(_file(tmp_path, content), tmp_path / "there")
    assert not unpack_run(_file(tmp_path, _changed(content, change_json=change)), tmp_path / "elsewhere")
    assert not (tmp_path / "elsewhere").exists()


@looped("name", ["run.json", "sketch.json", "change.json", "result.json"])
def test_too_large_a_file_of_a_run_is_not_read_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    run = kept_run(tmp_path / "here", cube())
    (run.folder / CHANGE).write_bytes(msgspec.json.encode({"after": cube(2)}))
    content = packed(run)
    monkeypatch.setitem(saved_state.MOST_AT_ONCE, name, 10)
    assert not unpack_run(_file(tmp_path, content), tmp_path / "there")


# Names of files


@looped(
    ("name", "expected"),
    [
        ("Cube", "Cube.zip"),
        ("../../etc/passwd", "etc-passwd.zip"),
        ('a"; filename="b.exe', "a-filename-b-exe.zip"),
        ("a\r\nSet-Cookie: x", "a-Set-Cookie-x.zip"),
        ("", "team.zip"),
        ("...", "team.zip"),
        ("NUL", "team.zip"),
        ("com1", "team.zip"),
        ("дрон", "team.zip"),
        ("x" * 500, "x" * 60 + ".zip"),
    ],
)
def test_whatever_a_team_is_called_its_file_has_a_plain_name(name: str, expected: str) -> None:
    assert file_name(name, ".zip") == expected
