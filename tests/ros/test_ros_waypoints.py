"""What drones publish: waypoints in the type that their topic has, poses, and reports."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from robochoc.flight.mission import Drone, Goal, Leg
from robochoc.flight.reports import BatteryReport, BlockedReport, ClearedReport, OutOfOrderReport, PoseReport, Report
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Topic
from robochoc.robots.sink import Fields, Waypoint
from robochoc.robots.source import REPORTS
from robochoc.ros import waypoint_types
from robochoc.ros.message_types import UnknownTypeError, types_of
from robochoc.ros.publisher import NothingToPublishError, Publisher
from robochoc.ros.team_topics import PublishOptions
from robochoc.ros.waypoint_types import NoMappingError, WaypointMapping, kinds, mapping_for, short_kind
from tests.support.cases import looped
from tests.support.installed_packages import install_entry_points
from tests.support.ros_ends import KeptSink

POSE = "geometry_msgs/PoseStamped"
NOW = 1_700_000_000_250_000_000
HEADER = {"stamp": NOW, "frame_id": "map"}
DRONES = (
    Drone("drone1.1", "Robot1.1", Topic("/drone1.1/waypoint1.1"), (0.0, 0.0, 0.0), 0),
    Drone("drone1.2", "Robot1.2", Topic("/drone1.2/waypoint1.2", "geometry_msgs/Point"), (0.0, 1.0, 0.0), 0),
    Drone("drone1.3", "Robot1.3", None, (0.0, 2.0, 0.0), 0),
    Drone("drone1.4", "Robot1.4", Topic("/drone1.4/waypoint1.4"), (0.0, 3.0, 0.0), 0),
)
LEG = Leg(
    "begin",
    Verdict.SOLUTION,
    {1: Goal((1.0, 2.0, 3.0)), 0: Goal((-2.0, 0.0, 0.0), lands=True), 2: Goal((4.0, 4.0, 4.0))},
)
PLAIN = {
    "geometry_msgs/Pose2D": "'x': 1.5, 'y': -2.5, 'theta': 0.0",
    "std_msgs/Float32": "3.5",
    "std_msgs/Float64": "3.5",
    "std_msgs/Float64MultiArray": "[1.5, -2.5, 3.5]",
    "std_msgs/String": '"x": 1.5, "y": -2.5, "z": 3.5',
}
"""What a waypoint is in types that have no place with three coordinates."""
WITH_HEADER = {
    "geometry_msgs/PoseArray",
    "nav_msgs/Odometry",
    "nav_msgs/Path",
    "std_msgs/String",
    "tf2_msgs/TFMessage",
    "trajectory_msgs/MultiDOFJointTrajectory",
}
LANDS = Leg("begin", Verdict.SOLUTION, {0: Goal((-2.0, 0.0, 0.0), lands=True)})


def installed(monkeypatch: pytest.MonkeyPatch, **places: str) -> None:
    """As if a package offered these mappings: types are written with a double underscore here."""
    install_entry_points(
        monkeypatch, waypoint_types.GROUP, **{name.replace("__", "/"): place for name, place in places.items()}
    )
    mapping_for.cache_clear()
    monkeypatch.setattr(waypoint_types, "mapping_for", mapping_for.__wrapped__)


def target(waypoint: Waypoint) -> Fields:
    return {"height": waypoint.at[2], "down": waypoint.lands, "due": waypoint.stamp}


DEFINITION = f"""float64 height
bool down
time due
my_msgs/Deep deep
{"=" * 80}
MSG: my_msgs/Deep
int8[2] pair
"""
TARGET = WaypointMapping(target, DEFINITION)
LOOSE = WaypointMapping(target, "float64 height\nother_msgs/Unknown what\n")
WRONG = WaypointMapping(target, "(this is no definition)")
NUMBER = 3


def failing(waypoint: Waypoint) -> Fields:
    raise ValueError(f"no {waypoint.at}")


def test_who_flies_and_who_lands_publishes_and_nobody_else() -> None:
    heap = KeptSink()
    Publisher("team", DRONES, [heap]).decide(LEG, NOW)
    landing = {"position": {"x": -2.0, "y": 0.0, "z": 0.0}, "orientation": {"w": 1.0}}
    assert heap.said == [
        ("/drone1_1/waypoint1_1", POSE, {"header": HEADER, "pose": landing}, NOW),
        ("/drone1_2/waypoint1_2", "geometry_msgs/Point", {"x": 1.0, "y": 2.0, "z": 3.0}, NOW),
    ]


def test_all_is_advertised_once_to_every_sink() -> None:
    heaps = [KeptSink(), KeptSink()]
    publisher = Publisher("team", DRONES, heaps)
    publisher.decide(LEG, NOW)
    for heap in heaps:
        (topics,) = heap.advertised
        assert topics["/drone1_1/waypoint1_1"] == POSE
        assert topics["/drone1_2/waypoint1_2"] == "geometry_msgs/Point"
        assert {topic: kind for topic, kind in topics.items() if topic.startswith("/drone1_3/")} == {
            f"/drone1_3/{token}": kind for token, kind in REPORTS.items()
        }
        assert len(topics) == 3 + len(REPORTS) * len(DRONES)
        assert heap.original["/drone1_4/waypoint1_4"] == "/drone1.4/waypoint1.4"
        assert len(heap.said) == 2


def test_poses_of_all_drones() -> None:
    heap = KeptSink()
    publisher = Publisher("team", DRONES, [heap], frame="arena")
    turned = np.tile([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)], (4, 1))
    publisher.poses(np.arange(12.0).reshape(4, 3), turned, NOW)
    assert [topic for topic, *_ in heap.said] == [f"/drone1_{number}/pose" for number in (1, 2, 3, 4)]
    _, kind, fields, at_ns = heap.said[2]
    assert (kind, at_ns, fields["header"]["frame_id"]) == (POSE, NOW, "arena")
    assert fields["pose"]["position"] == {"x": 6.0, "y": 7.0, "z": 8.0}
    assert fields["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": math.sqrt(0.5), "w": math.sqrt(0.5)}


@looped(
    ("report", "topic", "part", "value"),
    [
        (BatteryReport("drone1.2", 0.25), "battery", "percentage", 0.25),
        (BlockedReport("drone1.2", (1.0, 2.0, 3.0)), "blocked", "point", {"x": 1.0, "y": 2.0, "z": 3.0}),
        (ClearedReport("drone1.2", (1.0, 2.0, 3.0)), "cleared", "point", {"x": 1.0, "y": 2.0, "z": 3.0}),
        (OutOfOrderReport("drone1.2", "a motor stopped"), "out_of_order", "data", "a motor stopped"),
        (
            PoseReport("drone1.2", (1.0, 2.0, 3.0)),
            "pose",
            "pose",
            {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"w": 1.0}},
        ),
    ],
)
def test_reports(report: Report, topic: str, part: str, value: object) -> None:
    heap = KeptSink()
    Publisher("team", DRONES, [heap]).report(report, NOW)
    ((where, kind, fields, at_ns),) = heap.said
    assert (where, kind, at_ns) == (f"/drone1_2/{topic}", REPORTS[topic], NOW)
    assert fields[part] == value
    for version in (1, 2):
        types = types_of(version)
        assert types.decode(kind, types.encode(kind, fields))[part]


def test_what_a_battery_does_not_measure_is_not_zero() -> None:
    heap = KeptSink()
    Publisher("team", DRONES, [heap]).report(BatteryReport("drone1.1", 1.0), NOW)
    assert math.isnan(heap.said[0][2]["voltage"])


def test_a_team_without_topics_has_nothing_to_publish() -> None:
    with pytest.raises(NothingToPublishError, match="no drone of queens has a topic"):
        Publisher("queens", DRONES[2:3], [KeptSink()])


@looped("kind", ["sensor_msgs/Image", "PoseStamped", "", "a/b/c", "geometry_msgs/srv/Pose"])
def test_a_type_that_nobody_maps_is_refused(kind: str) -> None:
    drone = replace(DRONES[0], topic=Topic("/drone1.1/waypoint1.1", kind))
    with pytest.raises(NoMappingError) as refused:
        Publisher("team", [drone], [KeptSink()])
    told = str(refused.value)
    assert all(part in told for part in ("/drone1.1/waypoint1.1", "Robot1.1", repr(kind), POSE, "robochoc.waypoints"))


@looped("kind", kinds())
@looped("version", [1, 2])
def test_every_built_in_type_is_a_type_of_ros_and_holds_the_place(kind: str, version: int) -> None:
    mapping = mapping_for(kind.replace("/", "/msg/"))
    assert mapping is not None
    fields = mapping.fields(Waypoint(0, "/a/b", kind, (1.5, -2.5, 3.5), False, "map", NOW))
    types = types_of(1 if version == 1 else 2)
    told = str(types.decode(kind, types.encode(kind, fields)))
    assert PLAIN.get(kind, "'x': 1.5, 'y': -2.5, 'z': 3.5") in told
    assert (kind in WITH_HEADER or "Stamped" in kind) == (str(NOW) in told)
    assert ("Po" not in kind or "Point" in kind or kind in PLAIN) or "'w': 1.0" in told


def test_a_path_leads_from_the_goal_before() -> None:
    drone = replace(DRONES[0], topic=Topic("/drone1.1/waypoint1.1", "nav_msgs/Path"))
    heap = KeptSink()
    publisher = Publisher("team", [drone], [heap])
    for place in ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)):
        publisher.decide(Leg("begin", Verdict.SOLUTION, {0: Goal(place)}), NOW)
    paths = [[stop["pose"]["position"]["x"] for stop in fields["poses"]] for _, _, fields, _ in heap.said]
    assert paths == [[1.0], [1.0, 4.0]]
    assert heap.said[1][2]["poses"][0]["header"] == HEADER


def test_a_text_is_json() -> None:
    mapping = mapping_for("std_msgs/String")
    assert mapping is not None
    told = mapping.fields(Waypoint(0, "/a/b", "std_msgs/String", (1.5, -2.5, 3.5), True, "map", NOW))["data"]
    assert json.loads(told) == {"frame": "map", "stamp": NOW, "x": 1.5, "y": -2.5, "z": 3.5, "lands": True}


# What else is published


def test_one_type_for_all_waypoints() -> None:
    heap = KeptSink()
    Publisher("team", DRONES, [heap], options=PublishOptions(kind="geometry_msgs/msg/Vector3")).decide(LEG, NOW)
    assert [kind for _, kind, _, _ in heap.said] == ["geometry_msgs/msg/Vector3"] * 2
    with pytest.raises(NoMappingError, match="'sensor_msgs/Image'"):
        Publisher("team", DRONES, [heap], options=PublishOptions(kind="sensor_msgs/Image"))
    with pytest.raises(NoMappingError, match=r"; did you mean 'nav_msgs/Path'\?"):
        Publisher("team", DRONES, [heap], options=PublishOptions(kind="nav_msgs/Pat"))


def test_goals_and_drones_are_frames() -> None:
    """Every message on a latched topic has all goals that stand, as later ones hear the last message alone."""
    heap = KeptSink()
    publisher = Publisher("team", DRONES, [heap], options=PublishOptions(frames=True))
    publisher.decide(LEG, NOW)
    publisher.decide(LANDS, NOW + 1)
    publisher.poses(np.zeros((4, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (4, 1)), NOW + 2)
    said = [fields for topic, kind, fields, _ in heap.said if (topic, kind) == ("/tf_static", "tf2_msgs/TFMessage")]
    assert [[one["child_frame_id"] for one in each["transforms"]] for each in said] == [
        ["drone1_1/goal", "drone1_2/goal", "drone1_3/goal"]
    ] * 2
    assert said[1]["transforms"][1] == {
        "header": {"stamp": NOW + 1, "frame_id": "map"},
        "child_frame_id": "drone1_2/goal",
        "transform": {"translation": {"x": 1.0, "y": 2.0, "z": 3.0}, "rotation": {"w": 1.0}},
    }
    (topic, kind, bodies, at_ns) = heap.said[-1]
    assert (topic, kind, at_ns) == ("/tf", "tf2_msgs/TFMessage", NOW + 2)
    assert [one["child_frame_id"] for one in bodies["transforms"]][3] == "drone1_4/base_link"
    assert heap.advertised[0].keys() >= {"/tf", "/tf_static"}
    for version in (1, 2):
        types = types_of(version)
        back = types.decode("tf2_msgs/TFMessage", types.encode("tf2_msgs/TFMessage", bodies))
        assert back["transforms"][0]["child_frame_id"] == "drone1_1/base_link"


@looped(
    ("verdict", "level"),
    [(Verdict.SOLUTION, 0), (Verdict.OPTIMAL, 0), (Verdict.UNKNOWN, 1), (Verdict.NO_SOLUTION, 2)],
)
def test_how_the_run_stands(verdict: Verdict, level: int) -> None:
    heap = KeptSink()
    publisher = Publisher("team", DRONES, [heap], options=PublishOptions(diagnostics=True))
    publisher.decide(LANDS, NOW)
    publisher.decide(Leg("-Nose\n", verdict, {1: Goal((0.0, 0.0, 0.0))}, cost=7), NOW)
    topic, kind, fields, _ = heap.said[-1]
    assert (topic, kind, fields["header"]["stamp"]) == ("/diagnostics", "diagnostic_msgs/DiagnosticArray", NOW)
    (told,) = fields["status"]
    assert (told["level"], told["name"], told["message"]) == (level, "robochoc: team", f"{verdict.value}, epoch 2")
    values = {one["key"]: one["value"] for one in told["values"]}
    assert values == {
        "verdict": verdict.value,
        "epoch": "2",
        "opened by": r"-Nose\n",
        "cost": "7",
        "waypoints": "1",
        "landings": "0",
    }
    for version in (1, 2):
        assert types_of(version).encode(kind, fields)


def test_nothing_else_is_published_that_was_not_asked_for() -> None:
    heap = KeptSink()
    publisher = Publisher("team", DRONES, [heap])
    publisher.decide(LEG, NOW)
    publisher.poses(np.zeros((4, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (4, 1)), NOW)
    assert not {"/tf", "/tf_static", "/diagnostics"} & {*heap.advertised[0], *(topic for topic, *_ in heap.said)}


def test_both_spellings_are_one_type() -> None:
    assert short_kind("geometry_msgs/msg/PoseStamped") == short_kind(" geometry_msgs/PoseStamped") == POSE
    assert short_kind("geometry_msgs/action/PoseStamped") == "geometry_msgs/action/PoseStamped"


def test_a_package_brings_a_type_and_its_definition(monkeypatch: pytest.MonkeyPatch) -> None:
    installed(monkeypatch, my_msgs__Target="tests.ros.test_ros_waypoints:TARGET")
    heap = KeptSink()
    drone = replace(DRONES[0], topic=Topic("/drone1.1/waypoint1.1", "my_msgs/msg/Target"))
    Publisher("team", [drone], [heap]).decide(LANDS, NOW)
    ((_, kind, fields, _),) = heap.said
    assert fields == {"height": 0.0, "down": True, "due": NOW}
    for version in (1, 2):
        types = types_of(version)
        assert types.decode(kind, types.encode(kind, fields)) == {**fields, "deep": {"pair": [0, 0]}}
        assert "MSG: my_msgs/Deep\nint8[2] pair" in types.definition(kind).text


@looped("place", [f"{__name__}:NUMBER", f"{__name__}:missing", "no_such_module:x"])
def test_a_broken_package_is_told(monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    installed(monkeypatch, my_msgs__Target=place)
    drone = replace(DRONES[0], topic=Topic("/drone1.1/waypoint1.1", "my_msgs/Target"))
    with pytest.raises(NoMappingError, match=place):
        Publisher("team", [drone], [KeptSink()])


def test_a_mapping_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    installed(monkeypatch, my_msgs__Failing="tests.ros.test_ros_waypoints:failing")
    drone = replace(DRONES[0], topic=Topic("/drone1.1/waypoint1.1", "my_msgs/Failing"))
    publisher = Publisher("team", [drone], [KeptSink()])
    with pytest.raises(NoMappingError, match=r"my_msgs/Failing failed: ValueError: no \("):
        publisher.decide(LANDS, NOW)


@pytest.mark.parametrize(
    ("name", "told"), [("LOOSE", "requires undefined types"), ("WRONG", "in its package is invalid")]
)
def test_a_definition_that_cannot_be_used_is_told(monkeypatch: pytest.MonkeyPatch, name: str, told: str) -> None:
    installed(monkeypatch, **{f"my_msgs__{name.title()}": f"tests.ros.test_ros_waypoints:{name}"})
    with pytest.raises(UnknownTypeError, match=told):
        types_of(2).encode(f"my_msgs/{name.title()}", {})
