"""What there is to see of an outcome, as data: the drones, where each begins and ends, and the box around them.

Lengths are in cells: one cell is one row, one column or one level. Nothing here draws; `stage` does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from robochoc.outcome import Outcome, Verdict
from robochoc.problem import Team
from robochoc.ros.crew import Craft, crew_of
from robochoc.ros.layout import Axis, Field, Point, field_of


@dataclass(frozen=True)
class Drone:
    """Begins at `home`, on the ground. It flies to its `place`, or steps `aside`, or (neither) stays at home."""

    name: str
    group: int
    """Its row: drones of a row look alike."""
    home: Point
    place: Point | None = None
    aside: Point | None = None


@dataclass(frozen=True)
class Scene:
    """One run, ready to be drawn. `facts` is the caption: pairs of a label and what it says, in plain text."""

    title: str
    facts: tuple[tuple[str, str], ...]
    drones: tuple[Drone, ...]
    axes: tuple[Axis, Axis, Axis]

    @property
    def ground(self) -> float:
        """The height on which drones stand: one level below the lowest place."""
        return self.axes[2].ground


def scene_of(outcome: Outcome, team: Team | None = None) -> Scene:
    """The scene of `outcome`. With its `team` also robots that stay behind are shown, and topics say where to fly.

    Never raises for want of a place: a robot whose coordinates are missing or undefined is placed by the two
    numbers its name ends in (row and column), and failing that in a tidy grid, at the height of its first value.
    """
    crew = crew_of(outcome, team)
    field = field_of(crew)
    drones = tuple(_drones(crew, field))
    flying = sum(drone.place is not None for drone in drones)
    aside = len(drones) - flying  # drones, as a robot may fly several
    title = f"{outcome.team}: {_ending(outcome, flying, aside)}"
    return Scene(title, _facts(outcome, flying, aside), drones, field.axes)


def _drones(crew: Sequence[Craft], field: Field) -> Iterator[Drone]:
    spots = field.edge(sum(craft.withdrew for craft in crew))
    for craft, home, place in zip(crew, field.homes, field.places(crew), strict=True):
        aside = next(spots) if craft.withdrew and place is None else None
        yield Drone(craft.name, craft.cell[0] if craft.cell else round(home[0]), home, place, aside)


def _ending(outcome: Outcome, flying: int, aside: int) -> str:
    if outcome.aside and flying:
        others = "no better team could" if outcome.verdict is Verdict.OPTIMAL else f"{aside} withdrew"
        return f"{flying} fly, {others}"
    left = " for those that are left" if outcome.lost else ""
    match outcome.verdict:
        case Verdict.SOLUTION:
            return f"a solution{left}"
        case Verdict.OPTIMAL:
            return "an optimal solution"
        case Verdict.NO_SOLUTION:
            return f"no solution{left}, everybody stays on the ground"
        case Verdict.UNKNOWN:
            return "a limit was reached without a verdict"


def _facts(outcome: Outcome, flying: int, aside: int) -> tuple[tuple[str, str], ...]:
    checked = ", checked" if outcome.verified else ""
    verdict = f"{outcome.verdict}{checked}"
    if outcome.aside:
        verdict = f"no solution for all {flying + aside}; {flying} placed{checked}"
    facts = [("verdict", verdict), ("protocol", outcome.protocols)]
    if outcome.lost:
        facts.append(("lost", ", ".join(outcome.lost)))
    if outcome.cost:
        facts.append(("cost", f"{outcome.cost:,g}"))
    facts.append(("messages", f"{sum(outcome.metrics.messages.values()):,}"))
    return tuple(facts)
