"""The dispatcher for RMF's fleets: a burst of tasks loses none, whatever happens to messages."""

from __future__ import annotations

import json
from collections import Counter
from random import Random

import pytest

from robochoc.ros.rmf import dispatcher as subject
from robochoc.ros.rmf.allocation import allocate, cheapest_first
from robochoc.ros.rmf.dispatcher import NOBODY, Dispatcher
from robochoc.ros.rmf.fleet_file import RmfFleet, RobotSpec
from robochoc.ros.rmf.fleets import CONFLICT_S
from robochoc.ros.rmf.messages import (
    ApiRequest,
    ApiResponse,
    BidNotice,
    BidProposal,
    BidResponse,
    DispatchAck,
    DispatchCommand,
    DispatchStates,
    Message,
    TaskStatus,
)
from robochoc.ros.rmf.records import DEFAULTS, Settings
from tests.support.cases import looped
from tests.support.rmf_fleets import BiddingFleet, PlayedFleet, PlayedNetwork, patrol_request


def carts(name: str) -> RmfFleet:
    robots = {"one": RobotSpec((0, 0), 1.0), "two": RobotSpec((20, 0), 2.0)}
    return RmfFleet(name, robots, {"pantry": (18, 3), "coe": (7, 3)})


def network(
    *fleets: PlayedFleet | BiddingFleet, seed: int = 0, settings: Settings = DEFAULTS, **trouble: float
) -> PlayedNetwork:
    dispatcher = Dispatcher("x", allocate, settings)
    return PlayedNetwork(dispatcher, {fleet.name: fleet for fleet in fleets}, Random(seed), **trouble)  # type: ignore[arg-type]


def statuses(net: PlayedNetwork) -> list[TaskStatus]:
    return [TaskStatus(state.status) for state in net.dispatcher.states.finished]


def assert_each_once(net: PlayedNetwork, number: int) -> None:
    """Each task has ended, and each dispatched one is in the plan of the fleet that the dispatcher names."""
    states = net.dispatcher.states
    assert not states.active
    assert len(states.finished) == number
    planned = Counter(task for fleet in net.fleets.values() for task in fleet.queue)
    assert sum(planned.values()) == sum(state.status == TaskStatus.DISPATCHED for state in states.finished)
    for state in states.finished:
        assert state.status in {TaskStatus.DISPATCHED, TaskStatus.FAILED}
        assert planned[state.task_id] == (state.status == TaskStatus.DISPATCHED)
        if state.status == TaskStatus.DISPATCHED:
            assert state.task_id in net.fleets[state.assignment.fleet_name].queue


# A burst of seven tasks (rmf_demos#302)


@pytest.mark.parametrize("fleets", [1, 2, 3])
def test_a_burst_of_seven_loses_none(fleets: int) -> None:
    net = network(*(PlayedFleet(f"f{n}", think_s=0.3) for n in range(fleets)))
    net.request([patrol_request(number) for number in range(7)])
    net.run(1000)
    assert statuses(net) == [TaskStatus.DISPATCHED] * 7
    assert_each_once(net, 7)
    assert len(net.responses) == 7


def test_a_burst_loses_none_if_fleets_are_slower_than_the_time_window() -> None:
    """The window becomes eight times as long. If that is still too short, the task fails with the reason."""
    slow = PlayedFleet("slow", think_s=5)
    net = network(slow, settings=Settings(time_window_s=0.5))
    net.request([patrol_request(1)])
    net.run(1000)
    (state,) = net.dispatcher.states.finished
    assert state.status == TaskStatus.FAILED
    assert "no fleet has bid" in state.errors[-1]
    assert not slow.queue
    net = network(slow, settings=Settings(time_window_s=2))
    net.request([patrol_request(number) for number in range(7)])
    net.run(1000)
    assert statuses(net) == [TaskStatus.DISPATCHED] * 7


