"""What robots report, and what it changes in the problem: by every way in which a drone's place can be decided."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robochoc.flight.reports import (
    BatteryReport,
    BlockedReport,
    ClearedReport,
    DoneReport,
    OutOfOrderReport,
    PoseReport,
    Report,
)
from robochoc.model.change import apply_changes
from robochoc.model.expression import Expression, Type, parse
from robochoc.model.problem import (
    AddValue,
    Change,
    Domain,
    RemoveAgent,
    RemoveValue,
    Robot,
    Team,
    Topic,
    Variable,
)
from robochoc.robots.closed_loop import drones_of
from robochoc.robots.situation import LIES_TIMES, PointIndex, Situation
from robochoc.robots.source import ReceivedMessage
from robochoc.ros.report_decoder import ReportDecoder
from tests.support.cases import looped
from tests.support.problems import team_of
from tests.support.task_lists import imported

HUGE = Domain("huge", (range(10**9),))
LEVELS = Domain("levels", (range(1, 5),))


def said(text: str, *variables: str) -> Expression:
    return parse(text, variables, Type.INTEGER)


def robot(name: str, x: str, y: str, z: str | None, **domains: Domain) -> Robot:
    """A robot with one topic, whose variables have these domains."""
    height = None if z is None else said(z, *domains)
    topic = Topic(f"/{name}/waypoint", x=said(x, *domains), y=said(y, *domains), z=height)
    return Robot(name, tuple(Variable(*item) for item in domains.items()), topics=(topic,))


def pair() -> Team:
    return Team("pair", (robot("A", "1", "1", "a", a=LEVELS), robot("B", "2", "1", "b", b=LEVELS)))


def situation(team: Team, scale: float = 1.0) -> Situation:
    return Situation(drones_of(team), scale)


def after(team: Team, *reports: Report, scale: float = 1.0) -> tuple[Change, ...]:
    """What the last of `reports` changes; those before have happened."""
    sees = situation(team, scale)
    for report in reports[:-1]:
        team = apply_changes(team, sees.changes(team, report))
    return sees.changes(team, reports[-1])


def test_an_obstacle_takes_the_value_that_leads_there_and_nothing_else() -> None:
    assert after(pair(), BlockedReport("B", (1, 1, 3))) == (RemoveValue("a", 3),)
    assert after(pair(), BlockedReport("A", (2.2, 0.9, 1.3))) == (RemoveValue("b", 1),)


def test_places_are_in_metres_and_the_problem_in_units() -> None:
    assert after(pair(), BlockedReport("A", (0.5, 0.5, 1.5)), scale=0.5) == (RemoveValue("a", 3),)


def test_between_two_places_an_obstacle_takes_both() -> None:
    assert after(pair(), BlockedReport("A", (1, 1, 2.5))) == (RemoveValue("a", 2), RemoveValue("a", 3))
    assert after(pair(), BlockedReport("A", (1.5, 1, 2))) == (RemoveValue("a", 2), RemoveValue("b", 2))


def test_an_obstacle_beside_everything_is_told_of() -> None:
    sees = situation(pair())
    assert sees.changes(pair(), BlockedReport("A", (9, 9, 9))) == ()
    assert "it changes nothing" in "".join(sees.notes)


def test_not_all_that_changes_nothing_is_told_of() -> None:
    sees = situation(pair())
    for number in range(100):
        sees.changes(pair(), BlockedReport("A", (9, 9, number)))
    assert len(sees.notes) == 20


def test_the_same_obstacle_takes_nothing_twice() -> None:
    assert after(pair(), BlockedReport("A", (1, 1, 3)), BlockedReport("B", (1, 1, 3))) == ()


def test_what_is_clear_again_gives_back_what_was_taken() -> None:
    assert after(pair(), BlockedReport("A", (1, 1, 3)), ClearedReport("B", (1.2, 1, 3))) == (AddValue("a", 3),)
    assert after(pair(), ClearedReport("B", (1, 1, 3))) == ()


def test_what_the_files_never_had_is_not_given_back() -> None:
    assert after(pair(), BlockedReport("A", (1, 1, 9)), ClearedReport("A", (1, 1, 9))) == ()


def test_another_obstacle_keeps_what_one_gives_back() -> None:
    reports = (BlockedReport("A", (1, 1, 2.5)), BlockedReport("A", (1, 1, 3.4)), ClearedReport("A", (1, 1, 2.3)))
    assert after(pair(), *reports) == (AddValue("a", 2),)


def test_out_of_order_takes_the_robot_once() -> None:
    assert after(pair(), OutOfOrderReport("B", "motor 2")) == (RemoveAgent("B"),)
    assert after(pair(), OutOfOrderReport("B"), OutOfOrderReport("B"), BlockedReport("B", (1, 1, 1))) == ()


def test_a_task_that_is_done_remains_done(tmp_path: Path) -> None:
    lists = ["robots: {a: , b: }\ntasks: {dig: {worth: 5}, lay: {worth: 5}}\n"]
    lists.append(lists[0] + "model: assignment\n")
    for text, variable, kept in zip(lists, ("a.dig", "a.task"), (1, 1), strict=True):
        team = imported(text, tmp_path).team
        values = {name: kept if name == variable else 0 for name in team.variables}
        changes = situation(team).done(team, DoneReport("a", variable.partition(".")[2]), values)
        after = apply_changes(team, changes)
        assert [*after.variables[variable].domain] == [kept]
        other = variable.replace("a.", "b.")
        assert kept not in after.variables[other].domain
        assert 0 in after.variables[other].domain


def test_a_task_of_another_robot_is_not_done(tmp_path: Path) -> None:
    team = imported("robots: {a: , b: }\ntasks: {dig: {worth: 5}}\n", tmp_path).team
    for report in (DoneReport("a", "b.dig"), DoneReport("a", "dig"), DoneReport("a", "x\x1b"), DoneReport("c", "dig")):
        known = situation(team)
        assert known.done(team, report, {"a.dig": 0, "b.dig": 1}) == ()
        assert "reports a task as done that it does not have" in known.notes[0]
        assert known.notes[0].isprintable()


@looped(("level", "leaves"), [(0.19, True), (0.0, True), (0.2, False), (1.0, False), (-1.0, False)])
def test_an_empty_battery_takes_the_robot(level: float, leaves: bool) -> None:  # noqa: FBT001 - a table
    assert after(pair(), BatteryReport("A", level)) == ((RemoveAgent("A"),) if leaves else ())


def test_strangers_change_nothing() -> None:
    for report in (
        BlockedReport("X", (1, 1, 3)),
        OutOfOrderReport("X"),
        BatteryReport("X", 0),
        PoseReport("X", (0, 0, 0)),
    ):
        assert after(pair(), report) == ()


def flight(*heights: float, step_s: float = 0.5) -> tuple[PoseReport, ...]:
    """Poses of A, above where it stood (which is one unit below the lowest level)."""
    ground = drones_of(pair())[0].home[2]
    return tuple(PoseReport("A", (1, 1, ground + height), number * step_s) for number, height in enumerate(heights))


def test_a_drone_that_has_flown_and_lies_on_the_ground_is_out_of_order() -> None:
    assert after(pair(), *flight(0, 0.6, 2, 0.1, 0.1, 0.1)) == (RemoveAgent("A"),)


@looped(
    "poses",
    [
        flight(*[0.0] * 50),  # it waits until others have passed
        flight(0, 2, 0.1, 0.1),  # twice is not often enough
        flight(0, 2, 0.1, 0.1, 0.1, step_s=0.1),  # nor is a fifth of a second long
        flight(0, 2, 0.1, 0.1, 0.3, 0.1, 0.1),  # it has bounced
        flight(0, 2, *[1.0] * 50),  # it hovers far from its goal while the team decides
    ],
)
def test_a_drone_that_may_be_well_stays(poses: tuple[PoseReport, ...]) -> None:
    assert LIES_TIMES == 3
    sees, team = situation(pair()), pair()
    assert not any(sees.changes(team, pose) for pose in poses)


def test_a_large_domain_is_not_looked_through() -> None:
    team = Team("vast", (robot("A", "a", "3", "1", a=HUGE),))
    assert after(team, BlockedReport("A", (123_456_789, 3, 1))) == (RemoveValue("a", 123_456_789),)
    assert after(team, BlockedReport("A", (123_456_789, 5, 1))) == ()


def test_what_cannot_be_looked_through_is_told() -> None:
    team = Team("vast", (robot("A", "mod(a,10)", "3", "1", a=HUGE),))
    sees = situation(team)
    assert sees.changes(team, BlockedReport("A", (4, 3, 1))) == ()
    assert "a has too many values" in "".join(sees.notes)


def test_a_value_that_leads_there_by_reckoning() -> None:
    team = Team("slots", (robot("A", "mod(a,3)", "div(a,3)", "1", a=Domain("slots", (range(9),))),))
    assert after(team, BlockedReport("A", (1, 2, 1))) == (RemoveValue("a", 7),)


@pytest.mark.parametrize(("x", "z", "why"), [("a", "b", "depends on a and b"), ("1", "2", "depends on no variable")])
def test_where_no_variable_alone_decides_nothing_is_taken(x: str, z: str, why: str) -> None:
    team = Team("joint", (robot("A", x, "1", z, a=LEVELS, b=LEVELS),))
    sees = situation(team)
    assert sees.changes(team, BlockedReport("A", (1, 1, 2))) == ()
    assert why in "".join(sees.notes)
    assert sees.changes(team, BlockedReport("A", (1, 9, 2))) == ()
    assert why not in [*sees.notes][-1], "it is nowhere near"


def test_drones_without_topics_fly_above_where_they_stood() -> None:
    team = team_of(dict.fromkeys("AB", range(1, 5)), [])
    sees = Situation(drones_of(team), 1.0)
    x, y, _ = drones_of(team)[1].home
    assert sees.changes(team, BlockedReport("RA", (x, y, 2))) == (RemoveValue("B", 2),)


def test_rows_of_drones_with_a_variable_each() -> None:
    topics = tuple(Topic(f"/d{n}/waypoint", x=said("1"), y=said(str(n)), z=said(f"v{n}", f"v{n}")) for n in (1, 2))
    row = Robot("Row", (Variable("v1", LEVELS), Variable("v2", LEVELS)), topics=topics)
    assert after(Team("row", (row,)), BlockedReport("d1", (1, 2, 4))) == (RemoveValue("v2", 4),)
    assert after(Team("row", (row,)), OutOfOrderReport("d2")) == (RemoveAgent("Row"),)


def test_thousands_of_obstacles_cost_no_more_each_than_a_few() -> None:
    """A hundred million comparisons of places would take half a minute."""

    def steps(obstacles: int) -> int:
        team, sees = pair(), situation(pair())
        for number in range(obstacles):
            assert sees.changes(team, BlockedReport("A", (1.0, 50.0 + number, 1.0))) == ()
        for number in range(obstacles):
            assert sees.changes(team, ClearedReport("A", (1.0, 50.0 + number, 5.0))) == ()
        last = 49.0 + obstacles
        with counted_steps() as count:
            assert sees.changes(team, BlockedReport("A", (1.0, last, 1.0))) == ()
            assert sees.changes(team, ClearedReport("A", (9.0, last, 1.0))) == ()
        return count[0]

    assert 0 < steps(4_000) < 2 * steps(20)


@contextmanager
def counted_steps() -> Iterator[list[int]]:
    """How many of Python's instructions are executed meanwhile."""
    count, before = [0], sys.gettrace()

    def trace(frame: FrameType, event: str, _: object) -> Callable[..., Any]:
        frame.f_trace_opcodes = True
        count[0] += event == "opcode"
        return trace

    sys.settrace(trace)
    try:
        yield count
    finally:
        sys.settrace(before)


