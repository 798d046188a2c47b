"""ROS types: fields to bytes and back, and strangers' definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic

from robochoc.robots.source import REPORTS
from robochoc.ros.message_types import (
    DEFINITION_MAX,
    FieldsError,
    FieldType,
    UnknownTypeError,
    Version,
    same_fields,
    types_of,
)
from tests.support.cases import looped

POSE = "geometry_msgs/PoseStamped"
BATTERY = "sensor_msgs/BatteryState"
NUMBERS = st.floats(width=32, allow_nan=False)
BATTERIES = st.fixed_dictionaries(
    {
        "header": st.fixed_dictionaries(
            {
                "stamp": st.integers(0, (1 << 31) * 10**9 - 1),
                "frame_id": st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9),
            }
        ),
        "percentage": NUMBERS,
        "present": st.booleans(),
        "power_supply_status": st.integers(0, 255),
        "cell_voltage": st.lists(NUMBERS, max_size=4),
        "location": st.sampled_from(["", "left", "ü"]),
    }
)
ELSEWHERE = """# A pose, as the distribution's own file has it
std_msgs/Header header
Pose pose   # relative to the header's frame
=====
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/msg/Quaternion orientation

=====
MSG: geometry_msgs/Point
float64 x 0
float64 y
float64 z
=====
MSG: geometry_msgs/msg/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
=====
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


@given(BATTERIES, st.sampled_from([1, 2]))
@settings(deadline=None)
def test_what_is_written_is_read(fields: dict[str, Any], version: Version) -> None:
    types = types_of(version)
    found = types.decode(BATTERY, types.encode(BATTERY, fields))
    assert {name: found[name] for name in fields} == fields
    assert types.encode(BATTERY, found) == types.encode(BATTERY, fields)


@given(BATTERIES)
def test_the_reference_reads_what_is_written(fields: dict[str, Any]) -> None:
    types = types_of(2)
    decoders = generate_dynamic("sensor_msgs/msg/BatteryState", types.definition(BATTERY).text)
    message = decoders["sensor_msgs/msg/BatteryState"](types.encode(BATTERY, fields))
    stamp = message.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == fields["header"]["stamp"]
    assert message.header.frame_id == fields["header"]["frame_id"]
    assert message.percentage == fields["percentage"]
    assert [*message.cell_voltage] == fields["cell_voltage"]
    assert (message.present, message.location) == (fields["present"], fields["location"])


@looped(
    ("kind", "fields", "told"),
    [
        (POSE, {"pose": {"position": {"x": "1"}}}, "pose.position.x must be a number, not '1'"),
        (POSE, {"pose": {"position": {"x": True}}}, "pose.position.x must be a number, not True"),
        (POSE, {"pose": {"place": {}}}, "pose.place is not a field of geometry_msgs/Pose, which has orientation, pos"),
        (POSE, {"pose": None}, "pose must be fields by their names, not None"),
        (POSE, {"header": {"stamp": 1.0}}, "header.stamp must be a whole number"),
        (POSE, {"header": {"stamp": 1 << 70}}, "header.stamp must be a time of ROS "),
        (POSE, {"header": {"frame_id": b"map"}}, "header.frame_id must be text"),
        (POSE, {"header": {"frame_id": "\udc80"}}, "header.frame_id must be text that UTF-8 can encode"),
        (POSE, [], "it must be fields"),
        (BATTERY, {"percentage": 1e300}, "percentage must be a number of single precision"),
        (BATTERY, {"present": 1}, "present must be true or false, not 1"),
        (BATTERY, {"power_supply_status": 256}, "power_supply_status must be a whole number from 0 to 255, not 256"),
        (BATTERY, {"cell_voltage": 3}, "cell_voltage must be a list, not 3"),
        (BATTERY, {"cell_voltage": ["a"]}, "cell_voltage must be a number, not 'a'"),
        ("geometry_msgs/PoseWithCovariance", {"covariance": [0.0]}, "covariance must have 36 values, has 1"),
    ],
)
@looped("version", [1, 2])
def test_what_is_no_field_is_told_by_its_name(version: Version, kind: str, fields: Any, told: str) -> None:  # noqa: ANN401
    with pytest.raises(FieldsError) as wrong:
        types_of(version).encode(kind, fields)
    assert str(wrong.value).startswith(f"{kind}: {told}")


