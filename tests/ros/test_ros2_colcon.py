"""The packages of docs/ros2, built by a real colcon, and the service called by a real client with what was built."""

from __future__ import annotations

import os
import shutil
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest

from robochoc.ros.decide_service import DECIDE
from robochoc.ros.type_hashes import service_hash
from tests.support.limits import HANG_S
from tests.support.program import ROOT
from tests.support.ros2_python import ros2_python

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
BUILD_S = 900
CLIENT = """
import rclpy
from robochoc_msgs.srv import Decide
rclpy.init()
node = rclpy.create_node("client")
client = node.create_client(Decide, "/robochoc/decide")
assert client.wait_for_service(timeout_sec=60)
asked = client.call_async(Decide.Request(team="hangar", changes='[{"remove_agent": {"name": "Nose"}}]'))
rclpy.spin_until_future_complete(node, asked, timeout_sec=60)
print(asked.result().verdict, *asked.result().variables)
node.destroy_node()
rclpy.shutdown()
"""


def _built(folder: Path, python: str, env: dict[str, str]) -> dict[str, str]:
    """Build the packages; return the environment in which they are found. Skip the test where that cannot be."""
    colcon = shutil.which("colcon", path=os.pathsep.join((str(Path(python).parent), env.get("PATH", ""))))
    if colcon is None:
        pytest.skip("no colcon here: pip install colcon-common-extensions, beside a ROS 2")
    prefix = subprocess.run([python, "-c", "import sys; print(sys.prefix)"], capture_output=True, text=True, check=True)
    prefixes = env.get("AMENT_PREFIX_PATH") or prefix.stdout.strip()
    if not any(Path(one, "share", "ament_cmake").is_dir() for one in prefixes.split(os.pathsep)):
        pytest.skip("no ament_cmake here: docs/guides/testing.md says what to install")
    shutil.copytree(ROOT / "docs" / "ros2", folder / "src")
    path = os.pathsep.join((str(Path(python).parent), env.get("PATH", "")))
    env = {**env, "PATH": path, "AMENT_PREFIX_PATH": prefixes, "CMAKE_PREFIX_PATH": prefixes}
    words = [colcon, "build", "--executor", "sequential"]
    done = subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True, timeout=BUILD_S, check=False)
    assert done.returncode == 0, done.stderr
    script = f". {folder}/install/local_setup.sh && env -0"
    sourced = subprocess.run(["sh", "-c", script], env=env, capture_output=True, text=True, check=True)
    return dict(line.split("=", 1) for line in sourced.stdout.split("\0") if "=" in line)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_packages_are_built_and_the_service_is_called(tmp_path: Path) -> None:
    python, env = ros2_python()
    env = _built(tmp_path, python, env)
    share = tmp_path / "install" / "robochoc_ros" / "share" / "robochoc_ros"
    assert sorted(path.name for path in (share / "launch").iterdir()) == ["serve.launch.py", "team.launch.py"]
    made = tmp_path / "install" / "robochoc_msgs" / "share" / "robochoc_msgs" / "srv" / "Decide.json"
    assert service_hash(DECIDE) in made.read_text(encoding="utf-8"), "rosidl has another hash of the service"
    words = [python, "-m", "robochoc", "serve", HANGAR, "--ros", "rclpy", "--requests", "1"]
    with subprocess.Popen(words, env=env, stderr=subprocess.PIPE, text=True) as server, ExitStack() as stack:
        stack.callback(server.kill)
        done = subprocess.run(
            [python, "-c", CLIENT], env=env, capture_output=True, text=True, timeout=HANG_S, check=False
        )
        assert done.returncode == 0, done.stderr
        _, told = server.communicate(timeout=HANG_S)
    assert done.stdout == "solution fin port roof starboard tail\n"
    assert "rclpy: /robochoc/decide (robochoc_msgs/srv/Decide)" in told
