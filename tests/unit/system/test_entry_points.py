"""Entry points read without `importlib.metadata` are what `importlib.metadata` reads."""

from __future__ import annotations

import importlib
import importlib.metadata
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from importlib.metadata import MetadataPathFinder
from pathlib import Path

import pytest

from robochoc.system.entry_points import EntryPoint, entry_points

ENTRIES = """
# a comment
[console_scripts]
mine = mine:main

[robochoc.protocols]
own=mine.own:Own
 spaced  =  mine:Spaced [extra]
dotted = mine:Outer.Inner

[robochoc.protocols.not]
other = mine:Other
"""


def found(entries: Iterable[importlib.metadata.EntryPoint | EntryPoint]) -> list[tuple[str, str, str, str]]:
    return sorted((one.name, one.value, one.dist.name, one.dist.version) for one in entries if one.dist)


def package(folder: Path, name: str, info: str) -> None:
    (folder / info).mkdir(parents=True)
    (folder / info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (folder / info / "PKG-INFO").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (folder / info / "entry_points.txt").write_text(ENTRIES)


def test_all_groups_of_all_installed_packages_are_read_alike() -> None:
    groups = importlib.metadata.entry_points().groups
    assert {"robochoc.protocols", "console_scripts"} <= groups
    for group in groups:
        assert found(entry_points(group)) == found(importlib.metadata.entry_points(group=group))


@pytest.mark.parametrize("info", ["mine-1.0.dist-info", "mine.egg-info", "mine-1.0-py3.11.egg-info"])
def test_a_package_is_read_as_importlib_does(info: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(tmp_path, "mine", info)
    monkeypatch.syspath_prepend(tmp_path)
    group = "robochoc.protocols"
    assert found(entry_points(group)) == found(importlib.metadata.entry_points(group=group))
    assert {"own", "spaced", "dotted"} <= {entry.name for entry in entry_points(group)}


def test_of_two_packages_of_one_name_the_first_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for place, info in (("first", "my_own-1.0.dist-info"), ("second", "My.Own-2.0.dist-info")):
        package(tmp_path / place, "my-own", info)
        monkeypatch.syspath_prepend(tmp_path / place)
    assert [entry.name for entry in entry_points("robochoc.protocols")].count("own") == 1


def test_packages_in_a_zip_file_are_left_to_importlib(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    archive = tmp_path / "packages.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.writestr("mine-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
        packed.writestr("mine-1.0.dist-info/entry_points.txt", ENTRIES)
    monkeypatch.syspath_prepend(archive)
    assert ("own", "mine.own:Own", "mine", "1.0") in found(entry_points("robochoc.protocols"))
    MetadataPathFinder().invalidate_caches()  # importlib keeps the archive open,
    importlib.invalidate_caches()  # and so does its backport, where Dask has brought it


def test_loading_gives_the_attribute() -> None:
    (abt,) = (entry for entry in entry_points("robochoc.protocols") if entry.name == "abt")
    assert getattr(abt.load(), "__name__", "") == "ABT"


def test_a_run_imports_neither_importlib_metadata_nor_what_it_brings() -> None:
    code = (
        "import sys; from robochoc.run.registry import protocol_named; protocol_named('abt');"
        "print(*sorted({'importlib.metadata', 'email', 'csv', 'zipfile'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
