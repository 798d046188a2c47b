"""Changes in a team during a mission: a robot fails, a cell is blocked, a battery is low, a robot joins.

Each change converts a sketch to another sketch, and has a sentence that describes the change.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from robochoc.app.sketch import edits
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRule
from robochoc.app.texts import say

LEAST_BATTERY = 20
"""A robot whose battery charge in per cent is lower leaves the team."""
FULL = 100


class TeamChange(msgspec.Struct, frozen=True, tag=True):
    """A change of a team."""

    def after(self, sketch: Sketch) -> Sketch:
        """Return the team after the change. Raises `EditError` if the change is impossible."""
        raise NotImplementedError

    def words(self, sketch: Sketch) -> str:
        """Return a sentence that describes the change in this team."""
        raise NotImplementedError


class RobotFails(TeamChange, frozen=True, tag="Fails"):
    """A robot fails and leaves the team."""

    robot: str

    def after(self, sketch: Sketch) -> Sketch:
        """Return the team without the robot."""
        _check_there(sketch, self.robot)
        return edits.without_robot(sketch, self.robot)

    def words(self, sketch: Sketch) -> str:
        """Return the sentence."""
        del sketch
        return say("whatif.fails", robot=self.robot)


class CellBlocked(TeamChange, frozen=True, tag="Blocked"):
    """A cell of the map is blocked, so robots can no longer choose it."""

    cell: Cell

    def after(self, sketch: Sketch) -> Sketch:
        """Block the cell, and remove it from decisions that list it. Raises `EditError` if no place would remain."""
        number = sketch.area.number(self.cell)
        sketch = edits.with_cell_blocked(sketch, self.cell, blocked=True)
        if any(one.kind == DecisionKind.PLACE and one.values == (number,) for one in sketch.decisions):
            raise EditError("whatif.last-place", "map")
        decisions = tuple(
            msgspec.structs.replace(one, values=tuple(value for value in one.values if value != number))
            if one.kind == DecisionKind.PLACE
            else one
            for one in sketch.decisions
        )
        return msgspec.structs.replace(sketch, decisions=decisions)

    def words(self, sketch: Sketch) -> str:
        """Return a sentence with the cell. If no robot decides a place, it says that the change has no effect."""
        matters = any(one.kind == DecisionKind.PLACE for one in sketch.decisions)
        key = "whatif.blocked" if matters else "whatif.blocked-in-vain"
        return say(key, column=self.cell.x + 1, row=self.cell.y + 1)


class LowBattery(TeamChange, frozen=True, tag="Battery"):
    """A robot's battery is low: the robot reaches only this percentage of the highest level, or leaves the team."""

    robot: str
    percent: int

    def after(self, sketch: Sketch) -> Sketch:
        """Return the team with only the levels that the robot still reaches, or without the robot."""
        _check_there(sketch, self.robot)
        if self.percent < LEAST_BATTERY:
            return edits.without_robot(sketch, self.robot)
        for decision in _levels(sketch, self.robot):
            reached = _reached(sketch, decision, self.percent)
            if len(reached) < len(sketch.values(decision)):
                if not reached:
                    return edits.without_robot(sketch, self.robot)
                rule = SketchRule("", "only", decision.name, (self.robot,), {"values": [*reached]})
                sketch = edits.with_rule(sketch, rule)
        return sketch

    def words(self, sketch: Sketch) -> str:
        """Return the effect of the low battery."""
        named = {"robot": self.robot, "percent": self.percent}
        levels = _levels(sketch, self.robot)
        reached = [_reached(sketch, decision, self.percent) for decision in levels]
        if self.percent < LEAST_BATTERY or not all(reached):
            return say("whatif.battery-leaves", **named)
        lost = [
            values[-1] for decision, values in zip(levels, reached, strict=True)
            if len(values) < len(sketch.values(decision))
        ]  # fmt: skip
        if not lost:
            return say("whatif.battery-enough" if levels else "whatif.battery-stays", **named)
        return say("whatif.battery-lower", **named, level=max(lost))


class RobotJoins(TeamChange, frozen=True, tag="Joins"):
    """A robot joins the team, with the decisions and rules that apply to all robots."""

    cell: Cell
    name: str | None = None

    def after(self, sketch: Sketch) -> Sketch:
        """Return the team with the new robot. If no decision applies to all robots, the new robot has every decision.

        Raises `EditError` if the cell is blocked.
        """
        if self.cell in sketch.area.blocked:
            raise EditError("whatif.blocked-cell", "map")
        sketch = edits.with_robot(sketch, self.cell, self.name)
        name = sketch.robots[-1].name
        if any(name in sketch.deciders(decision) for decision in sketch.decisions):
            return sketch
        decisions = tuple(
            msgspec.structs.replace(decision, robots=(*decision.robots, name)) for decision in sketch.decisions
        )
        return msgspec.structs.replace(sketch, decisions=decisions)

    def words(self, sketch: Sketch) -> str:
        """Return the robot's name and cell."""
        name = self.name or edits.with_robot(sketch, self.cell).robots[-1].name
        return say("whatif.joins", robot=name, column=self.cell.x + 1, row=self.cell.y + 1)


AnyTeamChange = RobotFails | CellBlocked | LowBattery | RobotJoins


def changed(sketch: Sketch, changes: Sequence[TeamChange]) -> Sketch:
    """Return the team after these changes in order. Raises `EditError` if a change is impossible."""
    for change in changes:
        sketch = change.after(sketch)
    return sketch


def sentences_of(sketch: Sketch, changes: Sequence[TeamChange]) -> list[str]:
    """Return the sentence for each change. Raises `EditError` if a change is impossible."""
    found = []
    for change in changes:
        found.append(change.words(sketch))
        sketch = change.after(sketch)
    return found


def _check_there(sketch: Sketch, robot: str) -> None:
    if sketch.robot(robot) is None:
        raise EditError("whatif.gone", robot, robot=robot)


def _levels(sketch: Sketch, robot: str) -> list[Decision]:
    """Return the robot's decisions on levels."""
    return [one for one in sketch.decisions if one.kind == DecisionKind.LEVEL and robot in sketch.deciders(one)]


def _reached(sketch: Sketch, decision: Decision, percent: int) -> list[int]:
    """Return the levels that are at most this percentage of the highest level."""
    levels = sorted(value for value in sketch.values(decision) if isinstance(value, int))
    return [level for level in levels if level * FULL <= levels[-1] * percent]
