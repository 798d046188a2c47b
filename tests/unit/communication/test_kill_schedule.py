"""Robots that are killed at set times: when, and what is said of those that were not."""

from __future__ import annotations

import time
from pathlib import Path
from random import Random

import pytest

from robochoc.communication.kill_schedule import Kill, KillSchedule
from robochoc.communication.master_loop import TICK_S, MasterLoop
from robochoc.communication.search_result import RobotsLostError
from robochoc.communication.search_state import SearchState
from robochoc.formats import read_team, write_team
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run.options import OnLoss, Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import team_of

TEAM = team_of({"A": (1, 2), "B": (1, 2)}, [])
AT_ONCE = (Kill("RA", 0),)
"""The master kills before it asks a second time whether all is quiet: no solution is found before."""


@pytest.fixture
def with_files(tmp_path: Path) -> Team:
    """The team, as it is read: a spare robot begins with its file."""
    write_team(TEAM, tmp_path / "team")
    return read_team(tmp_path / "team")


def test_each_is_due_once_after_the_search_began() -> None:
    schedule = KillSchedule([Kill("B", 2), Kill("A", 0.5)])
    assert (schedule.wait_s(7), schedule.due(7)) == (None, [])
    schedule.start(10)
    assert schedule.wait_s(10.25) == 0.25
    assert schedule.due(10.25) == []
    assert schedule.due(10.5) == ["A"]
    schedule.start(11)  # a later search
    assert schedule.wait_s(11) == 1
    assert schedule.due(20) == ["B"]
    assert schedule.wait_s(20) is None


def test_a_search_that_was_over_before_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    schedule = KillSchedule([Kill("A", 5)])
    schedule.start(10)
    schedule.end(10.3)
    schedule.warn_of_pending()
    assert caplog.messages == ["A was to be killed after 5 s; the search took 0.3 s"]


def test_nothing_is_reported_without_kills(caplog: pytest.LogCaptureFixture) -> None:
    KillSchedule().warn_of_pending()
    assert caplog.messages == []


def test_a_run_reports_it(caplog: pytest.LogCaptureFixture) -> None:
    assert solve(TEAM, Options(kill=(Kill("RA", 60),))).verdict is Verdict.SOLUTION
    (text,) = caplog.messages
    assert text.startswith("RA was to be killed after 60 s; the search took ")


def test_a_refused_run_has_one_reason(caplog: pytest.LogCaptureFixture) -> None:
    team = random_pkc_team(Random(2))
    with pytest.raises(UnsupportedError, match="such links are not reversed"):
        solve(team, Options(kill=(Kill(team.order[0], 60),), order=tuple(reversed(team.order))))
    assert caplog.messages == []


@looped(
    ("options", "why"),
    [
        (Options(kill=(Kill("RA", 1),), runtime=Runtime.SIMULATOR), "the simulator and arrays do not use processes"),
        (Options(kill=(Kill("RA", 1),), protocol="central"), "--kill is for robots .*not for --protocol central"),
        (Options(kill=(Kill("RZ", 1),)), "names a robot that .* does not have"),
    ],
)
def test_kills_that_cannot_be(options: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(TEAM, options)


def test_by_default_a_loss_ends_the_run() -> None:
    with pytest.raises(RobotsLostError, match=r"^RA was lost: its process was killed by SIGKILL$"):
        solve(TEAM, Options(kill=AT_ONCE))


@pytest.mark.parametrize("spares", [0, 1])
def test_the_others_continue_and_it_may_come_back(spares: int, with_files: Team) -> None:
    options = Options(protocol="dynabt", kill=AT_ONCE, on_loss=OnLoss.WITHDRAW, spares=spares)
    outcome = solve(with_files, options)
    assert outcome.verdict is Verdict.SOLUTION
    assert outcome.epochs[0].lost == ("RA",)
    assert [len(epoch.robots) for epoch in outcome.epochs] == [2, 1 + spares]


class _Waits(MasterLoop):
    """A master that notes how long it waits for messages, and ends after three waits."""

    def __init__(self) -> None:
        super().__init__()
        self.state = SearchState(0, ("R",))
        self.waits: list[float] = []

    def _serve(self, patience_s: float, deadline: float | None) -> None:  # noqa: ARG002 - it waits for nothing
        self.waits.append(patience_s)

    def _check_robots(self, now: float) -> None:
        """All robots are there."""

    def _order_start(self) -> None:
        """No robot is there to start."""

    def _send_all(self, message: object) -> None:
        """No robot is there to listen."""

    def wait(self) -> list[float]:
        self._serve_search(lambda: len(self.waits) == 3, None)
        return self.waits


def test_a_master_does_not_poll_because_of_a_kill_that_is_overdue_between_searches() -> None:
    """Found by `make simulate`: it used the processor until slow robots were ready for the next epoch."""
    master, killed = _Waits(), list[str]()
    kills = KillSchedule([Kill("R", 0.0)])
    kills.start(time.monotonic())
    master.schedule_kills(kills, killed.append)
    assert master.wait() == [TICK_S] * 3
    master.waits, master.state.searching = [], True
    assert master.wait()[0] == 0
    assert killed == ["R"]
