"""Standby masters on this machine: `solve --runtime network --standby N`."""

from __future__ import annotations

import logging
import threading
from dataclasses import fields, replace
from pathlib import Path

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.communication.search_result import RobotsLostError
from robochoc.communication.simulator.channel import CHANNELS
from robochoc.journal.events import AnyEvent
from robochoc.model.outcome import Verdict
from robochoc.model.policies import Risk
from robochoc.protocols.traits import Traits
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.team_rules import refuse_unfit
from robochoc.run.distributed import STOPPED
from robochoc.run.networked.local_standbys import NoDecisionError, plan_fields
from robochoc.run.networked.master_run import MasterPlan
from robochoc.run.options import AnswerRule, OnLoss, Options, Preprocess, Runtime, ScheduleName, Withdrawal
from robochoc.run.orchestrator import solve
from robochoc.solver.compile import CompileLimits
from robochoc.solver.errors import UnsupportedError
from robochoc.system.stopping import stopped_by
from tests.support.deployments import CROWD, TRIANGLE
from tests.support.problems import team_of

LONG = {"cycles": "1000000"}
GIVEN: dict[str, object] = {
    "protocol": "sfb",
    "runtime": Runtime.NETWORK,
    "seed": 3,
    "timeout": 5.0,
    "deadline": 5.0,
    "improve": 1.0,
    "answer": AnswerRule.FINAL,
    "repair": False,
    "withdraw": Withdrawal.MINIMUM,
    "schedule": ScheduleName.RANDOM,
    "delay": 3,
    "local": CompileLimits(solutions=10),
    "cache": False,
    "count": True,
    "central_with": "ace",
    "verify": True,
    "order": ("C", "B", "A"),
    "messages": 100,
    "ncccs": 100,
    "cycles": 100,
    "on_loss": OnLoss.WITHDRAW,
    "spares": 1,
    "patience": 3.0,
    "channel": next(iter(CHANNELS.values())),
    "message_loss": 0.1,
    "settings": {"cycles": "3"},
    "filters": ("signed",),
    "kill": (Kill("A", 1.0),),
    "standby": 2,
    "chosen": {"protocol": "why"},
    "bounds": True,
    "preprocess": Preprocess.AC,
    "cluster": "tcp://127.0.0.1:1",
    "start": {"A": 1},
    "cold": True,
    "stages": (),
    "risk": Risk.WORST,
    "samples": 100,
    "objectives": "pareto",
    "refine": 0.1,
}
"""A value of each option that differs from the default, where there is one."""
USED_BY_THE_PARENT = {"local", "cache", "order", "kill", "standby", "chosen", "risk", "samples", "objectives", "refine"}
WITHOUT_EFFECT = {"cold", "stages"}
"""Options for teams with a scenario and for stages, which do not exist on a network."""


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
    with pytest.raises(NoDecisionError, match=r"ended: MASTER: .* signal 9; STANDBY1: .* signal 9") as ended:
        solve(TRIANGLE, endless)
    assert isinstance(ended.value, RobotsLostError)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (options(standby=10), "at most 9"),
        (options(start={"A": 1}), "--start"),
        (options(deadline=1, improve=1), "--improve"),
        (options(verify=True), "--verify"),
        (options(Kill("STANDBY2", 0.0)), "does not have: STANDBY2"),
        (Options(standby=1), "add --runtime network"),
        (Options(kill=(Kill("MASTER", 0.1),)), "add --runtime network --standby N"),
    ],
)
def test_options_that_cannot_be_combined(wrong: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(TRIANGLE, wrong)


def is_refused(given: Options) -> bool:
    try:
        refuse_options(given)
        refuse_unfit(TRIANGLE, given, Traits(costs=True, counts=True))
    except UnsupportedError:
        return True
    return False


def test_masters_receive_every_option_that_is_not_refused() -> None:
    assert GIVEN.keys() == {one.name for one in fields(Options)}
    for name, value in GIVEN.items():
        deadline = {"deadline": 5.0} if name == "improve" else {}
        given = replace(options(), **({name: value} | deadline))  # type: ignore[arg-type]
        if name in USED_BY_THE_PARENT | WITHOUT_EFFECT or is_refused(given):
            continue
        common = plan_fields(TRIANGLE, given)
        assert getattr(MasterPlan(Path(), **common).options(common["protocol"]), name) == value, name


def test_a_local_search_is_repaired_by_another_protocol() -> None:
    short = options(protocol="dsa", settings={"cycles": "1"})
    repaired = solve(CROWD, short)
    assert (repaired.verdict, repaired.repair) == (Verdict.UNKNOWN, "gdba")
    assert solve(CROWD, replace(short, repair=False)).repair is None
    assert solve(CROWD, replace(short, answer=AnswerRule.FINAL)).repair is None


@pytest.mark.parametrize(("rule", "placed_by"), [("minimum", "sfb"), ("maximal", "first-fit")])
def test_another_protocol_decides_which_robots_withdraw(rule: str, placed_by: str) -> None:
    outcome = solve(TRIANGLE, options(protocol="abt", withdraw=rule))
    assert (outcome.placed_by, len(outcome.withdrawn)) == (placed_by, 1)


def test_a_stop_request_ends_the_search_of_the_leading_master() -> None:
    event = threading.Event()
    event.set()
    with stopped_by(event):
        outcome = solve(CROWD, options(protocol="dsa", settings=LONG))
    assert outcome.verdict == Verdict.UNKNOWN
    assert str(outcome.reason).startswith(STOPPED)


def test_a_robot_with_the_name_of_a_master() -> None:
    alone = team_of({"A": range(1, 3)}, [])
    named = replace(alone, robots=(replace(alone.robots[0], name="STANDBY1"),))
    with pytest.raises(UnsupportedError, match="rename the robot"):
        solve(named, options())


def test_masters_have_no_journal() -> None:
    seen: list[AnyEvent] = []
    with pytest.raises(UnsupportedError, match="--standby cannot be used with a journal or an observer"):
        solve(TRIANGLE, options(), observer=seen.append)
