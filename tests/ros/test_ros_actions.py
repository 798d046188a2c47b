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
from tests.support.played_nav2 import MANNERS
from tests.support.zenoh_ros2 import Router

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


@pytest.fixture(scope="module", autouse=True)
def _loopback() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
        yield


@pytest.fixture(scope="module", params=["dds", "rmw_zenoh"])
def place(request: pytest.FixtureRequest, router: Router) -> str:
    return f"dds:{free_domain()}" if request.param == "dds" else f"rmw_zenoh:{router.place}"


@pytest.fixture(scope="module")
def robots(place: str) -> Iterator[PlayedRobots]:
    """A robot of each manner; its name is the manner."""
    with PlayedRobots(place, {name_of(manner): manner for manner in MANNERS}) as robots:
        yield robots


def name_of(manner: str) -> str:
    return f"/{manner.replace(' ', '_')}"


@contextmanager
def connected(place: str, manner: str) -> Iterator[tuple[Actions, str]]:
    """A client that has found the server of the robot with this manner, and the name of its action."""
    action = f"{name_of(manner)}/navigate_to_pose"
    with open_actions(place) as actions:
        actions.prepare({action: "nav2_msgs/NavigateToPose"})
        wait_until(lambda: bool(actions.has_server(action)), "the server is not found")
        yield actions, action


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
def test_a_goal_is_reached(place: str, robots: PlayedRobots, manner: str) -> None:
    with connected(place, manner) as (actions, action):
        goal = actions.send(action, GOAL, HANG_S)
        found = events(actions, {S, B, C, L, R})
        assert robots.wait_for(name_of(manner), "goal") == [[1.0, 2.0, 0.0], "map"]
        assert {one.goal for one in found} == {goal}
        assert found[-1].phase is S
        assert found[-1].fields == {"error_code": 0}
        assert {one.phase for one in found} <= {A, F, S}
        places = [one.fields["current_pose"]["pose"]["position"]["x"] for one in found if one.phase is F]
        assert places == sorted(places)
        assert actions.next(0.2) is None, "the goal has ended"


@pytest.mark.usefixtures("robots")
@pytest.mark.parametrize(
    ("manner", "last", "fields"), [("rejects", R, {}), ("aborts", B, {"error_code": 9002}), ("unknown status", L, None)]
)
def test_a_goal_fails(place: str, manner: str, last: GoalPhase, fields: object) -> None:
    with connected(place, manner) as (actions, action):
        actions.send(action, GOAL, HANG_S)
        event = events(actions, {S, B, C, L, R})[-1]
        assert event.phase is last
        assert fields is None or event.fields == fields
        assert actions.next(0.2) is None


def test_a_goal_is_cancelled(place: str, robots: PlayedRobots) -> None:
    with connected(place, "keeps driving") as (actions, action):
        goal = actions.send(action, GOAL, HANG_S)
        events(actions, {F})
        actions.cancel(goal)
        assert robots.wait_for("/keeps_driving", "cancel") == [goal]
        assert events(actions, {S, B, C, L, R})[-1].phase is C
        actions.cancel(goal)
        assert actions.next(0.2) is None, "a goal that has ended is not cancelled"


@pytest.mark.usefixtures("robots")
def test_a_goal_replaces_another(place: str) -> None:
    with connected(place, "keeps driving") as (actions, action):
        first = actions.send(action, GOAL, HANG_S)
        events(actions, {F})
        second = actions.send(action, GOAL, HANG_S)
        found = events(actions, {B})
        assert (found[-1].goal, found[-1].phase) == (first, B)
        wait_until(lambda: any(one.goal == second for one in events(actions, {F})), "the second is not pursued")


@pytest.mark.usefixtures("robots")
def test_a_server_vanishes(place: str) -> None:
    with connected(place, "vanishes") as (actions, action):
        actions.send(action, GOAL, HANG_S)
        wait_until(lambda: not actions.has_server(action), "the server is still there")


@pytest.mark.more
def test_a_server_is_killed(place: str) -> None:
    with PlayedRobots(place, {"/killed": "drives"}) as killed, open_actions(place) as actions:
        actions.prepare({"/killed/navigate_to_pose": "nav2_msgs/NavigateToPose"})
        wait_until(lambda: bool(actions.has_server("/killed/navigate_to_pose")), "the server is not found")
        killed.kill()
        wait_until(lambda: not actions.has_server("/killed/navigate_to_pose"), "the server is still there")


@pytest.mark.usefixtures("robots")
def test_an_answer_cannot_be_read(place: str) -> None:
    with connected(place, "garbage") as (actions, action):
        actions.send(action, GOAL, HANG_S)
        event = events(actions, {S, B, C, L, R})[-1]
        if place.startswith("rmw_zenoh"):  # Cyclone DDS itself checks what it reads
            assert event.phase is L
            assert "cannot be read" in event.why


@pytest.mark.usefixtures("robots")
def test_a_mute_server(place: str) -> None:
    with connected(place, "mute") as (actions, action):
        actions.send(action, GOAL, 0.2)
        event = actions.next(0.5)
        assert event is None or (event.phase, event.why) == (L, f"{action}/_action/send_goal has not answered")
