"""A real ROS 1, Debian's: its tools accept our bags, its nodes receive every waypoint, its reports reach us."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.debian_ros import SYSTEM_PYTHON, Core, install, lines, until
from tests.support.limits import HANG_S
from tests.support.program import PROGRAM, ROOT

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

QUEENS = (str(ROOT / "instances" / "queens3d-4"), "--withdraw", "fewest")
RESCUE = (str(ROOT / "docs" / "examples" / "rescue"), "--protocol", "dynabt")

SUBSCRIBER = """
import json, sys, rospy
from geometry_msgs.msg import PoseStamped
heard = []
def hear(message, topic):
    place = message.pose.position
    header = message.header
    upright = message.pose.orientation.w
    heard.append([topic, header.stamp.to_nsec(), header.frame_id, place.x, place.y, place.z, upright])
rospy.init_node("listener", disable_signals=True)
for topic in sys.argv[1:]:
    rospy.Subscriber(topic, PoseStamped, hear, callback_args=topic, queue_size=1000)
print("ready", flush=True)
sys.stdin.readline()
for one in heard:
    print(json.dumps(one))
"""

READER = """
import json, sys, rosbag
for topic, message, _ in rosbag.Bag(sys.argv[1]).read_messages():
    place = message.pose.position
    header = message.header
    print(json.dumps([topic, header.stamp.to_nsec(), header.frame_id, place.x, place.y, place.z,
                      message.pose.orientation.w]))
"""

REPORTER = """
import rospy
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import BatteryState
rospy.init_node("reporter")
blocked = rospy.Publisher("/drone1_1/blocked", PointStamped, queue_size=100)
battery = rospy.Publisher("/drone1_1/battery", BatteryState, queue_size=100)
while not (blocked.get_num_connections() and battery.get_num_connections()):
    rospy.sleep(0.05)
message = PointStamped()
message.header.stamp, message.header.frame_id = rospy.Time(5, 7), "map"
message.point.x, message.point.y, message.point.z = 1.0, 2.0, 3.5
blocked.publish(message)
battery.publish(BatteryState(percentage=0.25, cell_voltage=[3.5, 3.75], serial_number="A1"))
rospy.sleep(1)
"""

SOURCE = """
import json, sys
from robochoc.ros.live.rospy_node import RospySource
with RospySource("") as source:
    source.listen({
        "/drone1_1/blocked": "geometry_msgs/PointStamped",
        "/drone1_1/battery": "sensor_msgs/BatteryState",
        "/drone1_1/out_of_order": "std_msgs/String",
        "/drone1_1/cleared": "geometry_msgs/PointStamped",
    })
    print('"ready"', flush=True)
    heard = []
    while len(heard) < 3:
        one = source.next(60)
        assert one is not None
        heard.append([one.topic, one.kind, one.fields])
for one in sorted(heard, key=lambda one: one[0]):
    print(json.dumps(one))
"""


@pytest.fixture(scope="module", autouse=True)
def _ros() -> None:
    install()


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Core]:
    with Core(tmp_path_factory.mktemp("ros")) as core:
        yield core


def written(folder: Path, text: str) -> str:
    """A program with this text."""
    path = folder / "program.py"
    path.write_text(text, encoding="utf-8")
    return str(path)


def solve(*words: str, env: dict[str, str] | None = None) -> str:
    """What is said on stderr."""
    done = subprocess.run(
        [PROGRAM, "solve", *words], env=env, capture_output=True, text=True, timeout=HANG_S, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


def waypoints() -> list[str]:
    numbers = [f"{row}_{column}" for row in range(1, 5) for column in range(1, 5)]
    return [f"/drone{number}/waypoint{number}" for number in numbers]


def test_debian_accepts_our_bags(tmp_path: Path) -> None:
    bag = tmp_path / "run.bag"
    solve(*QUEENS, "--ros", f"rosbag:{bag}")
    info = subprocess.run(["rosbag", "info", str(bag)], capture_output=True, text=True, timeout=HANG_S, check=False)
    assert (info.returncode, info.stderr) == (0, "")
    assert "messages:    16\n" in info.stdout
    assert "geometry_msgs/PoseStamped [d3812c3cbc69362b77dc0b19b345f8f5]" in info.stdout
    for topic in waypoints():
        assert f"{topic}   1 msg     : geometry_msgs/PoseStamped\n" in info.stdout
    check = subprocess.run(["rosbag", "check", str(bag)], capture_output=True, text=True, timeout=HANG_S, check=False)
    assert (check.returncode, check.stderr) == (0, "")
    assert "missing" not in check.stdout


@pytest.mark.parametrize(
    ("team", "topics", "messages"),
    [(QUEENS, waypoints(), 16), (RESCUE, [f"/{name}/waypoint" for name in ("east", "lead", "spare", "west")], 15)],
)
def test_a_subscriber_receives_every_waypoint(
    core: Core, tmp_path: Path, team: tuple[str, ...], topics: list[str], messages: int
) -> None:
    """What it has received is what Debian's rosbag reads in a bag of the same run, message for message."""
    listener = core.program(written(tmp_path, SUBSCRIBER), *topics, python=SYSTEM_PYTHON)
    assert listener.stdout is not None
    assert listener.stdout.readline() == "ready\n"
    bag = tmp_path / "run.bag"
    said = solve(*team, "--ros", "rospy", "--ros", f"rosbag:{bag}", "--frame", "hall", env=core.env)
    assert not [line for line in said.splitlines() if "waypoints" not in line]
    told, errors = listener.communicate("enough\n", timeout=HANG_S)
    assert errors == ""
    read = subprocess.run(
        [SYSTEM_PYTHON, written(tmp_path, READER), str(bag)], capture_output=True, text=True, timeout=HANG_S, check=True
    )
    heard, recorded = lines(told), lines(read.stdout)
    for topic in topics:
        assert [one for one in heard if one[0] == topic] == [one for one in recorded if one[0] == topic]
    assert len(heard) == messages
    assert {frame for _, _, frame, *_ in heard} == {"hall"}
    assert not [*core.logs.rglob("*robochoc*")]


