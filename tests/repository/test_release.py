"""One version in all files that name it, and files that other programs read: citation, workflows, issue forms."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import yaml

from robochoc import __version__
from tests.support.program import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_the_version_is_written_in_one_place_and_the_same_where_others_need_it() -> None:
    assert "version" not in PROJECT["project"]
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["hatch"]["version"] == {"path": "robochoc/__init__.py"}
    quoted = {
        "CITATION.cff": r"^version: (.+)$",
        "docs/ros2/robochoc_msgs/package.xml": r"<version>(.+)</version>",
        "docs/ros2/robochoc_ros/package.xml": r"<version>(.+)</version>",
        "docs/ros2/robochoc_ros/setup.py": r'version="(.+)"',
    }
    found = {file: re.findall(pattern, (ROOT / file).read_text(), re.MULTILINE) for file, pattern in quoted.items()}
    assert found == {file: [__version__] for file in quoted}


def test_the_citation_has_what_its_format_requires() -> None:
    """The keys that version 1.2.0 of the Citation File Format requires; `make lint` checks the rest by its schema."""
    citation: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert citation["message"]
    assert citation["title"].startswith("robochoc")
    assert citation["authors"] == [{"name": author["name"]} for author in PROJECT["project"]["authors"]]
    assert citation["license"] == PROJECT["project"]["license"]
