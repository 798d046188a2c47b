"""A team that was drawn, as files: it comes back as it was, and what is wrong with files is told."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path
from random import Random

import msgspec
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from robochoc.app.flights.saved_state import unpack_run
from robochoc.app.imported.facts import facts_of
from robochoc.app.sketch import files, open_from_disk
from robochoc.app.sketch.building import decided, model_of
from robochoc.app.sketch.example_sketches import KEYS, example
from robochoc.app.sketch.files import save, xml_sources, zipped
from robochoc.app.sketch.open_from_disk import ImportedTeam, open_team
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.formats import InvalidInputError, read_team
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.program import ROOT, robochoc_within
from tests.support.sketches import random_sketch, without_costs

ROBOTS = tuple(SketchRobot(name, Cell(place, 0), weight=place + 1) for place, name in enumerate(("Ann", "Bob", "Cid")))
LEVEL, TASK = Decision("level", DecisionKind.LEVEL, (1, 2, 3)), Decision("task", DecisionKind.TASK, ("wash up", "dry"))
RULES = (
    SketchRule("R1", "different", "level"),
    SketchRule("R2", "little", "level", settings={"step": 2}),
    SketchRule("R3", "table", "task", ("Ann", "Cid"), {"rows": [["dry", "wash up"]]}, cost=4),
)
TEAM = Sketch("team", Area(4, 2), ROBOTS, (LEVEL, TASK), RULES, "A story.")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save(TEAM, tmp_path / "kept")
    return tmp_path / "kept"


def refused(path: Path) -> str:
    """What is told of a path that cannot be opened: one line."""
    with pytest.raises(InvalidInputError) as told:
        open_team(path)
    assert len(told.value.diagnostics) == 1
    return str(told.value)


def test_what_was_saved_is_opened_as_it_was(folder: Path) -> None:
    assert open_team(folder) == TEAM


def test_the_files_are_those_that_are_shown(folder: Path) -> None:
    assert {file.name: file.read_text() for file in folder.glob("*.xml")} == xml_sources(TEAM)
    assert read_team(folder).kind == model_of(TEAM).team.kind


@given(seed=st.integers(0, 10**9))
@examples(15, also_suppress=(HealthCheck.function_scoped_fixture,))
def test_any_sketch_comes_back_and_is_the_same_team(tmp_path: Path, seed: int) -> None:
    sketch = without_costs(random_sketch(Random(seed)))
    save(sketch, tmp_path / "team", replace=True)
    assert open_team(tmp_path / "team") == sketch
    here, there = model_of(sketch).team, read_team(tmp_path / "team")
    assert {robot.name: robot.weight for robot in there.robots} == {robot.name: robot.weight for robot in here.robots}
    assert sorted(str(one.name) for one in there.constraints()) == sorted(str(one.name) for one in here.constraints())


def test_the_commands_take_it_and_decide_the_same(folder: Path) -> None:
    assert robochoc_within("validate", folder).returncode == 0
    done = robochoc_within("solve", folder, "--runtime", "simulator", "--json")
    told, outcome = json.loads(done.stdout), model_of(TEAM).solve(runtime="simulator")
    assert (told["verdict"], told["cost"]) == (outcome.verdict, outcome.cost) == ("optimal", 12)
    values = dict(outcome.values)
    assert {f"{robot}.{name}": value for (robot, name), value in decided(TEAM, told["assignment"]).items()} == values
    assert "wash up" in values.values()
    assert open_team(folder) == TEAM


@pytest.mark.slow
@looped("key", KEYS)
def test_every_example_is_decided_by_the_commands_as_in_this_process(tmp_path: Path, key: str) -> None:
    sketch, folder = example(key), tmp_path / key
    save(sketch, folder)
    assert robochoc_within("validate", folder).returncode == 0
    told = json.loads(robochoc_within("solve", folder, "--runtime", "simulator", "--json").stdout)
    outcome = model_of(sketch).solve(runtime="simulator")
    assert (told["verdict"], told["cost"]) == (outcome.verdict, outcome.cost)
    assert len(decided(sketch, told["assignment"])) == len(outcome.values)
    assert open_team(folder) == sketch


def test_a_team_that_is_there_is_replaced_only_when_asked(folder: Path) -> None:
    with pytest.raises(InvalidInputError, match="already exists"):
        save(TEAM, folder)
    other = msgspec.structs.replace(TEAM, rules=())
    save(other, folder, replace=True)
    assert open_team(folder) == other


def test_a_sketch_with_errors_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="There is no robot yet"):
        save(Sketch(), tmp_path / "team")
    assert not (tmp_path / "team").exists()


def test_files_that_were_changed_by_hand_are_opened_as_what_they_are(folder: Path) -> None:
    file = folder / "Ann.xml"
    file.write_text(file.read_text().replace("<presentation", '<presentation weight="9"', 1))
    found = open_team(folder)
    assert isinstance(found, ImportedTeam)
    assert (found.changed, found.name, found.robots) == (("Ann.xml",), "kept", ("Ann", "Bob", "Cid"))
    assert found.team["Ann"].weight == 9


def test_a_file_more_or_less_is_a_change(folder: Path) -> None:
    (folder / "Dan.xml").write_bytes((folder / "Ann.xml").read_bytes())
    with pytest.raises(InvalidInputError):
        open_team(folder)


def test_a_team_with_several_objectives_is_opened() -> None:
    found = open_team(ROOT / "docs/examples/survey")
    assert isinstance(found, ImportedTeam)
    assert facts_of(found.team).objectives == ("energy", "risk")


@looped("name", ["patrol", "rescue", "hangar"])
def test_a_team_of_others_is_opened_as_what_it_is(tmp_path: Path, name: str) -> None:
    path = ROOT / "docs/examples" / name
    found = open_team(path)
    assert isinstance(found, ImportedTeam)
    assert (found.changed, found.path, found.team) == ((), path, read_team(path))
    assert found.variables >= len(found.robots) > 0 < found.constraints
    found.save(tmp_path / name)
    assert read_team(tmp_path / name) == found.team


def test_a_file_of_another_tool_is_opened(tmp_path: Path) -> None:
    done = robochoc_within(
        "export", ROOT / "docs/examples/patrol", "-o", tmp_path / "patrol.yaml", "--format", "pydcop"
    )
    assert done.returncode == 0, done.stderr
    found = open_team(tmp_path / "patrol.yaml")
    assert isinstance(found, ImportedTeam)
    assert set(found.robots) == set(read_team(ROOT / "docs/examples/patrol").order)


def test_an_archive_is_opened_as_its_folder(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(zipped(TEAM))
    assert open_team(tmp_path / "a.zip") == TEAM


def archive(path: Path, *members: tuple[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in members:
            made.writestr(name, content)
    return path


def test_an_archive_of_a_team_with_a_scenario_is_opened(tmp_path: Path) -> None:
    folder = ROOT / "docs/examples/rescue"
    files = [(str(file.relative_to(folder)), file.read_bytes()) for file in folder.rglob("*.xml")]
    for prefix in ("", "rescue/"):
        path = archive(tmp_path / "rescue.zip", *((prefix + name, content) for name, content in files))
        found = open_team(path)
        assert isinstance(found, ImportedTeam)
        assert (found.path, found.team) == (path, read_team(folder))


def test_nothing_of_an_archive_leaves_its_folder(tmp_path: Path) -> None:
    ann = xml_sources(TEAM)["Ann.xml"].encode()
    names = ("../Ann.xml", "/Ann.xml", "a/../../Ann.xml", "../../etc/Ann.xml")
    path = archive(tmp_path / "a.zip", *((name, ann) for name in names))
    assert "the archive contains no XML files of a team" in refused(path)
    assert [*tmp_path.rglob("*.xml")] == []


def test_an_archive_that_is_much_larger_than_it_looks_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(open_from_disk, "MAX_BYTES", 100_000)
    assert "has more than" in refused(archive(tmp_path / "a.zip", ("A.xml", b" " * 200_000)))
    monkeypatch.setattr(open_from_disk, "MAX_FILES", 3)
    assert "has more than" in refused(archive(tmp_path / "b.zip", *((f"A{number}.xml", b"") for number in range(5))))


def test_mistakes_in_an_archive_are_told_by_the_names_in_it(tmp_path: Path) -> None:
    told = refused(archive(tmp_path / "a.zip", ("Ann.xml", b"<instance")))
    assert told.startswith("a/Ann.xml:")
    kept = xml_sources(TEAM).items()
    path = archive(tmp_path / "b.zip", *((name, text.encode()) for name, text in kept if name != "Ann.xml"))
    with pytest.raises(InvalidInputError, match=r"there is no b/Ann\.xml"):
        open_team(path)


def test_an_archive_of_two_teams_is_refused(tmp_path: Path) -> None:
    assert "more than once" in refused(archive(tmp_path / "a.zip", ("one/A.xml", b""), ("two/A.xml", b"")))


def test_an_archive_that_lists_a_million_files_is_refused_before_the_list_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(open_from_disk.BoundedFile, "most", 5_000)
    assert "its list of files has more than" in refused(
        archive(tmp_path / "a.zip", *((f"{n}.txt", b"") for n in range(100)))
    )
    assert not unpack_run(tmp_path / "a.zip", tmp_path)
    archive(tmp_path / "b.zip", ("A.txt", b"0" * 10_000))
    with open_from_disk.bounded_archive(tmp_path / "b.zip") as found:
        assert len(found.read("A.txt")) == 10_000


@looped("content", [b"PK\x03\x04 rest", zipped(TEAM)[:-40], zipped(TEAM)[:200] + b"\0" * 300 + zipped(TEAM)[500:]])
def test_a_damaged_archive_is_told(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.zip").write_bytes(content)
    assert refused(tmp_path / "a.zip")


HOSTILE = {
    "empty": b"",
    "no json": b"<script>",
    "deep": b"[" * 100_000,
    "deep setting": b'{"version":1,"digest":"","sketch":{"rules":[{"id":"R1","kind":"a","decision":"b","settings":{"a":'
    + b"[" * 9_999,
    "not utf-8": b'{"version":1,"digest":"\xff"}',
    "large number": b'{"version":1,"digest":"","sketch":{"area":{"columns":' + b"9" * 5_000 + b"}}}",
    "newer": b'{"version":2,"digest":"","sketch":{"robots":7},"more":1}',
}


@looped("what", HOSTILE)
def test_a_damaged_sketch_is_told(folder: Path, what: str) -> None:
    (folder / "sketch.json").write_bytes(HOSTILE[what])
    told = refused(folder)
    assert "sketch.json" in told
    assert ("newer version" in told) == (what == "newer")


def test_a_sketch_that_is_too_large_or_no_file_is_told(folder: Path) -> None:
    with (folder / "sketch.json").open("r+b") as file:
        file.truncate(17 << 20)
    assert "has more than 16 MiB" in refused(folder)
    (folder / "sketch.json").unlink()
    os.mkfifo(folder / "sketch.json")
    assert "not a regular file" in refused(folder)


def test_a_sketch_with_errors_is_told_though_nothing_was_changed(tmp_path: Path) -> None:
    robots = (SketchRobot("<script>", Cell(0, 0)),)
    hostile, ann = msgspec.structs.replace(TEAM, robots=robots), xml_sources(TEAM)["Ann.xml"].encode()
    (tmp_path / "Ann.xml").write_bytes(ann)
    (tmp_path / "sketch.json").write_bytes(files.sketch_file(hostile, {"Ann.xml": ann}))
    assert "is not a valid name of a robot" in refused(tmp_path)


def test_a_sketch_that_was_changed_by_hand_is_not_taken_for_the_team(folder: Path) -> None:
    kept = json.loads((folder / "sketch.json").read_text())
    kept["sketch"]["rules"][1]["settings"]["step"] = 9
    (folder / "sketch.json").write_text(json.dumps(kept))
    found = open_team(folder)
    assert isinstance(found, ImportedTeam)
    assert found.changed


def test_what_is_nothing_of_ours_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("hello")
    (tmp_path / "a.xml").write_text("<a/>")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "empty").mkdir()
    told = {name: refused(tmp_path / name) for name in ("a.txt", "a.xml", "pipe", "empty", "missing")}
    assert "unknown format" in told["a.txt"]
    assert "open the team's folder" in told["a.xml"]
    assert "no robot here" in told["empty"]


def test_a_team_of_too_many_files_is_told_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(open_from_disk, "MAX_FILES", 3)
    for number in range(4):
        (tmp_path / f"A{number}.xml").touch()
    assert "robochoc solve" in refused(tmp_path)