somewhere = st.tuples(*[st.floats(-2, 2) | st.sampled_from([-0.5, 0.0, 0.5, 1.0])] * 3)


@given(st.lists(somewhere, max_size=12), st.lists(st.tuples(somewhere, st.booleans()), max_size=6))
@example([(0.0, -7e-154, 0.0)], [((0.0, 0.5, 0.0), False)])
@example([(1.0 - 2**-53, 0.0, 0.0)], [((0.5, 0.0, 0.0), True), ((1.5, 0.0, 0.0), True)])
def test_what_is_near_is_found_as_if_all_were_looked_at(
    kept: list[tuple[float, float, float]], asked: list[tuple[tuple[float, float, float], bool]]
) -> None:
    places = PointIndex()
    for place in kept:
        places.add(place)
    for there, gone in asked:
        near = [place for place in kept if math.dist(place, there) <= 0.5]
        assert places.any_near(there, 0.5) == bool(near)
        if gone:
            assert places.remove_near(there, 0.5) == bool(near)
            kept = [place for place in kept if place not in near]
        assert len(places) == len(kept)
        assert places.cubes == len({tuple(map(math.floor, place)) for place in kept})


coordinates = st.floats(-1, 6) | st.sampled_from([1.0, 2.0, 1.5, 2.5])
reports = st.one_of(
    st.builds(BlockedReport, st.sampled_from("ABX"), st.tuples(coordinates, st.just(1.0), coordinates)),
    st.builds(ClearedReport, st.sampled_from("ABX"), st.tuples(coordinates, st.just(1.0), coordinates)),
    st.builds(BatteryReport, st.sampled_from("ABX"), st.floats(0, 1)),
    st.builds(OutOfOrderReport, st.sampled_from("ABX")),
)


