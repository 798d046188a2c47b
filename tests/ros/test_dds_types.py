"""Types of ROS 2 as DDS is told of them: the description is that of the bytes."""

from __future__ import annotations

from typing import Any

from robochoc.ros.live.dds_types import dds_struct, raw_type, topic_name
from robochoc.ros.message_types import types_of
from tests.support.cases import looped

STAMP = 1_700_000_000_123_456_789
PACKAGES = {"diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs", "tf2_msgs"}


def kinds() -> list[str]:
    """Return all types of these packages."""
    names = types_of(2)._store.fielddefs  # noqa: SLF001 - all types that there are
    return sorted(name.replace("/msg/", "/") for name in names if name.split("/")[0] in PACKAGES)


def filled(kind: str, depth: int = 0) -> dict[str, Any]:
    """Fields of `kind`, none of them zero or empty."""
    return {
        name: value(field, number + depth)
        for number, (name, field) in enumerate(types_of(2).layout(kind), 1)
        if name != "structure_needs_at_least_one_member"
    }


def value(field: Any, number: int) -> Any:  # noqa: ANN401 - of any type
    if field.shape != "one":
        count = field.size if field.shape == "array" else min(3, field.size or 3)
        return [value(field._replace(shape="one"), number + one) for one in range(count)]
    if field.name.startswith("builtin_interfaces/"):
        return STAMP + number
    if "/" in field.name:
        return filled(field.name, number)
    plain = {"string": ("ü" * number)[: field.limit or number], "bool": number % 2 == 1}
    return plain.get(field.name, number / 4 if field.name.startswith("float") else number % 100)


@looped("kind", kinds)
def test_the_description_of_a_type_is_that_of_its_bytes(kind: str) -> None:
    """The library, which knows the description alone, reads our bytes and writes the same."""
    content = types_of(2).encode(kind, filled(kind))
    message = dds_struct(kind).deserialize(content)
    assert message.serialize().rstrip(b"\0") == content.rstrip(b"\0")
    assert raw_type(kind)(content).content == content


def test_names_in_dds() -> None:
    assert topic_name("/drone3_1/waypoint3_1") == "rt/drone3_1/waypoint3_1"
    assert raw_type("geometry_msgs/msg/PoseStamped").__idl_typename__ == (  # type: ignore[attr-defined]  # theirs
        "geometry_msgs::msg::dds_::PoseStamped_"
    )