def test_one_that_stands_still_does_not_keep_us(core: Core, tmp_path: Path) -> None:
    listener = core.program(
        written(tmp_path, SUBSCRIBER.replace("PoseStamped", "String").replace("geometry_msgs", "std_msgs")),
        "/a/out_of_order",
        python=SYSTEM_PYTHON,
    )
    assert listener.stdout is not None
    listener.stdout.readline()
    publisher = core.program(str(ROOT / "tests" / "support" / "debian_ros.py"), "publish", "20000", "0")
    assert publisher.stdout is not None
    assert publisher.stdout.readline() == "began\n"
    listener.send_signal(signal.SIGSTOP)
    began = time.monotonic()
    said, errors = publisher.communicate(timeout=HANG_S)
    assert "a subscriber has not read any message for 10 s; find it by `rostopic info`" in said
    assert (publisher.returncode, errors) == (0, "")
    assert time.monotonic() - began < 40
    listener.kill()
    listener.communicate()


def test_the_master_dies(tmp_path: Path) -> None:
    with Core(tmp_path) as core:
        publisher = core.program(str(ROOT / "tests" / "support" / "debian_ros.py"), "publish", "50", "0.1")
        assert publisher.stdout is not None
        assert publisher.stdout.readline() == "began\n"
        core.end()
        said, errors = publisher.communicate(timeout=HANG_S)
    assert "no ROS master answers" in said
    assert (publisher.returncode, errors) == (0, "")


def test_reports_reach_us(core: Core, tmp_path: Path) -> None:
    source = core.program(written(tmp_path, SOURCE))
    assert source.stdout is not None
    assert source.stdout.readline() == '"ready"\n'
    (tmp_path / "reporter.py").write_text(REPORTER, encoding="utf-8")
    reporter = core.program(str(tmp_path / "reporter.py"), python=SYSTEM_PYTHON)
    assert reporter.communicate(timeout=HANG_S) == ("", "")
    said = core.rostopic("pub", "-1", "/drone1_1/out_of_order", "std_msgs/String", "data: 'motor 2'")
    assert said.returncode == 0
    heard, errors = source.communicate(timeout=HANG_S)
    assert errors == ""
    battery, blocked, broken = lines(heard)
    assert battery[1] == "sensor_msgs/BatteryState"
    assert (battery[2]["percentage"], battery[2]["cell_voltage"]) == (0.25, [3.5, 3.75])
    place = {"x": 1.0, "y": 2.0, "z": 3.5}
    header = {"stamp": 5_000_000_007, "frame_id": "map"}
    assert blocked == ["/drone1_1/blocked", "geometry_msgs/PointStamped", {"header": header, "point": place}]
    assert broken == ["/drone1_1/out_of_order", "std_msgs/String", {"data": "motor 2"}]


def test_a_report_over_ros_changes_the_problem(core: Core) -> None:
    """A drone says so on a topic of a real ROS, and the others decide without it."""
    words = ["solve", str(ROOT / "docs" / "examples" / "hangar"), "--protocol", "dynabt", "--json"]
    program = core.program("-m", "robochoc", *words, "--situation", "rospy", "--report-timeout", "10")
    assert until(lambda: "/nose/out_of_order" in core.rostopic("list", "-s").stdout, 60)
    said = core.rostopic("pub", "-1", "/nose/out_of_order", "std_msgs/String", "data: 'motor 2'")
    assert said.returncode == 0
    result, errors = program.communicate(timeout=HANG_S)
    assert (program.returncode, errors) == (0, "")
    first, second = json.loads(result)["epochs"]
    assert "nose" in first["assignment"]
    assert "nose" not in second["assignment"]
    assert len(second["assignment"]) == len(first["assignment"]) - 1
