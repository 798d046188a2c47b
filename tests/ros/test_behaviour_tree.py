"""The behaviour of docs/ros2 in a tree of py_trees: it succeeds, fails, and cancels what is not wanted any more."""

from __future__ import annotations

import runpy
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import pytest

from robochoc.generators.queens3d import queens3d
from robochoc.robots.decision import CancellableDecision
from robochoc.ros.decide_service import DecideService
from robochoc.run import Options, Runtime, solve
from tests.support.example_teams import hangar
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT

py_trees = pytest.importorskip("py_trees", reason="no py_trees here: pip install py-trees")
FILE = ROOT / "docs" / "ros2" / "robochoc_ros" / "robochoc_ros" / "behaviour.py"
SIMULATED = Options(runtime=Runtime.SIMULATOR, timeout=HANG_S)
ENDLESS = Options(protocol="dsa", runtime=Runtime.SIMULATOR, timeout=HANG_S, settings={"cycles": "1000000000"})


class Client:
    """What a client of ROS does: it asks in the background."""

    def __init__(self, service: DecideService, pool: ThreadPoolExecutor) -> None:
        self._service, self._pool = service, pool

    def call_async(self, request: dict[str, Any]) -> Future[SimpleNamespace]:
        return self._pool.submit(lambda: SimpleNamespace(**self._service.decide(request)))


@pytest.fixture
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(1) as pool:
        yield pool
    py_trees.blackboard.Blackboard.clear()


def behaviour(client: Client, request: dict[str, Any], cancel: Any = None) -> Any:  # noqa: ANN401 - py_trees is untyped
    return runpy.run_path(str(FILE))["Decide"]("decide", client.call_async, request, cancel)


def ticked(tree: Any) -> None:  # noqa: ANN401 - py_trees is untyped
    """Tick until it is over, as a node does that spins meanwhile."""
    tree.tick_once()
    wait_until(tree.answer.done, "nothing was decided")
    if tree.status.value == "RUNNING":
        tree.tick_once()


def test_the_assignment_is_on_the_blackboard(pool: ThreadPoolExecutor) -> None:
    tree = behaviour(Client(DecideService([hangar()], CancellableDecision(), SIMULATED), pool), {"team": "hangar"})
    ticked(tree)
    assert (tree.status.value, tree.feedback_message) == ("SUCCESS", "solution, 1 epoch")
    assert tree.board.get("assignment") == solve(hangar(), SIMULATED).assignment


def test_a_refusal_is_a_failure(pool: ThreadPoolExecutor) -> None:
    tree = behaviour(Client(DecideService([hangar()], CancellableDecision(), SIMULATED), pool), {"team": "yard"})
    ticked(tree)
    assert tree.status.value == "FAILURE"
    assert tree.feedback_message == "unknown team 'yard'; known teams: hangar"


def test_what_is_not_wanted_any_more_is_cancelled(pool: ThreadPoolExecutor) -> None:
    begun = threading.Event()
    decision = CancellableDecision(lambda _: begun.set())
    client = Client(DecideService([queens3d(4)], decision, ENDLESS), pool)
    tree = behaviour(client, {}, lambda: decision.cancel({}))
    tree.tick_once()
    assert tree.status.value == "RUNNING"
    assert begun.wait(HANG_S)
    tree.stop(py_trees.common.Status.INVALID)
    assert tree.answer.result(HANG_S).message.startswith("unknown, 1 epoch: somebody has asked to stop")
