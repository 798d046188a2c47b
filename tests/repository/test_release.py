"""One version in all files that name it, and files that other programs read: citation, workflows, issue forms."""

from __future__ import annotations

import ast
import importlib
import re
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec
import pytest
import yaml
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager

from hatch_build import long_description, split_structs
from robochoc import __version__
from tests.support.extra_imports import imports_of, modules_for
from tests.support.program import ROOT
from tests.support.release import FOR_DEVELOPERS, NEEDED, extras, faults_of, package_files, too_large

PATH = r"(?:robochoc|tests)/[\w/.]+"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_the_version_is_written_in_one_place_and_the_same_where_others_need_it() -> None:
    assert "version" not in PROJECT["project"]
    assert "version" in PROJECT["project"]["dynamic"]
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


def test_workflows_run_targets_that_exist_and_actions_of_known_owners() -> None:
    targets = {*re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)}
    used, actions = set(), set()
    paths = {*re.findall(PATH, PROJECT["tool"]["cibuildwheel"]["test-command"])}
    for file in (ROOT / ".github" / "workflows").glob("*.yml"):
        workflow = yaml.safe_load(file.read_text())
        assert workflow["permissions"] == {"contents": "read"}, file  # more is granted to single jobs
        for job in workflow["jobs"].values():
            assert job["timeout-minutes"] <= 120, file
            actions |= {step["uses"].partition("/")[0] for step in job["steps"] if "uses" in step}
            runs = [step["run"] for step in job["steps"] if "run" in step]
            paths |= {path for run in runs for path in re.findall(PATH, run)}
            used |= {
                word
                for run in runs
                for words in re.findall(r"^make (.+)$", run, re.MULTILINE)
                for word in words.split()
            }
    assert {"lint", "type", "test", "docs", "release"} <= used <= targets
    assert {"robochoc/__init__.py", "tests/portable"} <= paths
    assert [path for path in sorted(paths) if not (ROOT / path).exists()] == []
    assert actions == {"actions", "pypa"}


def test_only_the_jobs_that_publish_may_publish() -> None:
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text())
    allowed = {name: job.get("permissions") for name, job in workflow["jobs"].items()}
    assert allowed == {
        "sdist": None,
        "wheels": None,
        "publish": {"id-token": "write", "attestations": "write"},
        "site": {"contents": "write"},
    }
    assert {*workflow["jobs"]["publish"]["needs"]} == {"sdist", "wheels"}
    assert workflow["jobs"]["publish"]["environment"]["name"] == "pypi"
    assert workflow["jobs"]["site"]["needs"] == "publish"


def test_the_classifiers_name_the_systems_and_pythons_that_the_workflow_tests() -> None:
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text())["jobs"]
    systems = {"ubuntu-latest": "POSIX :: Linux", "macos-latest": "MacOS", "windows-latest": "Microsoft :: Windows"}
    tested = {jobs["linux"]["runs-on"], *jobs["other-systems"]["strategy"]["matrix"]["os"]}
    pythons = jobs["linux"]["strategy"]["matrix"]["python"]
    named = {line for line in PROJECT["project"]["classifiers"] if line.startswith(("Operating", "Programming"))}
    assert named - {"Programming Language :: Python :: 3 :: Only"} == {
        *(f"Operating System :: {systems[system]}" for system in tested),
        *(f"Programming Language :: Python :: {python}" for python in pythons),
    }


# The long description

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_without_a_repository_the_long_description_has_no_links_into_it() -> None:
    shown = long_description(README, "", "1.0.0")
    assert "![" not in shown
    assert re.findall(r"\]\((?!https?://)", shown) == []
    assert "pip install robochoc" in shown
    assert re.findall(r"pip install '?\.|make demo|<!--", shown) == []


def test_with_a_repository_links_and_the_picture_lead_to_the_tag() -> None:
    shown = long_description(README, "https://example.org/team/robochoc/", "1.0.0")
    images, links = re.findall(r"!\[[^]]*\]\((\S+)\)", shown), re.findall(r"(?<!!)\[[^]]*\]\((\S+)\)", shown)
    assert images == ["https://example.org/team/robochoc/raw/v1.0.0/docs/images/nogood.png"]
    assert "https://example.org/team/robochoc/blob/v1.0.0/docs/guides/import.md" in links
    assert [link for link in links if not link.startswith("https://")] == []


def test_the_build_has_the_long_description_and_its_type() -> None:
    core = ProjectMetadata(str(ROOT), PluginManager()).core
    assert (core.readme_content_type, core.dynamic) == ("text/markdown", [])
    repository = PROJECT["project"].get("urls", {}).get("Repository", "")
    assert core.readme == long_description(README, repository, __version__)


# `make release`

PURE, COMPILED = "robochoc-1.0.0-py3-none-any.whl", "robochoc-1.0.0-cp311-cp311-linux_x86_64.whl"
TRACKED = ["tests/conftest.py", "robochoc/__init__.py", "robochoc/abt.py", "xsd/robot.xsd", *NEEDED]


