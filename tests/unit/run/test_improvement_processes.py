"""`--improve` in real time: every runtime publishes while it searches, and a robot that dies meanwhile."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.communication.search_result import RobotsLostError
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import OnLoss
from robochoc.verification.checker import assignment_cost
from tests.support.faults import own_children
from tests.support.improvements import FOUND, LONG, Told, Watcher, agreed, costly


@pytest.mark.slow
@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.SIMULATOR, Runtime.ARRAYS])
@pytest.mark.parametrize("protocol", ["dsa", "mgm", "bnb-adopt", "afb", "sfb"])
def test_every_runtime_publishes_while_it_searches(runtime: Runtime, protocol: str) -> None:
    local = protocol in {"dsa", "mgm"}
    if runtime is Runtime.ARRAYS and not local:
        return
    team = random_csp(8, 4, 0.6, 0.0, seed=3, max_cost=50)
    told = Told(news_at=1)
    options = Options(protocol=protocol, runtime=runtime, deadline=0.3, improve=600, settings=LONG if local else {})
    outcome = solve(team, options, audience=told)
    agreed(team, outcome, told)
    assert outcome.verdict in FOUND
    assert told.heard


def test_processes_publish_while_they_search() -> None:
    told = Told()
    options = Options(protocol="dsa", runtime=Runtime.PROCESSES, deadline=0.3, improve=600, settings=LONG)
    outcome = solve(costly(), options, audience=Watcher(told))
    agreed(costly(), outcome, told)
    assert outcome.improvements
    assert outcome.deadline == 0.3


class Killer(Told):
    """An audience that kills a robot's process once something is published, and is content with what the others find.

    Processes are named by their robots.
    """

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        super().improve(team, epoch, withdrawn)
        if len(self.heard) == 1:
            victim = next(
                pid for pid in own_children() if Path(f"/proc/{pid}/comm").read_text().strip() == team.order[2]
            )
            os.kill(victim, signal.SIGKILL)

    def has_news(self, team: Team) -> bool:
        return self.heard[-1][0] is team and len(team.robots) < len(self.heard[0][0].robots)


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_robot_that_dies_meanwhile_ends_the_run_or_leaves() -> None:
    """What was published stands; nothing is left (a fixture looks)."""
    team = costly(4)
    options = Options(protocol="dsa", runtime=Runtime.PROCESSES, deadline=0.3, improve=600, settings=LONG)
    with pytest.raises(RobotsLostError, match=f"{team.order[2]} was lost"):
        solve(team, options, audience=Killer())
    told = Killer()
    outcome = solve(team, replace(options, on_loss=OnLoss.WITHDRAW), audience=told)
    assert outcome.lost == (team.order[2],)
    assert team.order[2] not in told.heard[-1][0]
    assert outcome.cost == told.heard[-1][1].cost == assignment_cost(told.heard[-1][0], outcome.assignment)
    assert outcome.verdict is Verdict.SOLUTION
    assert [epoch.verdict for epoch in outcome.epochs] == [Verdict.UNKNOWN, Verdict.SOLUTION]
