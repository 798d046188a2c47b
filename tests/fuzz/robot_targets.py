"""Data from robots, fleets and ROS: fleet files, maps, bags of ROS 2, messages over DDS and rosbridge, and reports."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from functools import cache, partial
from random import Random

import msgspec

from robochoc.formats import InvalidInputError
from robochoc.maps.ground_map import GroundMap, Volume, ground_map_json, read_ground_map
from robochoc.maps.map_file import read_map
from robochoc.model.change import apply_changes
from robochoc.model.team_edits import ChangeError
from robochoc.robots.closed_loop import drones_of
from robochoc.robots.inbox import weight_of
from robochoc.robots.situation import Situation
from robochoc.robots.source import REPORTS, ReceivedMessage, SourceError
from robochoc.ros.decide_service import DECIDE, DecideService
from robochoc.ros.interfaces import EMPTY, part_definition, part_kinds
from robochoc.ros.live.dds_service import split_request
from robochoc.ros.live.rmw_zenoh_keys import attachment, sender
from robochoc.ros.live.rosbridge_connection import MalformedMessageError, incoming, outgoing
from robochoc.ros.message_types import FieldsError, UnknownTypeError, Version, types_of
from robochoc.ros.report_decoder import ReportDecoder
from robochoc.run import Options, Runtime, solve
from robochoc.vehicles.fleet import FleetError, read_fleet
from robochoc.vehicles.kinds import VehicleKind
from tests.fuzz.file_targets import folder
from tests.fuzz.harness import Target, assert_clear, assert_said
from tests.fuzz.mutations import files_of, folder_of, in_folder, one_of, spoilt_bytes, spoilt_json, spoilt_text
from tests.support.example_teams import example
from tests.support.maps import ROOMS, drawn_rows, write_map
from tests.support.octomaps import drawn_voxels, write_octomap
from tests.support.ros_recordings import NOW, TOPICS, messages, read

# Fleet files

FLEETS = {
    VehicleKind.MAVLINK: """vehicles:
  A: udpin://0.0.0.0:14540
  B: {link: "serial:///dev/ttyUSB0:57600", at: [2, 0, -0.5]}
