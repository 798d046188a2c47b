"""A robot that computes when its epoch ends is late: what it asks for and tells is of an epoch that is over.

It asks for queues to robots that are gone by then, or that are started again.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.search_result import SearchResult
from robochoc.communication.search_watch import SearchWatch
from robochoc.communication.session import Epoch
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.team_edits import without_robots
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import ensure_compiled
from tests.support.limits import HANG_S, wait_until
from tests.support.paused_abt import CHAIN, Until

BEGUN, GO_ON = ".begun", ".on"
"""How the files are called, after `Until.file`, that say that a robot computes, and that it may go on."""


class LateABT(ABT):
    """The second robot computes until it may go on; then it tells its value to the third."""

    settings = Until()

    def start(self) -> None:
        if self.problem.agent == "RX1":
            Path(self.settings.file + BEGUN).touch()
            wait_until(Path(self.settings.file + GO_ON).exists, "nobody lets it go on")
        super().start()


class EndsThen(SearchWatch):
    """Ends the search once there is a file."""

    def __init__(self, file: Path) -> None:
        self._file = file

    @property
    def satisfied(self) -> bool:
        return self._file.exists()

    def wait_s(self, now: float) -> float:
        del now
        return 0.01

    def wants_snapshot(self, now: float) -> bool:
        del now
        return False

    def receive(self, snapshot: SearchResult) -> None:
        raise AssertionError(snapshot)


@pytest.mark.parametrize("restarted", [False, True])
def test_what_a_robot_asks_for_late_is_of_an_epoch_that_is_over(*, restarted: bool, tmp_path: Path) -> None:
    file = str(tmp_path / "robot")
    parameters = RunParameters(settings={"file": file})
    team = CHAIN if restarted else without_robots(CHAIN, ["RX2"])
    third = frozenset({"RX2"} if restarted else set[str]())
    epoch = Epoch(ensure_compiled(team), restarted=third, parameters=parameters)
    told: list[AnyEvent] = []
    with ProcessesRun(CHAIN, LateABT, survive=True, parameters=parameters, observer=told.append) as session:
        session.watch = EndsThen(Path(file + BEGUN))
        assert session.search(timeout=HANG_S).verdict is Verdict.UNKNOWN
        session.watch = None
        session.change(epoch)
        told.clear()
        Path(file + GO_ON).touch()
        result = session.search(timeout=HANG_S)
    assert result.lost == {}
    assert restarted or not [event for event in told if isinstance(event, Sent) and event.receiver == "RX2"]
    assert result.verdict is Verdict.SOLUTION
