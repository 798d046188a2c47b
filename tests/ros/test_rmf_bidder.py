"""Robots that bid for RMF's tasks: their plans, bids and awards, message by message."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robochoc.formats import InvalidInputError
from robochoc.ros.rmf.bidder import Bidder
from robochoc.ros.rmf.fleet_file import RmfFleet, RobotSpec, read_rmf_fleet
from robochoc.ros.rmf.messages import (
    ApiRequest,
    ApiResponse,
    BidNotice,
    BidResponse,
    DispatchAck,
    DispatchCommand,
    Message,
    TaskStateUpdate,
)
from robochoc.ros.rmf.task_request import RequestError, TaskRequest
from robochoc.ros.rmf.trips import RobotState, Trip, plan, timed, trip_of
from tests.support.cases import looped

PLACES = {"a": (0.0, 0.0), "b": (10.0, 0.0), "c": (0.0, 4.0), "d": (30.0, 0.0)}
FLEET = RmfFleet("carts", {"one": RobotSpec((0.0, 0.0), 1.0), "two": RobotSpec((30.0, 0.0), 2.0)}, PLACES)
ALONE = RmfFleet("carts", {"one": RobotSpec((0.0, 0.0), 1.0)}, PLACES)
NOW_NS = 1_700_000_000 * 10**9


def notice(task_id: str, *places: str, category: str = "patrol", dry_run: bool = False, **more: Any) -> BidNotice:  # noqa: ANN401
    task = {"category": category, "description": {"places": places, "rounds": 1}, **more}
    return BidNotice(json.dumps(task), task_id, 2 * 10**9, dry_run)


def award(task_id: str, number: int = 1, fleet: str = "carts", kind: int = 1) -> DispatchCommand:
    return DispatchCommand(fleet, task_id, number, 0, kind)


def answers(bidder: Bidder, message: Message, now_s: float = 0.0) -> list[Message]:
    bidder.receive(message, now_s)
    return [one for one in bidder.drain() if not isinstance(one, TaskStateUpdate)]


def bid_of(bidder: Bidder, message: Message, now_s: float = 0.0) -> BidResponse:
    (answer,) = answers(bidder, message, now_s)
    assert isinstance(answer, BidResponse)
    return answer


def test_a_bid_and_its_award() -> None:
    bidder = Bidder(FLEET, epoch_ns=NOW_NS)
    one = bid_of(bidder, notice("t", "a", "b")).proposal
    assert (one.fleet_name, one.expected_robot_name, one.prev_cost, one.new_cost) == ("carts", "one", 0, 10)
    assert one.finish_time == NOW_NS + 10 * 10**9
    assert answers(bidder, award("t", 7)) == [DispatchAck(7, success=True)]
    assert [(event.what, event.robot) for event in bidder.drain_events()] == [("queued", "one"), ("underway", "one")]
    assert answers(bidder, award("t", 7)) == [DispatchAck(7, success=True)]  # repeated
    assert not bidder.drain_events()
    bidder.tick(9.9)
    assert not bidder.drain_events()
    bidder.tick(10)
    assert [event.what for event in bidder.drain_events()] == ["completed"]
    bidder.drain()
    bidder.receive(notice("t", "a", "b"), 11)
    assert not bidder.drain()  # it is done
    states = [json.loads(one.data)["data"] for one in answers_with_states(bidder, "u")]
    assert [state["status"] for state in states] == ["queued", "underway", "completed"]  # it is there already
    assert states[0]["assigned_to"] == {"group": "carts", "name": "one"}
    assert states[0]["booking"]["id"] == "u"


def answers_with_states(bidder: Bidder, task_id: str) -> list[TaskStateUpdate]:
    bidder.receive(notice(task_id, "b"), 12)
    bidder.receive(award(task_id, 8), 12)
    return [one for one in bidder.drain() if isinstance(one, TaskStateUpdate)]


def test_trips_that_wait_are_planned_together() -> None:
    """The robot drives to d; then a trip that begins at d comes before one that is older, and far away."""
    bidder = Bidder(ALONE)
    for number, place in enumerate("dad"):
        bid_of(bidder, notice(f"t{number}", place))
        assert answers(bidder, award(f"t{number}", number)) == [DispatchAck(number, success=True)]
    assert bidder.orders == {"one": ("t0", "t2", "t1")}


def test_a_repeated_notice_gets_the_same_bid() -> None:
    """A different bid would look like that of a second bidder with the same name."""
    bidder = Bidder(FLEET)
    first = bid_of(bidder, notice("t", "a", "b"))
    assert bid_of(bidder, notice("t", "a", "b"), 5.0) == first


def test_dry_runs_are_not_stored() -> None:
    bidder = Bidder(FLEET)
    assert bid_of(bidder, notice("t", "a", dry_run=True)).has_proposal
    (ack,) = answers(bidder, award("t"))
    assert isinstance(ack, DispatchAck)
    assert not ack.success
    assert json.loads(ack.errors[0])["code"] == 14


def test_a_command_for_another_fleet_drops_the_bid() -> None:
    bidder = Bidder(FLEET)
    bid_of(bidder, notice("t", "a"))
    assert not answers(bidder, award("t", fleet="others"))
    (ack,) = answers(bidder, award("t"))
    assert isinstance(ack, DispatchAck)
    assert not ack.success


def with_three_tasks() -> Bidder:
    """A robot with a task that is underway, and two that wait."""
    bidder = Bidder(ALONE)
    for task_id in "tuv":
        bid_of(bidder, notice(task_id, "b"))
        answers(bidder, award(task_id))
    return bidder


def test_a_task_is_removed() -> None:
    bidder = with_three_tasks()
    assert answers(bidder, award("u", 9, kind=2)) == [DispatchAck(9, success=True)]
    assert bidder.orders == {"one": ("t", "v")}
    assert answers(bidder, award("t", 9, kind=2)) == [DispatchAck(9, success=True)]  # underway: it is completed
    assert bidder.orders == {"one": ("t", "v")}
    (ack,) = answers(bidder, award("t", 9, kind=3))
    assert isinstance(ack, DispatchAck)
    assert "the type 3" in ack.errors[0]


def test_users_cancel_tasks_that_wait() -> None:
    bidder = with_three_tasks()
    results = {}
    for task_id in "tuw":
        request = ApiRequest(json.dumps({"type": "cancel_task_request", "task_id": task_id}), task_id)
        for answer in answers(bidder, request):
            assert isinstance(answer, ApiResponse)
            results[task_id] = json.loads(answer.json_msg)["success"]
    assert results == {"t": False, "u": True}  # others answer for w


@pytest.mark.parametrize(
    ("task", "told"),
    [
        ({"category": "patrol", "description": {"places": ["nowhere"], "rounds": 1}}, "unknown place 'nowhere'"),
        ({"category": "patrol", "description": {"places": []}}, "no stops"),
        ({"category": "patrol", "description": {"places": ["a"], "rounds": 10**9}}, "fewer rounds"),
        ({"category": "patrol", "description": 3}, "invalid"),
        ({"category": "dance", "description": {}}, "patrol, delivery, clean"),
        ({"description": {}}, "category"),
        ([], "expected an object"),
    ],
)
def test_tasks_that_it_cannot_do(task: object, told: str) -> None:
    answer = bid_of(Bidder(FLEET), BidNotice(json.dumps(task), "t", 1))
    assert not answer.has_proposal
    assert told in json.loads(answer.errors[0])["detail"]


def test_a_task_for_another_fleet_gets_no_answer() -> None:
    assert not answers(Bidder(FLEET), notice("t", "a", fleet_name="others"))
    assert answers(Bidder(FLEET), notice("t", "a", fleet_name="carts"))


def test_deliveries_and_cleanings() -> None:
    delivery = {"pickup": {"place": "a", "payload": []}, "dropoff": {"place": "b"}}
    assert trip_of(TaskRequest("delivery", delivery), FLEET) == Trip(((0, 0), (10, 0)), 10)
    assert trip_of(TaskRequest("clean", {"zone": "c"}), FLEET) == Trip(((0, 4),), 0)
    with pytest.raises(RequestError, match="pickup"):
        trip_of(TaskRequest("delivery", {"dropoff": {"place": "b"}}), FLEET)


# Plans


@looped("seed", range(25))
def test_a_plan_has_the_lowest_sum_of_delays(seed: int) -> None:
    chance = Random(seed)
    names = [*PLACES]
    trips = {
        f"t{n}": trip_of(TaskRequest("patrol", {"places": chance.choices(names, k=chance.randint(1, 3))}), FLEET)
        for n in range(chance.randint(1, 4))
    }
    robots = {
        f"r{n}": RobotState(chance.choice([*PLACES.values()]), chance.uniform(0, 30), chance.choice((0.5, 1.0, 2.0)))
        for n in range(chance.randint(1, 3))
    }
    found = plan(FLEET, robots, trips, 0.0)
    assert found is not None
    best = min(
        timed(FLEET, robots, trips, orders, 0.0).cost_s
        for order in itertools.permutations(trips)
        for owners in itertools.product(robots, repeat=len(trips))
        for orders in [{r: [t for t, owner in zip(order, owners, strict=True) if owner == r] for r in robots}]
    )
    assert found.cost_s == pytest.approx(best, abs=0.01)


def test_many_trips_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond a few, trips are appended; beyond `WAITING_MAX`, they are refused."""
    monkeypatch.setattr("robochoc.ros.rmf.bidder.WAITING_MAX", 12)
    bidder = Bidder(FLEET)
    for number in range(20):
        answer = bid_of(bidder, notice(f"t{number}", "a", "d", "a"))
        if answer.has_proposal:
            answers(bidder, award(f"t{number}", number))
    assert sum(map(len, bidder.orders.values())) == 14
    assert "12 tasks wait" in answer.errors[0]
    for second in range(0, 2000, 10):
        bidder.tick(second)
    assert not any(bidder.orders.values())


