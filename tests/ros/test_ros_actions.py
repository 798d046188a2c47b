"""Goals of ROS actions over DDS and zenoh: the other end is played, with types written by hand, well and badly."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from robochoc.ros.live.actions import Actions, GoalEvent, GoalPhase, open_actions
from tests.support.dds import LOOPBACK_ALONE, free_domain
from tests.support.limits import HANG_S, wait_until
from tests.support.nav2_robots import PlayedRobots
from tests.support.zenoh_ros2 import Router

ACTION = "/r1/navigate_to_pose"
GOAL = {"pose": {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.0, "y": 2.0}, "orientation": {"w": 1.0}}}}
A, R, F, S, C, B, L = (
    GoalPhase.ACCEPTED,
    GoalPhase.REJECTED,
    GoalPhase.FEEDBACK,
    GoalPhase.SUCCEEDED,
    GoalPhase.CANCELED,
    GoalPhase.ABORTED,
    GoalPhase.LOST,
)

pytestmark = pytest.mark.usefixtures("no_ros_here")


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)


@pytest.fixture(params=["dds", "rmw_zenoh"])
def place(request: pytest.FixtureRequest, router: Router) -> str:
    return f"dds:{free_domain()}" if request.param == "dds" else f"rmw_zenoh:{router.place}"


@contextmanager
def connected(place: str, manner: str) -> Iterator[tuple[Actions, PlayedRobots]]:
    """A client that has found the server of one robot."""
    with PlayedRobots(place, {"/r1": manner}) as robots, open_actions(place) as actions:
        actions.prepare({ACTION: "nav2_msgs/NavigateToPose"})
        wait_until(lambda: actions.has_server(ACTION), "the server is not found")
        yield actions, robots


def events(actions: Actions, until: set[GoalPhase]) -> list[GoalEvent]:
    """Return the events up to one of these phases."""
    found: list[GoalEvent] = []
    deadline = time.monotonic() + HANG_S
    while not found or found[-1].phase not in until:
        assert time.monotonic() < deadline, found
        event = actions.next(0.1)
        if event is not None:
            found.append(event)
    return found


@pytest.mark.parametrize("manner", ["drives", "twice", "others"])
def test_a_goal_is_reached(place: str, manner: str) -> None:
    with connected(place, manner) as (actions, robots):
        goal = actions.send(ACTION, GOAL, HANG_S)
        found = events(actions, {S, B, C, L, R})
        assert robots.wait_for("/r1", "goal") == [[1.0, 2.0, 0.0], "map"]
        assert {one.goal for one in found} == {goal}
        assert found[-1].phase is S
        assert found[-1].fields == {"error_code": 0}
        assert {one.phase for one in found} <= {A, F, S}
        places = [one.fields["current_pose"]["pose"]["position"]["x"] for one in found if one.phase is F]
        assert places == sorted(places)
        assert actions.next(0.2) is None, "the goal has ended"


@pytest.mark.parametrize(
    ("manner", "last", "fields"), [("rejects", R, {}), ("aborts", B, {"error_code": 9002}), ("unknown status", L, None)]
)
def test_a_goal_fails(place: str, manner: str, last: GoalPhase, fields: object) -> None:
    with connected(place, manner) as (actions, _):
        actions.send(ACTION, GOAL, HANG_S)
        event = events(actions, {S, B, C, L, R})[-1]
        assert event.phase is last
        assert fields is None or event.fields == fields
        assert actions.next(0.2) is None


def test_a_goal_is_cancelled(place: str) -> None:
    with connected(place, "keeps driving") as (actions, robots):
        goal = actions.send(ACTION, GOAL, HANG_S)
        events(actions, {F})
        actions.cancel(goal)
        assert robots.wait_for("/r1", "cancel") == [goal]
        assert events(actions, {S, B, C, L, R})[-1].phase is C
        actions.cancel(goal)
        assert actions.next(0.2) is None, "a goal that has ended is not cancelled"


def test_a_goal_replaces_another(place: str) -> None:
    with connected(place, "keeps driving") as (actions, _):
        first = actions.send(ACTION, GOAL, HANG_S)
        events(actions, {F})
        second = actions.send(ACTION, GOAL, HANG_S)
        found = events(actions, {B})
        assert (found[-1].goal, found[-1].phase) == (first, B)
        wait_until(lambda: any(one.goal == second for one in events(actions, {F})), "the second is not pursued")


def test_a_server_vanishes(place: str) -> None:
    with connected(place, "vanishes") as (actions, _):
        actions.send(ACTION, GOAL, HANG_S)
        events(actions, {F})
        wait_until(lambda: not actions.has_server(ACTION), "the server is still there")


def test_a_server_is_killed(place: str) -> None:
    with connected(place, "keeps driving") as (actions, robots):
        actions.send(ACTION, GOAL, HANG_S)
        events(actions, {F})
        robots.kill()
        wait_until(lambda: not actions.has_server(ACTION), "the server is still there")


def test_an_answer_cannot_be_read(router: Router) -> None:
    with connected(f"rmw_zenoh:{router.place}", "garbage") as (actions, _):
        actions.send(ACTION, GOAL, HANG_S)
        event = events(actions, {S, B, C, L, R})[-1]
        assert event.phase is L
        assert "cannot be read" in event.why


def test_a_mute_server(place: str) -> None:
    with connected(place, "mute") as (actions, robots):
        actions.send(ACTION, GOAL, 0.2)
        event = actions.next(0.5)
        assert event is None or (event.phase, event.why) == (L, f"{ACTION}/_action/send_goal has not answered")
        robots.become("/r1", "drives")
        actions.send(ACTION, GOAL, HANG_S)
        assert events(actions, {S, B, C, R})[-1].phase is S
