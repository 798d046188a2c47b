"""Standby masters on this machine: `solve --runtime network --standby N`."""

from __future__ import annotations

import logging
from dataclasses import replace

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.communication.search_result import RobotsLostError
from robochoc.journal.events import AnyEvent
from robochoc.model.outcome import Verdict
from robochoc.run.networked.local_standbys import NoDecisionError
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.solver.errors import UnsupportedError
from tests.support.deployments import CROWD, TRIANGLE
from tests.support.problems import team_of

LONG = {"cycles": "1000000"}


def options(*kills: Kill, standby: int = 1, **given: object) -> Options:
    return Options(runtime=Runtime.NETWORK, standby=standby, kill=kills, **given)  # type: ignore[arg-type]


def test_the_first_master_decides_if_nobody_dies(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "robochoc"):
        outcome = solve(TRIANGLE, options(protocol="abt"))
    assert (outcome.verdict, outcome.led_by, outcome.term) == (Verdict.NO_SOLUTION, "MASTER", 1)
    assert "MASTER leads in term 1" in caplog.text


@pytest.mark.more
def test_a_standby_master_takes_over(caplog: pytest.LogCaptureFixture) -> None:
    endless = options(Kill("MASTER", 0.0), protocol="dsa", settings=LONG, deadline=3)
    with caplog.at_level(logging.WARNING, "robochoc"):
        outcome = solve(CROWD, endless)
    assert (outcome.led_by, outcome.term) == ("STANDBY1", 2)
    assert "MASTER is killed" in caplog.text


@pytest.mark.more
def test_all_masters_die() -> None:
    endless = options(Kill("MASTER", 0.0), Kill("STANDBY1", 0.0), protocol="dsa", settings=LONG)
    with pytest.raises(NoDecisionError, match="all masters have ended") as ended:
        solve(TRIANGLE, endless)
    assert isinstance(ended.value, RobotsLostError)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (options(standby=10), "at most 9"),
        (options(start={"A": 1}), "--start"),
        (options(deadline=1, improve=1), "--improve"),
        (options(Kill("STANDBY2", 0.0)), "does not have: STANDBY2"),
        (Options(standby=1), "add --runtime network"),
    ],
)
def test_options_that_cannot_be_combined(wrong: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(TRIANGLE, wrong)


def test_a_robot_with_the_name_of_a_master() -> None:
    alone = team_of({"A": range(1, 3)}, [])
    named = replace(alone, robots=(replace(alone.robots[0], name="STANDBY1"),))
    with pytest.raises(UnsupportedError, match="rename the robot"):
        solve(named, options())


def test_masters_have_no_journal() -> None:
    seen: list[AnyEvent] = []
    with pytest.raises(UnsupportedError, match="--standby cannot be used with a journal or an observer"):
        solve(TRIANGLE, options(), observer=seen.append)