fence: [[0, 0, 0], [6.5, 6, 6]]
takeoff: 2
end: hold
patience: 10
""",
    VehicleKind.CRAZYFLIE: """vehicles: {A: radio://0/80/2M/E7E7E7E701, B: "udp://127.0.0.1:19850"}
fence: [[0, 0, 0], [3, 3, 2]]
speed: 0.5
distance: 0.4
downwash: 2
""",
}
ON_EARTH = "vehicles: {A: udpin://0.0.0.0:14540}\nfence: [[0, 0, 0], [9, 9, 9]]\norigin: [47.4, 8.5, 488]\n"


def fleets(kind: VehicleKind) -> Sequence[bytes]:
    """Fleet files of a kind."""
    more = [ON_EARTH] if kind == VehicleKind.MAVLINK else []
    return [text.encode() for text in (FLEETS[kind], *more)]


def check_fleet(kind: VehicleKind, content: bytes) -> bool:
    """A fleet file is read, and can be sent to the guard; or it is refused."""
    with folder() as place:
        file = place / "fleet.yaml"
        file.write_bytes(content)
        try:
            fleet = read_fleet(file, kind)
        except FleetError as wrong:
            assert_clear(str(wrong))
            return False
    assert msgspec.json.decode(msgspec.json.encode(fleet), type=type(fleet)) == fleet
    return True


# Maps


@cache
def grids() -> Sequence[bytes]:
    """Occupancy grids: a YAML file and its image."""
    chance = Random(4)
    found = []
    for rows in (ROOMS, drawn_rows(chance, 5, 4)):
        with folder() as place:
            write_map(place, rows, origin="[1, -2, 0.5]")
            found.append(folder_of({path.name: path.read_bytes() for path in sorted(place.iterdir())}))
    return found


def check_grid(content: bytes) -> bool:
    """A map is read or refused."""
    with folder() as place:
        (place / "plan.pgm").write_bytes(b"")
        for name, text in files_of(content).items():
            if name in {"plan.yaml", "plan.pgm"}:
                (place / name).write_bytes(text)
        try:
            found = read_map(place / "plan.yaml")
        except InvalidInputError as invalid:
            assert_clear(str(invalid))
            return False
        return bool(found.free.shape)


@cache
def octomaps(ending: str) -> Sequence[bytes]:
    """OctoMaps, in the binary or the full form."""
    chance = Random(5)
    with folder() as place:
        return [
            write_octomap(place / f"m{ending}", drawn_voxels(chance, sides, first)).read_bytes()
            for sides, first in (((2, 3, 2), (0, 0, 0)), ((5, 4, 3), (-2, -1, 7)))
        ]


def check_octomap(ending: str, content: bytes) -> bool:
    """A map is read or refused."""
    with folder() as place:
        file = place / f"m{ending}"
        file.write_bytes(content)
        try:
            return bool(read_map(file).free.shape)
        except InvalidInputError as invalid:
            assert_clear(str(invalid))
            return False


def ground_maps() -> Sequence[bytes]:
    """The maps below missions."""
    volume = Volume(3, 2, {"A": 2}, ((1, 1, 3), (2, 1, 1)), (3, 63), None, {"A": 1.5})
    whole = GroundMap(4, 3, {"A": (1, 2)}, (), (5, -5), 0.5, volume, None, {"A": (0.5, 1.5)})
    return [ground_map_json(one) for one in (GroundMap(2, 2), whole)]


def check_ground_map(content: bytes) -> bool:
    """A map is read or refused; what is read is written, and read as the same."""
    try:
        found = read_ground_map(content)
    except ValueError as wrong:
        assert_said(wrong)
        return False
    assert read_ground_map(ground_map_json(found)) == found, "another map is read from what was written"
    return True


# Bags of ROS 2 in SQLite


@cache
def bags() -> Sequence[bytes]:
    """Bags with some messages, as other recorders write them: without and with definitions of types."""
    return [_bag(number, defined=number % 2 == 0) for number in (1, 4, 20)]


def _bag(number: int, *, defined: bool) -> bytes:
    with folder() as place:
        file = place / "run.db3"
        with closing(sqlite3.connect(file)) as rows:
            rows.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
            rows.execute(
                "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
            )
            if defined:
                rows.execute(
                    "CREATE TABLE message_definitions(topic_type TEXT, encoding TEXT, encoded_message_definition TEXT)"
                )
            for place_of_topic, (topic, kind) in enumerate(TOPICS.items()):
                long = kind.replace("/", "/msg/")
                rows.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr')", (place_of_topic, topic, long))
                if defined:
                    definition = types_of(2).definition(kind).text
                    rows.execute("INSERT INTO message_definitions VALUES (?, 'ros2msg', ?)", (long, definition))
            for topic, fields, at_ns in messages(number):
                content = types_of(2).encode(TOPICS[topic], fields)
                rows.execute("INSERT INTO messages VALUES (NULL, ?, ?, ?)", ([*TOPICS].index(topic), at_ns, content))
            rows.commit()
        return file.read_bytes()


def check_bag(content: bytes) -> bool:
    """A bag is read or refused; reading writes nothing."""
    with folder() as place:
        file = place / "run.db3"
        file.write_bytes(content)
        try:
            received = read(f"rosbag2:{file}")
        except SourceError as failed:
            assert_clear(str(failed))
            return False
        assert [path.name for path in place.iterdir()] == ["run.db3"], "reading has written files"
    return all(weight_of(one.fields) for one in received)


# Messages of ROS


def has_fields_in_both(kind: str) -> bool:
    """Whether ROS 1 and ROS 2 know a message, and it has fields."""
    try:
        return part_definition(kind) != EMPTY and bool(types_of(1).layout(kind))
    except UnknownTypeError:
        return False


KINDS: tuple[str, ...] = (
    *sorted({*TOPICS.values(), *REPORTS.values()}),
    *filter(has_fields_in_both, part_kinds()),
    "nav_msgs/Odometry",
    "sensor_msgs/PointCloud2",
    "diagnostic_msgs/DiagnosticArray",
)


def samples(version: Version) -> Sequence[bytes]:
    """Messages of all types, each after the number of its type."""
    types = types_of(version)
    found = [
        bytes([KINDS.index(TOPICS[topic])]) + types.encode(TOPICS[topic], fields) for topic, fields, _ in messages(9)
    ]
    return [*found, *(bytes([number]) + types.encode(kind, {}) for number, kind in enumerate(KINDS))]


def check_sample(version: Version, content: bytes) -> bool:
    """The bytes of a message are read or refused; what is read is written, and read as the same."""
    types, kind = types_of(version), KINDS[content[0] % len(KINDS) if content else 0]
    try:
        fields = types.decode(kind, content[1:])
    except FieldsError as wrong:
        assert_said(wrong)
        return False
    weight_of(fields)
    try:
        again = types.encode(kind, fields)
    except FieldsError as wrong:  # text with NUL, or a time with too many nanoseconds
        assert_said(wrong)
        return True
    assert repr(types.decode(kind, again)) == repr(fields), "another message is read from what was written"
    return True


# Requests to the service `decide`


def requests() -> Sequence[bytes]:
    """Requests over DDS, with their headers."""
    robot = example("hangar").robots[0]
    variable = robot.variables[0]
    value = {"variable": variable.name, "value": next(iter(variable.domain))}
    asked: list[Mapping[str, object]] = [
        {},
        {"team": "hangar", "timeout": 0.5},
        {"team": "hangar", "changes": json.dumps([{"remove_agent": {"name": robot.name}}])},
        {"team": "hangar", "changes": json.dumps([{"remove_value": value}, {"add_value": value}])},
    ]
    header = bytes(range(8)) + (7).to_bytes(8, "little")
    plain = [types_of(2).encode(f"{DECIDE}_Request", fields) for fields in asked]
    return [one[:4] + header + one[4:] for one in plain]


@cache
def _service() -> DecideService:
    return DecideService([example("hangar")], solve, Options(runtime=Runtime.SIMULATOR, timeout=1.0))


def check_request(content: bytes) -> bool:
    """A request is answered with fields that can be sent, or it is refused."""
    found = split_request(content)
    if found is None:
        return False
    assert len(found[0]) == 16
    try:
        fields = types_of(2).decode(f"{DECIDE}_Request", found[1])
    except FieldsError:
        return False
    answer = _service().decide(fields)
    types_of(2).encode(f"{DECIDE}_Response", answer)
    assert_clear(answer["message"])
    return bool(answer["success"])


def check_attachment(content: bytes) -> bool:
    """The attachment of a request over zenoh is read or refused; what is read can be sent back."""
    found = sender(content)
    if found is None:
        return False
    assert sender(attachment(found[0], NOW, found[1])) == found
    return True


# Reports in JSON, over rosbridge


def reports() -> Sequence[bytes]:
    """Conversations: messages of a robot, each with the number of its topic."""
    stamp = {"secs": 7, "nsecs": 5}
    header = {"stamp": stamp, "frame_id": "map"}
    place = {"x": 1.0, "y": 1.0, "z": 2}
    kinds: list[object] = [
        {"header": header, "pose": {"position": place, "orientation": {"w": 1}}},
        {"header": {"stamp": {"sec": 7, "nanosec": 5}}, "percentage": 0.1},
        {"header": header, "percentage": None},
        {"data": "motor"},
        {"header": header, "point": place},
    ]
    order = [0, 4, 1, 2, 3, 5, 0, 4, 2]
    conversation = [[number, kinds[number % len(kinds)]] for number in order]
    return [json.dumps(conversation).encode(), json.dumps([[n, kind] for n in range(30) for kind in kinds]).encode()]


def check_reports(content: bytes) -> bool:
    """Messages are read or refused; reports change the team, or nothing; what was read can be sent."""
    try:
        conversation = json.loads(content)
    except (ValueError, RecursionError):
        return False
    team = example("scouts")
    drones = drones_of(team)
    decoder, situation = ReportDecoder(drones, "map"), Situation(drones, 1.0)
    topics = list(decoder.topics.items())
    accepted = False
    for number, one in enumerate(conversation if isinstance(conversation, list) else [conversation]):
        which, message = one if isinstance(one, list) and len(one) == 2 else (number, one)
        topic, kind = topics[which % len(topics) if isinstance(which, int) else 0]
        try:
            fields, weight = incoming(message)
        except MalformedMessageError as wrong:
            assert_said(wrong)
            continue
        assert weight >= weight_of([]), "a message weighs nothing"
        outgoing(fields)
        report = decoder.report(ReceivedMessage(topic, kind, fields, NOW + number * 10**9))
        if report is None:
            continue
        accepted = True
        try:
            team = apply_changes(team, situation.changes(team, report))
        except (ChangeError, InvalidInputError):  # no robot or value remains
            break
    for text in (*situation.notes, *decoder.other_frames.values()):
        assert_clear(text or "an empty frame")
    return accepted


_of_text = one_of(spoilt_text, spoilt_text, spoilt_text, spoilt_bytes)
_of_bytes = one_of(spoilt_bytes, spoilt_bytes, spoilt_text)
_of_json = one_of(spoilt_json, spoilt_json, spoilt_json, spoilt_text, spoilt_bytes)
TARGETS = (
    *(Target(f"fleet-{kind}", partial(fleets, kind), _of_text, partial(check_fleet, kind)) for kind in VehicleKind),
    Target("map-grid", grids, in_folder(one_of(spoilt_text, spoilt_bytes)), check_grid),
    *(
        Target(f"map-octo{end}", partial(octomaps, end), _of_bytes, partial(check_octomap, end))
        for end in (".bt", ".ot")
    ),
    Target("map-json", ground_maps, _of_json, check_ground_map),
    Target("rosbag2", bags, _of_bytes, check_bag),
    Target("message-ros1", partial(samples, 1), _of_bytes, partial(check_sample, 1)),
    Target("message-ros2", partial(samples, 2), _of_bytes, partial(check_sample, 2)),
    Target("decide-request", requests, _of_bytes, check_request),
    Target("zenoh-attachment", lambda: [attachment(3, NOW, bytes(16))], spoilt_bytes, check_attachment),
    Target("reports", reports, _of_json, check_reports),
)
