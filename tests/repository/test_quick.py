"""The choice of `make quick`."""

from __future__ import annotations

import subprocess
from pathlib import Path

import grimp

from tests.support.quick import changed_files, touched


def test_the_nearest_tests_come_first() -> None:
    graph = grimp.ImportGraph()
    for importer, imported in (
        ("robochoc.run.api", "robochoc.model.team"),
        ("tests.support.teams", "robochoc.model.team"),
        ("tests.cli.test_api", "robochoc.run.api"),
        ("tests.unit.model.test_far", "tests.support.teams"),
        ("tests.cli.test_team", "robochoc.model.team"),
        ("tests.unit.model.test_team", "robochoc.model.team"),
        ("tests.unit.run.test_other", "robochoc.run.options"),
    ):
        graph.add_import(importer=importer, imported=imported)
    near = ["tests.unit.model.test_team", "tests.cli.test_team", "tests.unit.model.test_far", "tests.cli.test_api"]
    assert touched(graph, ["robochoc.model.team", "robochoc.model.unknown"]) == near
    assert touched(graph, ["tests.cli.test_api", "robochoc.run.options"]) == [
        "tests.cli.test_api",
        "tests.unit.run.test_other",
    ]


def test_a_change_is_what_main_has_not(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@b")
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    git("init", "-b", "main")
    for name in ("same", "committed", "edited", "removed"):
        (tmp_path / name).write_text("")
    git("add", "-A")
    git("commit", "-m", "1")
    git("checkout", "-b", "branch")
    (tmp_path / "committed").write_text("2")
    git("commit", "-am", "2")
    (tmp_path / "edited").write_text("3")
    (tmp_path / "removed").unlink()
    (tmp_path / "new").write_text("4")
    assert changed_files(tmp_path, "main") == ["committed", "edited", "new"]
