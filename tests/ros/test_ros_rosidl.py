"""ROS 2's own tools read our definitions as we do: Debian's rosidl their fields, and a ROS 2 has the same hashes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from robochoc.robots.source import REPORTS
from robochoc.ros.message_types import FieldType, types_of
from robochoc.ros.names import TEAM_TOPICS
from robochoc.ros.source_feedback import CLOCK_KIND
from robochoc.ros.type_hashes import type_hash
from robochoc.ros.waypoint_types import kinds
from tests.support.limits import HANG_S
from tests.support.program import ROOT
from tests.support.ros2_python import ros2_python

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

KINDS = sorted({*kinds(), *REPORTS.values(), *TEAM_TOPICS.values(), CLOCK_KIND})
SERVICE = ROOT / "docs" / "ros2" / "robochoc_msgs" / "srv" / "Decide.srv"

READER = """
import json, sys
from rosidl_adapter.parser import parse_message_string, parse_service_string
told = lambda one: [[field.name, str(field.type)] for field in one.fields]
given = json.load(sys.stdin)
found = {kind: told(parse_message_string(*kind.split("/"), text)) for kind, text in given["messages"].items()}
service = parse_service_string("robochoc_msgs", "Decide", given["service"])
print(json.dumps({**found, "Decide_Request": told(service.request), "Decide_Response": told(service.response)}))
"""

HASHES = """
import json, os, sys
from pathlib import Path
found = {}
for place in filter(None, [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]):
    for path in Path(place, "share").glob("*/msg/*.json"):
        name = f"{path.parts[-3]}/msg/{path.stem}"
        for one in json.loads(path.read_text()).get("type_hashes", ()):
            if one["type_name"] == name:
                found[f"{path.parts[-3]}/{path.stem}"] = one["hash_string"]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def rosidl(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The folder with Debian's rosidl: unpacked, and not installed."""
    installed = Path("/usr/lib/python3/dist-packages")
    if (installed / "rosidl_adapter").is_dir():
        return str(installed)
    folder = tmp_path_factory.mktemp("rosidl")
    if not (shutil.which("apt-get") and shutil.which("dpkg")):
        pytest.skip("no apt-get here: rosidl is in Debian's package python3-rosidl")
    got = subprocess.run(
        ["apt-get", "download", "python3-rosidl"], cwd=folder, capture_output=True, text=True, check=False
    )
    packages = [*folder.glob("*.deb")]
    if got.returncode or not packages:
        pytest.skip(f"apt-get download python3-rosidl failed: {(got.stderr.strip().splitlines() or ['?'])[-1]}")
    subprocess.run(["dpkg", "-x", str(packages[0]), str(folder)], check=True, timeout=HANG_S)
    return str(folder / "usr" / "lib" / "python3" / "dist-packages")


def spelled(field: FieldType) -> str:
    """The type of a field as a `.msg` file has it."""
    one = f"{field.name}<={field.limit}" if field.limit else field.name
    most = f"<={field.size}" if field.size else ""
    return one + {"one": "", "array": f"[{field.size}]", "sequence": f"[{most}]"}[field.shape]


def layout(kind: str) -> list[list[str]]:
    return [[name, spelled(field)] for name, field in types_of(2).layout(kind)]


def test_debians_rosidl_reads_the_same_fields(rosidl: str) -> None:
    texts = {kind: types_of(2).definition(kind).text.split("=" * 80)[0] for kind in KINDS}
    given = json.dumps({"messages": texts, "service": SERVICE.read_text(encoding="utf-8")})
    env = {**os.environ, "PYTHONPATH": rosidl}
    read = subprocess.run(
        [sys.executable, "-c", READER],
        input=given,
        env=env,
        capture_output=True,
        text=True,
        timeout=HANG_S,
        check=False,
    )
    assert read.returncode == 0, read.stderr
    found = json.loads(read.stdout)
    for half in ("Decide_Request", "Decide_Response"):
        assert found.pop(half) == layout(f"robochoc_msgs/{half}")
    assert found == {kind: layout(kind) for kind in KINDS}


def test_a_ros_2_has_the_same_hashes() -> None:
    python, env = ros2_python()
    told = subprocess.run(
        [python, "-c", HASHES], env=env, capture_output=True, text=True, timeout=HANG_S, check=True
    ).stdout
    theirs = json.loads(told)
    if not theirs:
        pytest.skip("this ROS 2 has no hashes of types: it is older than Iron")
    both = [kind for kind in KINDS if kind in theirs]
    assert {"geometry_msgs/PoseStamped", "std_msgs/String", "rosgraph_msgs/Clock"} <= {*both}
    assert {kind: type_hash(kind) for kind in both} == {kind: theirs[kind] for kind in both}