def test_numbers_of_numpy_are_numbers() -> None:
    types = types_of(2)
    fields = {"percentage": np.float32(0.5), "present": np.True_, "power_supply_status": np.uint8(2)}
    plain = {"percentage": 0.5, "present": True, "power_supply_status": 2}
    assert types.encode(BATTERY, fields) == types.encode(BATTERY, plain)


@looped("kind", ["my_msgs/Nothing", "PoseStamped", "", "../../etc"])
def test_types_that_nobody_defines(kind: str) -> None:
    with pytest.raises(UnknownTypeError, match="add its definition to its mapping"):
        types_of(2).encode(kind, {})


def test_sums_are_those_of_ros_1() -> None:
    known = {
        POSE: "d3812c3cbc69362b77dc0b19b345f8f5",
        "geometry_msgs/PointStamped": "c63aecb41bfdfd6b7e1fac37c7cbe7bf",
        "std_msgs/String": "992ce8a1687cec8c8bd883ec73ca41d1",
        BATTERY: "4ddae7f048e32fda22cac764685e3974",
    }
    assert {kind: types_of(1).definition(kind).md5 for kind in known} == known


@given(st.sampled_from(sorted({*REPORTS.values()})), st.binary(max_size=300), st.sampled_from([1, 2]))
def test_any_bytes_are_a_message_or_are_refused(kind: str, content: bytes, version: Version) -> None:
    types = types_of(version)
    try:
        fields = types.decode(kind, content)
    except FieldsError:
        return
    assert isinstance(fields, dict)


@given(st.integers(0, 1 << 32), st.integers(0, 75))
def test_a_message_that_is_cut_or_lies_about_its_sizes_is_refused(size: int, place: int) -> None:
    types = types_of(2)
    whole = types.encode("std_msgs/String", {"data": "x" * 80})
    with pytest.raises(FieldsError):
        types.decode("std_msgs/String", whole[:place])
    if size != 81:
        with pytest.raises(FieldsError):
            types.decode("std_msgs/String", whole[:4] + (size % (1 << 32)).to_bytes(4, "little") + whole[8:])


def test_a_definition_that_has_the_same_fields_is_the_same() -> None:
    assert types_of(2).has_same_fields(POSE, ELSEWHERE)
    assert types_of(2).has_same_fields("geometry_msgs/msg/PoseStamped", types_of(2).definition(POSE).text)
    assert not types_of(1).has_same_fields(POSE, ELSEWHERE)
    assert types_of(1).has_same_fields(POSE, types_of(1).definition(POSE).text.replace("std_msgs/Header h", "Header h"))
    assert types_of(2).has_same_fields(BATTERY, types_of(2).definition(BATTERY).text + "\n# the end")


@looped(
    ("old", "new"),
    [
        ("float64 z\n", ""),
        ("float64 y\n", "float32 y\n"),
        ("float64 y\n", "float64 why\n"),
        ("float64 y\n", "float64[] y\n"),
        ("string frame_id", "string<=3 frame_id"),
        ("float64 x 0\nfloat64 y\n", "float64 y\nfloat64 x\n"),
        ("string frame_id", "string frame_id; import os"),
        ("MSG: std_msgs/Header", "MSG: other_msgs/Header"),
        ("Pose pose ", "__import__('os').system('true') pose "),
        ("Pose pose ", "other_msgs/Pose pose "),
        ("# A pose", "#" * DEFINITION_MAX),
    ],
)
def test_a_definition_with_other_fields_is_another(old: str, new: str) -> None:
    assert old in ELSEWHERE
    same = new.endswith("import os")  # what stands behind a field is its default value
    assert types_of(2).has_same_fields(POSE, ELSEWHERE.replace(old, new)) == same


@given(st.text(max_size=200) | st.text("/=[]<# \nMSG:uint8int_x9", max_size=200))
def test_any_text_is_compared(text: str) -> None:
    assert not same_fields(POSE, text, ELSEWHERE)


def test_the_fields_of_a_type_and_their_types() -> None:
    types = types_of(2)
    assert types.layout("geometry_msgs/msg/PoseWithCovariance") == (
        ("pose", FieldType("geometry_msgs/Pose")),
        ("covariance", FieldType("float64", shape="array", size=36)),
    )
    found = dict(types.layout(BATTERY))
    assert found["cell_voltage"] == FieldType("float32", shape="sequence")
    assert found["location"] == FieldType("string")
    assert dict(types.layout("shape_msgs/SolidPrimitive"))["dimensions"] == FieldType("float64", 0, "sequence", 3)
    with pytest.raises(UnknownTypeError, match="add its definition to its mapping"):
        types.layout("my_msgs/Nothing")
