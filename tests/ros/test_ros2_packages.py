"""The packages for ROS 2 in docs/ros2, without a ROS: metadata, launch files with a stand-in, and the service."""

from __future__ import annotations

import configparser
import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import pytest
from click.testing import CliRunner
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from robochoc.cli.group import cli
from robochoc.ros.interfaces import DECIDE_SERVICE
from robochoc.ros.message_types import types_of
from tests.support.program import ROOT

PACKAGES = ROOT / "docs" / "ros2"
LAUNCH = sorted((PACKAGES / "robochoc_ros" / "launch").glob("*.launch.py"))
HANGAR = str(ROOT / "docs" / "examples" / "hangar")


class Argument(NamedTuple):
    """What `DeclareLaunchArgument` is made with."""

    name: str
    default: str | None


class Configuration(str):
    """The value of an argument, which is not known yet."""

    __slots__ = ()


@pytest.fixture
def _launch(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in for the package `launch` of ROS 2, as far as launch files use it."""

    def declared(name: str, *, description: str, default_value: str | None = None) -> Argument:
        assert description.endswith(".")
        return Argument(name, default_value)

    def execute(*, cmd: list[str], output: str) -> list[str]:
        assert output == "screen"
        return cmd

    rooms: dict[str, dict[str, object]] = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {"DeclareLaunchArgument": declared, "ExecuteProcess": execute},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
    }
    for name, content in rooms.items():
        made = ModuleType(name)
        vars(made).update(content)
        monkeypatch.setitem(sys.modules, name, made)


@pytest.mark.parametrize("name", ["robochoc_msgs", "robochoc_ros"])
def test_the_metadata_of_a_package(name: str) -> None:
    root = ET.parse(PACKAGES / name / "package.xml").getroot()  # noqa: S314 - our own file
    found = [(one.tag, one.text) for one in root]
    assert (root.tag, root.get("format"), dict(found)["name"]) == ("package", "3", name)
    assert {"version", "description", "maintainer", "license"} <= dict(found).keys()
    kind = root.findtext("export/build_type")
    assert kind == {"robochoc_msgs": "ament_cmake", "robochoc_ros": "ament_python"}[name]
    groups = [text for tag, text in found if tag == "member_of_group"]
    assert (groups == ["rosidl_interface_packages"]) == (name == "robochoc_msgs")


def test_the_files_that_colcon_wants(monkeypatch: pytest.MonkeyPatch) -> None:
    package = PACKAGES / "robochoc_ros"
    made: dict[str, Any] = {}
    monkeypatch.chdir(package)
    monkeypatch.setitem(sys.modules, "setuptools", ModuleType("setuptools"))
    monkeypatch.setattr(sys.modules["setuptools"], "setup", lambda **given: made.update(given), raising=False)
    runpy.run_path("setup.py")
    assert (made["name"], made["packages"]) == ("robochoc_ros", ["robochoc_ros"])
    installed = dict(made["data_files"])
    assert all((package / file).is_file() for files in installed.values() for file in files)
    assert [Path(file).name for file in installed["share/robochoc_ros/launch"]] == [path.name for path in LAUNCH]
    assert installed["share/ament_index/resource_index/packages"] == ["resource/robochoc_ros"]
    config = configparser.ConfigParser()
    config.read(package / "setup.cfg")
    assert config["install"]["install_scripts"] == config["develop"]["script_dir"] == "$base/lib/robochoc_ros"


@pytest.mark.usefixtures("_launch")
@pytest.mark.parametrize("path", LAUNCH, ids=lambda path: path.name.partition(".")[0])
def test_a_launch_file_starts_what_robochoc_knows(path: Path, tmp_path: Path) -> None:
    *arguments, command = runpy.run_path(str(path))["generate_launch_description"]()
    defaults = {one.name: one.default for one in arguments}
    assert [name for name, default in defaults.items() if default is None] == ["team"]
    wanted = {word for word in command if isinstance(word, Configuration)}
    assert wanted == defaults.keys()
    given = {**defaults, "team": HANGAR}
    words = [given[word] if isinstance(word, Configuration) else word for word in command]
    assert words[0] == "robochoc"
    if "solve" in words:
        words[words.index("--ros") + 1] = f"mcap:{tmp_path}/run.mcap"
        assert CliRunner().invoke(cli, words[1:], catch_exceptions=False).exit_code == 0
        assert (tmp_path / "run.mcap").stat().st_size
    else:
        words[words.index("--ros") + 1] = "dds:nowhere"
        done = CliRunner().invoke(cli, words[1:], catch_exceptions=False)
        assert "'nowhere' is not a DDS domain" in done.stderr, "all else was accepted"


def test_the_service_is_the_one_that_is_offered() -> None:
    text = (PACKAGES / "robochoc_msgs" / "srv" / "Decide.srv").read_text(encoding="utf-8")
    assert "srv/Decide.srv" in (PACKAGES / "robochoc_msgs" / "CMakeLists.txt").read_text(encoding="utf-8")
    halves = text.split("\n---\n")
    ours_halves = DECIDE_SERVICE.split("---\n")
    for half, name, ours in zip(halves, ("Request", "Response"), ours_halves, strict=True):
        full = f"robochoc_msgs/msg/Decide_{name}"
        theirs = get_types_from_msg(half, full)
        assert theirs == get_types_from_msg(ours, full)
        store = get_typestore(Stores.ROS2_HUMBLE)
        store.register(theirs)
        assert [field for field, _ in store.fielddefs[full][1]] == [
            field for field, _ in types_of(2).layout(f"robochoc_msgs/Decide_{name}")
        ]
