"""Names in ROS: legal, reversible, and never two topics under one."""

from __future__ import annotations

import re

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from robochoc.flight.mission import Drone
from robochoc.model.problem import Topic
from robochoc.robots.source import REPORTS
from robochoc.ros.names import NAME_MAX, NameClashError, TopicNames, ros_name
from tests.support.cases import looped

TOKEN = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
TOPICS = st.text(min_size=1, max_size=30) | st.from_regex(
    r"/drone[0-9._ -]{1,4}/(waypoint|pose)?[0-9._é-]{0,4}", fullmatch=True
)


def drone(name: str, topic: str | None, robot: str = "") -> Drone:
    return Drone(name, robot or f"Robot {name}", None if topic is None else Topic(topic), (0.0, 0.0, 0.0), 0)


def legal(name: str) -> bool:
    """As ROS 1 and ROS 2 both have it; nothing hidden, nothing relative."""
    tokens = name.split("/")
    return not tokens[0] and len(tokens) > 1 and all(map(TOKEN.fullmatch, tokens[1:])) and "__" not in name


@given(st.lists(st.tuples(st.text(max_size=8), st.none() | TOPICS), min_size=1, max_size=6))
@example([("a", "/drone3.1/waypoint3.1"), ("b", "/drone3.2/waypoint3.2")])
@example([("a", "/x/pose"), ("b", "/x/waypoint")])
@example([("a", "/x/pose"), ("b", "/y/x")])
@example([("a", "/x"), ("b", "/x/pose")])
def test_names_are_legal_and_lead_back_or_are_refused(offered: list[tuple[str, str | None]]) -> None:
    drones = [drone(name, topic, f"R{number}") for number, (name, topic) in enumerate(offered)]
    try:
        names = TopicNames(drones)
    except NameClashError:
        return
    waypoints = [topic for number in range(len(drones)) if (topic := names.waypoint(number))]
    published = [*waypoints, *names.reports()]
    assert all(map(legal, published))
    assert len({*published}) == len(waypoints) + len(REPORTS) * len(drones)
    for number, each in enumerate(drones):
        known = names.waypoint(number)
        assert (known is None) == (each.topic is None)
        assert names.original[known or names.namespace(number)] == (each.topic.name if each.topic else each.name)


@given(st.from_regex(r"(/[A-Za-z](_?[A-Za-z0-9]){0,5}){1,3}", fullmatch=True))
def test_what_is_legal_stays_as_it_is(name: str) -> None:
    assume(not name.startswith(("/tf", "/clock", "/bond", "/rosout", "/diagnostics")))
    assert ros_name(name) == name


@looped(
    ("name", "expected"),
    [
        ("/drone3.1/waypoint3.1", "/drone3_1/waypoint3_1"),
        ("waypoint", "/waypoint"),
        ("//a///b/", "/a/b"),
        ("/3.1/way point", "/n3_1/way_point"),
        ("/_hidden/a__b", "/hidden/a_b"),
        ("/Zoé/Straße", "/Zoe/Straudfe"),
        ("/无/点", "/u65e0/u70b9"),
        ("/...", "/n"),
        ("~/{node}", "/n/node"),
        ("/tf", "/tf_topic"),
        ("/parameter_events", "/parameter_events_topic"),
    ],
)
def test_names_as_they_become(name: str, expected: str) -> None:
    assert ros_name(name) == expected


def test_the_space_is_the_first_token_if_it_is_the_drones_own() -> None:
    names = TopicNames(
        [drone("A", "/drone3.1/waypoint3.1"), drone("B", "/fleet/b"), drone("C", "/fleet/c"), drone("D.1", None)]
    )
    assert [names.namespace(number) for number in range(4)] == ["/drone3_1", "/fleet/b", "/fleet/c", "/D_1"]
    assert names.waypoint(3) is None
    assert names.reports()["/drone3_1/battery"] == "sensor_msgs/BatteryState"


def test_the_first_topic_of_a_robot_has_the_space_of_its_token() -> None:
    own = [drone("A", "/amr1/goal", "amr1"), drone("B", "/amr1/wait", "amr1"), drone("C", "/amr2/goal", "amr2")]
    names = TopicNames(own)
    assert [names.namespace(number) for number in range(3)] == ["/amr1", "/amr1/wait", "/amr2"]
    shared = TopicNames([*own, drone("D", "/amr1/spare", "other")])
    assert [shared.namespace(number) for number in (0, 1, 3)] == ["/amr1/goal", "/amr1/wait", "/amr1/spare"]


def test_a_waypoint_that_is_called_like_a_report_is_no_report() -> None:
    names = TopicNames([drone("A", "/a/pose")])
    assert names.waypoint(0) == "/a/pose"
    assert names.namespace(0) == "/a/pose"


def test_a_clash_names_topics_robots_and_the_way_out() -> None:
    with pytest.raises(NameClashError) as clash:
        TopicNames([drone("A", "/a.1/w", "North"), drone("B", "/a_1/w", "South")])
    told = "topic '/a.1/w' of North and topic '/a_1/w' of South would both have the topic /a_1/w in ROS: rename one"
    assert str(clash.value) == told


def test_drones_do_not_share_a_topic() -> None:
    with pytest.raises(
        NameClashError, match=r"A \(North\) and B \(South\) both publish on '/w': give each its own topic"
    ):
        TopicNames([drone("A", "/w", "North"), drone("B", "/w", "South")])


def test_a_report_does_not_run_into_a_waypoint() -> None:
    with pytest.raises(NameClashError, match=r"/a/pose in ROS"):
        TopicNames([drone("A", "/a"), drone("B", "/b"), drone("C", "/a/pose")])


def test_drones_without_topics_clash_by_their_names() -> None:
    with pytest.raises(NameClashError, match=r"drone 'a\.b' of .* and drone 'a b' of .* topic /a_b/"):
        TopicNames([drone("a.b", None), drone("a b", None)])


def test_a_name_that_is_too_long_is_refused() -> None:
    with pytest.raises(NameClashError, match="too long"):
        TopicNames([drone("A", "/" + "a" * NAME_MAX)])


def test_a_clash_does_not_speak_to_the_terminal() -> None:
    with pytest.raises(NameClashError) as clash:
        TopicNames([drone("A", "/a\x1b[2J", "North\n"), drone("B", "/a\x1b[2J", "South")])
    assert str(clash.value).isprintable()