@given(st.lists(reports, max_size=20))
def test_the_team_can_always_take_it_and_what_is_blocked_is_nobodys(heard: list[Report]) -> None:
    team, sees = pair(), situation(pair())
    obstacles: list[tuple[float, float, float]] = []
    for report in heard:
        there = report.drone in team
        team = apply_changes(team, sees.changes(team, report))  # raises `ChangeError` for what it cannot take
        if isinstance(report, BlockedReport) and there:
            obstacles.append(report.place)
        elif isinstance(report, ClearedReport) and there:
            obstacles = [place for place in obstacles if math.dist(place, report.place) > 0.5 + 1e-6]
        for x, name in ((1, "A"), (2, "B")):
            if name in team:
                free = {z for z in LEVELS if all(math.dist(place, (x, 1, z)) > 0.5 + 1e-6 for place in obstacles)}
                assert set(team.variables[name.lower()].domain) == free


# From raw messages


def heard(topic: str, fields: object, at_ns: int = 2_500_000_000) -> ReceivedMessage:
    reading = ReportDecoder(drones_of(pair()), "map")
    return ReceivedMessage(topic, reading.topics.get(topic, ""), fields, at_ns)  # type: ignore[arg-type]  # what comes in


def read(topic: str, fields: object) -> Report | None:
    return ReportDecoder(drones_of(pair()), "map").report(heard(topic, fields))


