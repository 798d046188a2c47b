"""RMF's dispatcher and two bidders of robochoc in every order of messages: each task exactly once, none lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import pytest

from robochoc.ros.rmf import bidder
from robochoc.ros.rmf.allocation import cheapest_first
from robochoc.ros.rmf.bidder import Bidder
from robochoc.ros.rmf.dispatcher import Dispatcher
from robochoc.ros.rmf.fleet_file import RmfFleet, RobotSpec
from robochoc.ros.rmf.messages import TaskStatus
from robochoc.ros.rmf.records import Settings
from tests.support.explored_rmf import Budget, State, ends_of
from tests.support.rmf_fleets import patrol_request

_SETTINGS = Settings(gather_s=1, time_window_s=2, repeat_s=1, expire_s=4, retry_s=1, tries=6, states_s=10**6)
_LIMIT_S = 60.0


def _allocate(costs: Mapping[str, Mapping[str, float]], _overdue: set[str]) -> dict[str, str]:
    return cheapest_first(costs)


def _start(tasks: int, budget: Budget) -> State:
    dispatcher = Dispatcher("x", _allocate, _SETTINGS)
    for number in range(tasks):
        dispatcher.receive(patrol_request(number), 0.0)
    places = {"pantry": (1000.0, 0.0), "coe": (0.0, 1.0)}
    fleets = [RmfFleet(name, {"r": RobotSpec((x, 0.0), 1.0)}, places) for name, x in (("a", 0.0), ("b", 10.0))]
    return State(dispatcher, {fleet.name: Bidder(fleet) for fleet in fleets}, {}, budget)


def _assert_each_once(end: State, tasks: int) -> None:
    """Each task is at the fleet that the dispatcher names, and nowhere else."""
    finished = end.dispatcher.states.finished
    assert [state.status for state in finished] == [TaskStatus.DISPATCHED] * tasks
    assigned = {state.task_id: state.assignment.fleet_name for state in finished}
    held = Counter((task, name) for name, one in end.bidders.items() for tasks in one.orders.values() for task in tasks)
    lost = {(task, name): count for (task, name), count in held.items() if name in end.dead and task not in assigned}
    assert held - Counter(lost) == Counter(assigned.items())


@pytest.mark.parametrize(
    ("tasks", "budget"),
    [
        (1, Budget()),
        (1, Budget(lost=2)),
        (1, Budget(repeated=1)),
        (1, Budget(late=1)),
        (1, Budget(dying=1)),
        pytest.param(2, Budget(), marks=pytest.mark.more),
        pytest.param(1, Budget(late=2), marks=pytest.mark.more),
        pytest.param(2, Budget(lost=1), marks=pytest.mark.slow),
        pytest.param(2, Budget(dying=1), marks=pytest.mark.slow),
        pytest.param(1, Budget(late=3), marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_each_task_is_dispatched_exactly_once(tasks: int, budget: Budget, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bidder, "PLANNED_MAX", 0)  # trips are appended, as in long queues
    ends = 0
    for end in ends_of(_start(tasks, budget), _LIMIT_S):
        _assert_each_once(end, tasks)
        ends += 1
    assert ends > 1
