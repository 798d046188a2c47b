"""`robochoc serve --ros rclpy`: a service of the ROS 2 that is here, with a stand-in, and with a real one."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.robots.sink import SinkError
from robochoc.ros.decide_service import DECIDE, TRIGGER, refusal
from robochoc.ros.live.rclpy_service import RclpyServices
from tests.support import rclpy_stand_in
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT
from tests.support.ros2_python import ros2_python

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
SERVICES = {"/robochoc/decide": DECIDE, "/robochoc/hangar/decide": TRIGGER}


@pytest.fixture(autouse=True)
def _rclpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    rclpy_stand_in.install(monkeypatch)
    rclpy_stand_in.install_services(monkeypatch, "std_srvs", "robochoc_msgs")


@pytest.fixture
def offered() -> Iterator[RclpyServices]:
    with RclpyServices("", SERVICES, refusal) as offered:
        yield offered


def asked(offered: RclpyServices, name: str, **fields: object) -> tuple[threading.Thread, list[object]]:
    """A client that waits for its answer."""
    answers: list[object] = []
    node = offered._ros.node  # noqa: SLF001 - the stand-in's
    client = threading.Thread(target=lambda: answers.append(node.call(name, **fields)))
    client.start()
    return client, answers


def test_each_request_is_answered(offered: RclpyServices) -> None:
    client, answers = asked(offered, "/robochoc/decide", team="hangar", timeout=2.5)
    request = offered.next(HANG_S)
    assert request is not None
    assert (request.name, request.fields) == ("/robochoc/decide", {"team": "hangar", "changes": "", "timeout": 2.5})
    offered.reply(request, {"success": True, "message": "a", "values": [1, 2]})
    client.join(HANG_S)
    (answer,) = answers
    assert (answer.success, answer.message, list(answer.values)) == (True, "a", [1, 2])  # type: ignore[attr-defined]
    assert offered.next(0) is None


def test_a_service_at_once_does_not_wait_for_its_turn() -> None:
    kinds = {**SERVICES, "/robochoc/cancel": TRIGGER}
    with RclpyServices("", kinds, refusal, {"/robochoc/cancel": lambda _: refusal("nothing")}) as offered:
        client, answers = asked(offered, "/robochoc/decide")
        request = offered.next(HANG_S)
        assert request is not None
        (other,) = offered._ros._others  # noqa: SLF001 - the stand-in's
        assert other.call("/robochoc/cancel").message == "nothing"
        assert not answers
        offered.reply(request, {"success": True, "message": "a"})
        client.join(HANG_S)


def test_feedback_is_published(offered: RclpyServices) -> None:
    heard: list[bytes] = []
    text = rclpy_stand_in.message_class("std_msgs/String")
    with RclpyServices("", {}, refusal) as listener:
        node, quality = listener._ros.node, listener._ros.service_quality()  # noqa: SLF001 - the stand-in's
        node.create_subscription(text, "/robochoc/feedback", heard.append, quality, raw=True)
        offered.announce("/robochoc/feedback", "std_msgs/String")
        offered.publish("/robochoc/feedback", "std_msgs/String", {"data": "{}"})
        wait_until(lambda: bool(heard), "feedback does not come")
    assert json.loads(heard[0]) == {"data": "{}"}


def test_who_waits_when_it_ends_is_told(offered: RclpyServices) -> None:
    client, answers = asked(offered, "/robochoc/hangar/decide")
    assert offered.next(HANG_S) is not None
    offered.close()
    client.join(HANG_S)
    assert [answer.message for answer in answers] == ["the service has ended"]  # type: ignore[attr-defined]
    with pytest.raises(SinkError, match="rclpy was shut down in this process"):
        offered.next(0)


def test_a_service_whose_type_is_not_built_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "robochoc_msgs.srv", None)
    with RclpyServices("", SERVICES, refusal) as offered:
        assert offered.lacking == ["/robochoc/decide"]


def test_without_rclpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    done = CliRunner().invoke(cli, ["serve", HANGAR, "--ros", "rclpy"], catch_exceptions=False)
    assert done.exit_code == 1
    assert "rclpy cannot be imported" in done.stderr
    assert done.stderr.count("\n") == 1


CLIENT = """
import rclpy
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node("client")
client = node.create_client(Trigger, "/robochoc/hangar/decide")
assert client.wait_for_service(timeout_sec=60)
asked = client.call_async(Trigger.Request())
rclpy.spin_until_future_complete(node, asked, timeout_sec=60)
print(asked.result().message)
node.destroy_node()
rclpy.shutdown()
"""


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_node_of_ros_asks() -> None:
    python, env = ros2_python()
    words = [python, "-m", "robochoc", "serve", HANGAR, "--ros", "rclpy", "--requests", "1"]
    with subprocess.Popen(words, env=env, stderr=subprocess.PIPE, text=True) as server, ExitStack() as stack:
        stack.callback(server.kill)
        done = subprocess.run(
            [python, "-c", CLIENT], env=env, capture_output=True, text=True, timeout=HANG_S, check=False
        )
        assert done.returncode == 0, done.stderr
        _, told = server.communicate(timeout=HANG_S)
    assert server.returncode == 0, told
    assert json.loads(done.stdout)["verdict"] == "solution"
    assert "rclpy: /robochoc/hangar/decide (std_srvs/srv/Trigger)" in told
