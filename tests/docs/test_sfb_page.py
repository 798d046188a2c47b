"""How much SFB gives away, as docs/explanation/sfb.md says it."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.families import FAMILIES
from robochoc.journal.events import Sent
from robochoc.model.problem import Team
from robochoc.protocols.optimization.sfb import SFB
from robochoc.protocols.optimization.sfb_bounds import VALUES
from robochoc.protocols.order import PriorityOrder
from tests.support.program import ROOT

PAGE = ROOT / "docs" / "explanation" / "sfb.md"
DOMAIN = 4
_TYPES = {1: "<u1", 2: "<u2", 4: "<u4", 8: "<i8"}


class Listener:
    """The partial assignments that each robot receives, by its rank; all domains are of one size."""

    def __init__(self, problem: Team) -> None:
        self.names = PriorityOrder(problem.order).names
        self.heard: list[set[tuple[int, ...]]] = [set() for _ in self.names]

    def __call__(self, event: object) -> None:
        if isinstance(event, Sent) and event.type == "CPAs":
            rank, said = self.names.index(event.receiver), event.content
            columns = VALUES + rank + (len(self.names) - rank) * DOMAIN
            kind = _TYPES[len(said["rows"]) // (said["count"] * columns)]
            rows = np.frombuffer(said["rows"], kind).reshape(said["count"], columns)
            self.heard[rank] |= {tuple(row) for row in rows[:, VALUES : VALUES + rank].tolist()}

    def known(self, rank: int) -> NDArray[np.float64]:
        """What the robot can tell of the rows of tables of higher robots with lower ones.

        It knows, for each partial assignment, the sum of one row of each higher robot's table. So it can tell those
        sums of rows that lie in the space of these: this is the projection on it, by robot and value.
        """
        chosen = np.zeros((len(self.heard[rank]), rank * DOMAIN))
        for row, places in zip(chosen, sorted(self.heard[rank]), strict=True):
            row[[robot * DOMAIN + place for robot, place in enumerate(places)]] = 1
        found: NDArray[np.float64] = np.linalg.pinv(chosen) @ chosen
        return found


def revealed(problem: Team) -> tuple[int, int, int]:
    """How many rows of tables there are, how many robots can tell, and how many they can tell up to a constant.

    A row counts once for each robot that has no part in its constraint. Up to a constant: the robot can tell the
    difference to another row of the same table.
    """
    listener = Listener(problem)
    Simulation(problem, SFB, Concurrent(seed=0), observer=listener).run()
    rank = {variable.name: listener.names.index(robot.name) for robot in problem.robots for variable in robot.variables}
    total = exact = relative = 0
    for constraint in problem.constraints():
        higher, lower = sorted(rank[name] for name in constraint.variables)
        for robot in range(len(listener.names)):
            total += DOMAIN * (robot not in {higher, lower})
            if higher < robot < lower and listener.heard[robot]:
                space = listener.known(robot)
                units = np.eye(len(space))[higher * DOMAIN : (higher + 1) * DOMAIN]
                exact += sum(_within(space, unit) for unit in units)
                relative += sum(any(_within(space, one - two) for two in units) for one in units)
    return total, exact, relative


def _within(space: NDArray[np.float64], wanted: NDArray[np.float64]) -> bool:
    return bool(np.any(wanted)) and bool(np.allclose(space @ wanted, wanted, atol=1e-6))


@pytest.mark.slow
@pytest.mark.parametrize(("agents", "density", "place"), [(10, 0.3, 0), (8, 0.7, 1)])
def test_the_page_says_what_robots_can_tell_of_others_tables(agents: int, density: float, place: int) -> None:
    """On the problems of the study sfb-families."""
    found = np.zeros(3)
    for seed in range(1, 11):
        parameters = {"domain": DOMAIN, "density": density, "max_cost": 100, "connected": True}
        found += revealed(FAMILIES["random"](agents=agents, seed=seed, **parameters))
    said = re.findall(r"(\d+) % of the rows exactly, and (\d+) % up to a constant", PAGE.read_text())
    assert [f"{share:.0%}" for share in found[1:] / found[0]] == [f"{number}%" for number in said[place]]