def test_a_task_that_all_fleets_refuse_fails_soon_with_their_reasons() -> None:
    net = network(PlayedFleet("f", declines={"patrol.dispatch-x1"}))
    net.request([patrol_request(1)])
    net.run(100)
    (state,) = net.dispatcher.states.finished
    assert state.status == TaskStatus.FAILED
    assert "declined" in state.errors


@looped("seed", range(60))
def test_a_burst_with_lost_repeated_and_late_messages_loses_none(seed: int) -> None:
    chance = Random(seed)
    fleets = [
        PlayedFleet(
            f"f{n}",
            lambda task: 1 + sum(task.encode()) % 7,
            think_s=chance.choice((0, 0.4)),
            knows_dry_runs=chance.random() < 0.8,
        )
        for n in range(chance.randint(1, 3))
    ]
    net = network(*fleets, seed=seed, loss=chance.choice((0, 0.1, 0.3)), repeat=chance.choice((0, 0.3)), late_s=1.5)
    for number in range(7):
        for _ in range(20):  # a user repeats a request that has no answer
            if f"request-{number}" not in net.responses:
                net.request([patrol_request(number)])
                net.run(2)
    net.run(5000)
    assert_each_once(net, 7)
    assert statuses(net) == [TaskStatus.DISPATCHED] * 7


@looped("seed", range(20))
def test_fleets_that_are_cut_off_keep_no_task(seed: int) -> None:
    chance = Random(seed)
    net = network(*(PlayedFleet(f"f{n}") for n in range(3)), seed=seed, loss=0.1, late_s=0.5)
    net.request([patrol_request(number) for number in range(7)])
    net.run(chance.uniform(0, 4))
    net.cut.add("f1")
    net.run(chance.uniform(0, 60))
    before = net.dispatcher.states
    net.cut.clear()
    net.run(3000)  # withdrawn awards arrive once the fleet is back
    assert_each_once(net, len(before.active) + len(before.finished))


@looped("seed", range(10))
def test_fleets_of_robochoc_among_others(seed: int) -> None:
    chance = Random(seed)
    net = network(
        BiddingFleet(carts("ours")),
        BiddingFleet(carts("theirs")),
        PlayedFleet("adapter", lambda _: 30.0),
        seed=seed,
        loss=chance.choice((0, 0.2)),
        repeat=0.2,
        late_s=0.5,
    )
    for number in range(7):
        for _ in range(20):
            if f"request-{number}" not in net.responses:
                net.request([patrol_request(number)])
                net.run(1)
    net.run(5000)
    assert_each_once(net, 7)
    assert statuses(net) == [TaskStatus.DISPATCHED] * 7


# What is allocated


def test_tasks_of_a_burst_are_allocated_together() -> None:
    """One by one, the first task would go to the near fleet, the second to the far one: 1 + 100 instead of 2 + 3."""
    costs = {"near": {"1": 1.0, "2": 3.0}, "far": {"1": 2.0, "2": 100.0}}
    fleets = [PlayedFleet(name, lambda task, own=own: own[task[-1]]) for name, own in costs.items()]  # type: ignore[misc]
    dispatcher = Dispatcher("", allocate)
    net = PlayedNetwork(dispatcher, {fleet.name: fleet for fleet in fleets}, Random(0))
    net.request([patrol_request(1), patrol_request(2)])
    net.run(100)
    chosen = {state.task_id[-1]: state.assignment.fleet_name for state in dispatcher.states.finished}
    assert chosen == {"1": "far", "2": "near"}


@looped("seed", range(20))
def test_the_allocation_is_as_large_and_cheap_as_possible(seed: int) -> None:
    chance = Random(seed)
    fleets = [f"f{n}" for n in range(chance.randint(1, 3))]
    costs = {f"t{n}": {fleet: chance.uniform(-5, 50) for fleet in fleets if chance.random() < 0.8} for n in range(4)}

    def all_of(tasks: list[str], free: frozenset[str]) -> list[tuple[int, float]]:
        if not tasks:
            return [(0, 0.0)]
        rest = all_of(tasks[1:], free)
        for fleet in free & costs[tasks[0]].keys():
            rest += [(n - 1, cost + costs[tasks[0]][fleet]) for n, cost in all_of(tasks[1:], free - {fleet})]
        return rest

    found = allocate(costs)
    assert len({*found.values()}) == len(found)
    cost = sum(costs[task][fleet] for task, fleet in found.items())
    best = min(all_of([*costs], frozenset(fleets)))
    assert -len(found) == best[0]
    assert cost == pytest.approx(best[1], abs=0.1)
    assert len(cheapest_first(costs)) >= len(found) / 2