# The file

FILE = """fleet: carts
distance: streets
robots:
  one: {at: [0, 0.5], speed: 0.7}
  two: {at: [3, 4]}
places: {pantry: [1, 2], coe: [-3, 1e3]}
"""


def test_a_fleet_file(tmp_path: Path) -> None:
    path = tmp_path / "fleet.yaml"
    path.write_text(FILE.replace("1e3", "7"))
    found = read_rmf_fleet(path)
    assert found.robots == {"one": RobotSpec((0, 0.5), 0.7), "two": RobotSpec((3, 4), 1.0)}
    assert found.places == {"pantry": (1, 2), "coe": (-3, 7)}
    assert found.way_m((0, 0), (3, 4)) == pytest.approx(7)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("fleet: carts\n", "", "1: the fleet has no fleet"),
        ("fleet: carts", "fleet: [a]", "1: the fleet's name is not a text"),
        ("streets", "birds", "2: 'distance' is 'birds'"),
        ("[3, 4]", "[3]", "5: 'at' is not a place"),
        ("0.7", "-1", "4: 'speed' is '-1'"),
        ("1e3", "9999999", "6: a place is not a place"),
        ("{pantry: [1, 2], coe: [-3, 1e3]}", "{}", "6: there are no places"),
        ("distance", "distances", "2: unknown key 'distances'"),
        ("fleet: carts", "fleet: \xff", ""),
    ],
)
def test_mistakes_in_a_fleet_file(old: str, new: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "fleet.yaml"
    path.write_bytes(FILE.replace(old, new).replace("1e3", "7").encode("latin-1"))
    with pytest.raises(InvalidInputError) as caught:
        read_rmf_fleet(path)
    assert told in str(caught.value)
