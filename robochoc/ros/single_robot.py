"""What one robot publishes on its own machine: it knows its own decision, and nothing of where others are."""

from __future__ import annotations

from robochoc.flight.crafts import crafts_of
from robochoc.flight.mission import Drone, Goal, Leg, MissionBuilder
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import Assignment, Robot

_ANSWERED = (Verdict.SOLUTION, Verdict.OPTIMAL)


def drones_of_robot(robot: Robot) -> tuple[Drone, ...]:
    """The drones of `robot`, before anything is decided."""
    return MissionBuilder([robot], {}).drones


def leg_of_robot(robot: Robot, why: str, assignment: Assignment, scale: float | None = None) -> Leg:
    """What the end of a run asks of the drones of `robot`, by the numbers of `drones_of_robot`.

    `why` is the master's word for how it ended (`optimal, 6 step aside`). A robot that stepped aside, and so has no
    `assignment`, lands where it stood, below its cell: that spot is its own, while one at the edge might be another's.
    A drone whose file says no cell stays where it is, as does everybody where nothing was found.
    """
    verdict, _, others = why.partition(",")
    if verdict not in _ANSWERED or not (assignment or "aside" in others):
        return Leg(why, Verdict.UNKNOWN, {})
    builder = MissionBuilder([robot], assignment, scale=scale)
    known = {craft.name for craft in crafts_of(robot, assignment) if craft.cell}
    if assignment:
        goals = builder.leg(EpochOutcome(Verdict(verdict), (robot.name,), assignment=dict(assignment))).goals
    else:
        goals = {number: Goal(drone.home, lands=True) for number, drone in enumerate(builder.drones)}
    return Leg(why, Verdict(verdict), {n: goal for n, goal in goals.items() if builder.drones[n].name in known})