def test_a_task_that_was_passed_over_often_comes_first() -> None:
    costs = {"old": {"f": 100.0}, "new": {"f": 1.0}}
    assert allocate(costs) == {"new": "f"}
    assert allocate(costs, {"old"}) == {"old": "f"}


# Single messages


def dispatcher() -> Dispatcher:
    return Dispatcher("x", lambda costs, _: cheapest_first(costs), Settings(gather_s=0))


def sent(one: Dispatcher, kind: type[Message]) -> list[Message]:
    return [message for message in one.drain() if isinstance(message, kind)]


def bid(task_id: str, fleet: str = "f", cost: float = 1.0) -> BidResponse:
    return BidResponse(task_id, has_proposal=True, proposal=BidProposal(fleet, "r", 0.0, cost))


def test_an_exchange_message_by_message() -> None:
    one = dispatcher()
    one.receive(patrol_request(1), 0)
    response, notice = one.drain()
    assert isinstance(response, ApiResponse)
    assert isinstance(notice, BidNotice)
    state = json.loads(response.json_msg)["state"]
    assert (state["booking"]["id"], state["status"]) == ("patrol.dispatch-x1", "queued")
    assert (notice.task_id, notice.time_window, notice.dry_run) == ("patrol.dispatch-x1", 2 * 10**9, False)
    assert json.loads(notice.request)["description"]["places"] == ["pantry", "coe"]
    one.receive(bid(notice.task_id), 0.1)
    (award,) = sent(one, DispatchCommand)
    assert isinstance(award, DispatchCommand)
    assert (award.fleet_name, award.task_id, award.type) == ("f", notice.task_id, 1)
    one.tick(1.2)
    assert award in one.drain()  # repeated
    one.receive(DispatchAck(award.dispatch_id, success=True), 1.3)
    (done,) = one.drain_finished()
    assert (done.status, done.assignment.expected_robot_name) == (TaskStatus.DISPATCHED, "r")
    one.tick(2)
    (states,) = sent(one, DispatchStates)
    assert states == DispatchStates((), (done,))


def test_a_repeated_request_is_one_task() -> None:
    one = dispatcher()
    one.receive(patrol_request(1), 0)
    first = sent(one, ApiResponse)
    one.receive(patrol_request(1), 1)
    assert sent(one, ApiResponse) == first
    assert len(one.states.active) == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"type": 1}',
        '{"type": "dispatch_task_request"}',
        "[" * 100_000,
        '{"type": "dispatch_task_request", "request": {"category": ""}}',
        '{"type": "dispatch_task_request", "request": {"category": "a\\u0000", "description": 1}}',
    ],
)
def test_invalid_requests_are_refused(text: str) -> None:
    one = dispatcher()
    one.receive(ApiRequest(text, "r"), 0)
    (response,) = one.drain()
    assert isinstance(response, ApiResponse)
    found = json.loads(response.json_msg)
    assert (found["success"], found["errors"][0]["code"]) == (False, 5)
    assert one.is_idle


def test_requests_that_others_answer() -> None:
    one = dispatcher()
    for text in ('{"type": "robot_task_request"}', '{"type": "cancel_task_request", "task_id": "other"}'):
        one.receive(ApiRequest(text, text), 0)
    assert not one.drain()


