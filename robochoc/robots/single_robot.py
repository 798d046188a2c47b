"""The decision of one robot on its own machine, without the places of others."""

from __future__ import annotations

from robochoc.flight.crafts import crafts_of
from robochoc.flight.mission import Drone, Goal, Leg, MissionBuilder
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import Assignment, Robot

_ANSWERED = (Verdict.SOLUTION, Verdict.OPTIMAL)
_WITHDRAWN = "withdr"
"""Part of the master's word that says that robots have withdrawn."""


def drones_of_robot(robot: Robot) -> tuple[Drone, ...]:
    """Return the drones of `robot`, before anything is decided."""
    return MissionBuilder([robot], {}).drones


def leg_of_robot(robot: Robot, why: str, assignment: Assignment, scale: float | None = None) -> Leg:
    """Return the goals of the drones of `robot` at the end of a run, by their numbers in `drones_of_robot`.

    A robot that has withdrawn lands where it stood, below its cell: that point is its own, while one at the edge might
    be another's. A drone without a cell in its file stays where it is; all drones do so if there is no solution.

    Args:
        robot: The robot.
        why: The master's word for how the run ended: `optimal, 6 withdraw`.
        assignment: The robot's decision; empty if it has withdrawn.
        scale: Metres a unit.
    """
    verdict, _, others = why.partition(",")
    if verdict not in _ANSWERED or not (assignment or _WITHDRAWN in others):
        return Leg(why, Verdict.UNKNOWN, {})
    builder = MissionBuilder([robot], assignment, scale=scale)
    known = {craft.name for craft in crafts_of(robot, assignment) if craft.cell}
    if assignment:
        goals = builder.leg(EpochOutcome(Verdict(verdict), robots=(robot.name,), assignment=dict(assignment))).goals
    else:
        goals = {number: Goal(drone.home, lands=True) for number, drone in enumerate(builder.drones)}
    return Leg(why, Verdict(verdict), {n: goal for n, goal in goals.items() if builder.drones[n].name in known})