PLACE = {"x": 1, "y": 2.0, "z": 3.0}


def test_messages_become_reports() -> None:
    header = {"stamp": 7, "frame_id": "map"}
    assert read("/A/battery", {"header": header, "percentage": 0.5}) == BatteryReport("A", 0.5, 2.5)
    assert read("/A/pose", {"header": header, "pose": {"position": PLACE}}) == PoseReport("A", (1, 2, 3), 2.5)
    assert read("/B/blocked", {"header": header, "point": PLACE}) == BlockedReport("B", (1, 2, 3), 2.5)
    assert read("/B/cleared", {"point": PLACE}) == ClearedReport("B", (1, 2, 3), 2.5)
    assert read("/B/out_of_order", {"data": "no\nmotor"}) == OutOfOrderReport("B", "no\\nmotor", 2.5)


@looped("value", [math.nan, math.inf, -math.inf, "1", None, True, [1], {"x": 1}, 10**400, 1e300])
def test_what_is_no_number_is_passed_over(value: object) -> None:
    assert read("/A/battery", {"percentage": value}) is None
    for axis in "xyz":
        assert read("/A/blocked", {"point": {**PLACE, axis: value}}) is None
        assert read("/A/pose", {"pose": {"position": {**PLACE, axis: value}}}) is None


@looped("fields", [{}, {"point": None}, {"point": []}, {"header": 3, "point": 4}, {"pose": {}}])
def test_what_is_missing_is_passed_over(fields: object) -> None:
    assert read("/A/blocked", fields) is None
    assert read("/A/pose", fields) is None
    assert read("/C/blocked", {"point": PLACE}) is None


def test_a_place_in_another_frame_is_no_place_of_ours() -> None:
    reading = ReportDecoder(drones_of(pair()), "map")
    assert reading.report(heard("/A/blocked", {"header": {"frame_id": "odom"}, "point": PLACE})) is None
    assert reading.other_frames == {"/A/blocked": "odom"}
    assert reading.report(heard("/A/blocked", {"header": {"frame_id": "/map"}, "point": PLACE})) is not None


def test_all_that_drones_may_report_is_listened_to() -> None:
    topics = ReportDecoder(drones_of(pair()), "map").topics
    assert topics["/A/battery"] == "sensor_msgs/BatteryState"
    assert len(topics) == 12


def test_two_drones_of_one_name_cannot_be_told_apart() -> None:
    one, other = drones_of(pair())
    sees = Situation([one, replace(other, name=one.name)], 1.0)
    assert sees.changes(pair(), OutOfOrderReport(one.name)) == ()