def wheel_with(name: str, version: str, folder: Path, *files: str, description: str = "") -> Path:
    with zipfile.ZipFile(folder / name, "w") as packed:
        for file in files:
            packed.writestr(file, "")
        packed.writestr(f"robochoc-{version}.dist-info/METADATA", f"Version: {version}\n\n{description}")
    return folder / name


def test_a_wheel_has_all_that_is_in_git_and_nothing_else(tmp_path: Path) -> None:
    expected = package_files(TRACKED)
    assert "robochoc/xsd/robot.xsd" in expected
    assert "tests/conftest.py" not in expected
    assert [*faults_of(wheel_with(PURE, __version__, tmp_path, *expected), expected)] == []
    module = "robochoc/abt.cpython-311-x86_64-linux-gnu.so"
    assert [*faults_of(wheel_with(COMPILED, __version__, tmp_path, *expected, module), expected)] == []


@pytest.mark.parametrize(
    ("name", "version", "without", "with_", "fault"),
    [
        (PURE, __version__, "robochoc/py.typed", "", "robochoc/py.typed is missing"),
        (PURE, __version__, "", "tests/conftest.py", "tests/conftest.py should not be in it"),
        (PURE, __version__, "", "robochoc/abt.py.orig", "robochoc/abt.py.orig should not be in it"),
        (PURE, __version__, "", "robochoc/abt.so", "1 compiled modules"),
        (COMPILED, __version__, "", "", "0 compiled modules"),
        (PURE, "0.1.0", "", "", "its version is 0.1.0"),
    ],
)
def test_a_wheel_that_is_not_as_it_should_be(
    name: str, version: str, without: str, with_: str, fault: str, tmp_path: Path
) -> None:
    files = (package_files(TRACKED) | {with_}) - {without, ""}
    (found,) = faults_of(wheel_with(name, version, tmp_path, *files), package_files(TRACKED))
    assert fault in found


def test_a_relative_link_in_the_description_is_noticed(tmp_path: Path) -> None:
    files = package_files(TRACKED)
    wheel = wheel_with(
        PURE, __version__, tmp_path, *files, description="See [a](https://b.c/d) and [guide](docs/e.md)."
    )
    assert [*faults_of(wheel, files)] == [f"{PURE}: its description has a relative link, docs/e.md"]


def test_the_imports_of_an_extra_are_found_in_the_sources() -> None:
    source = "import a.b\ndef f():\n    from c import d\n    importlib.import_module('e')\nfrom . import g"
    assert [*imports_of(source)] == ["a.b", "c", "e"]
    assert modules_for({"roslibpy"}) == ({"roslibpy", "roslibpy.comm"}, {"robochoc.ros.live.rosbridge_connection"})
    assert {"app", "ros", "rosbridge"} <= {*extras()}
    assert FOR_DEVELOPERS.isdisjoint(extras())


def test_a_wheel_that_has_grown_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.support.release.MOST_BYTES", {"wheel": 500, "sdist": 1_000})
    wheel = wheel_with(PURE, __version__, tmp_path, "robochoc/__init__.py")
    assert [*too_large([wheel])] == []
    assert [*too_large([wheel_with(PURE, __version__, tmp_path, *"abcdefgh")])] != []


@pytest.mark.parametrize("module", PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]["modules"])
def test_structs_of_compiled_modules_are_the_same_in_a_module_of_their_own(
    module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / module.replace(".", "/")).with_suffix(".py").read_text()
    kept, moved = split_structs(text, f"{module}_structs")
    alone = ModuleType(f"{module}_structs")
    monkeypatch.setitem(sys.modules, alone.__name__, alone)
    exec(moved, alone.__dict__)  # noqa: S102 - our own source
    whole = importlib.import_module(module)
    structs = {name: kind for name, kind in vars(whole).items() if _is_struct(kind) and kind.__module__ == module}
    for name, kind in structs.items():
        again = getattr(alone, name)
        assert again.__struct_fields__ == kind.__struct_fields__
        for option in ("frozen", "tag", "array_like", "order", "gc", "forbid_unknown_fields"):
            assert getattr(again.__struct_config__, option) == getattr(kind.__struct_config__, option)
        assert {field.name: str(field.type).replace("_structs.", ".") for field in msgspec.structs.fields(again)} == {
            field.name: str(field.type) for field in msgspec.structs.fields(kind)
        }
    lines = {one.lineno: ast.dump(one) for one in ast.parse(text).body}
    imports = [f"from {module}_structs import"] if structs else []
    left = [one for one in ast.parse(kept).body if lines.get(one.lineno) != ast.dump(one)]
    assert [ast.unparse(one).partition(" import")[0] + " import" for one in left] == imports
    assert not any(isinstance(one, ast.ClassDef) and one.keywords for one in ast.parse(kept).body)


def _is_struct(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)