def test_a_task_is_cancelled_at_any_time() -> None:
    for moment in range(3):
        one = dispatcher()
        one.receive(patrol_request(1), 0)
        if moment:
            one.receive(bid("patrol.dispatch-x1"), 0.1)
        award = sent(one, DispatchCommand)
        cancel = ApiRequest('{"type": "cancel_task_request", "task_id": "patrol.dispatch-x1"}', "c")
        one.receive(cancel, 1)
        commands = sent(one, DispatchCommand)
        assert [(c.fleet_name, c.type) for c in commands if isinstance(c, DispatchCommand)] == [
            *([("f", 2)] if moment else []),
            (NOBODY, 2),
        ]
        if moment == 2:  # an acknowledgement on its way
            assert isinstance(award[0], DispatchCommand)
            one.receive(DispatchAck(award[0].dispatch_id, success=True), 1.1)
        (state,) = one.drain_finished()
        assert state.status == TaskStatus.CANCELED
        assert not one.states.active


def test_a_task_for_one_fleet_goes_to_no_other() -> None:
    one = dispatcher()
    one.receive(patrol_request(1, fleet_name="g"), 0)
    one.receive(bid("patrol.dispatch-x1", "f", 0.5), 0.1)
    assert not sent(one, DispatchCommand)
    one.receive(bid("patrol.dispatch-x1", "g", 9), 0.2)
    (award,) = sent(one, DispatchCommand)
    assert isinstance(award, DispatchCommand)
    assert award.fleet_name == "g"


def test_a_fleet_that_refuses_an_award_is_asked_again() -> None:
    one = dispatcher()
    one.receive(patrol_request(1), 0)
    one.receive(bid("patrol.dispatch-x1"), 0)
    (award,) = sent(one, DispatchCommand)
    assert isinstance(award, DispatchCommand)
    one.receive(DispatchAck(award.dispatch_id, success=False, errors=("why",)), 1)
    one.tick(5)
    assert sent(one, BidNotice)
    assert one.states.active[0].errors == ("why",)


@pytest.mark.parametrize("cost", [float("nan"), float("inf"), -float("inf")])
def test_bids_without_a_cost_do_not_count(cost: float) -> None:
    one = dispatcher()
    one.receive(patrol_request(1), 0)
    one.receive(bid("patrol.dispatch-x1", cost=cost), 0)
    one.tick(3)
    assert not [c for c in sent(one, DispatchCommand) if isinstance(c, DispatchCommand) and c.fleet_name != NOBODY]


def test_two_bidders_of_one_name_get_no_further_task() -> None:
    """The first task is at both. As soon as their bids differ, the dispatcher refuses both, and says why."""
    net = network(PlayedFleet("carts", lambda _: 1.0))
    twin = PlayedFleet("carts", lambda _: 2.0)
    net.fleets = {**net.fleets, "twin": twin}
    for number in range(3):
        net.request([patrol_request(number)])
        net.run(100)
    states = net.dispatcher.states.finished
    assert [TaskStatus(state.status).name for state in states] == ["DISPATCHED", "FAILED", "FAILED"]
    assert "two bidders have the fleet name carts" in states[1].errors[0]
    del net.fleets["twin"]
    net.run(CONFLICT_S)
    net.now_s += CONFLICT_S
    net.request([patrol_request(4)])
    net.run(100)
    assert net.dispatcher.states.finished[-1].status == TaskStatus.DISPATCHED


def test_long_errors_of_fleets_are_cut_off() -> None:
    one = dispatcher()
    one.receive(patrol_request(1), 0)
    one.receive(BidResponse("patrol.dispatch-x1", has_proposal=False, errors=("x" * 60_000,) * 90), 0)
    one.tick(5)
    assert sum(map(len, one.states.active[0].errors)) < 50_000


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subject, "ACTIVE_MAX", 5)
    monkeypatch.setattr(subject, "ANSWERS_MAX", 3)
    one = dispatcher()
    for number in range(9):
        one.receive(patrol_request(number), 0)
    assert len(one.states.active) == 5
    assert "are being dispatched" in sent(one, ApiResponse)[-1].json_msg  # type: ignore[union-attr]
