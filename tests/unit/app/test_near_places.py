"""Who goes to which of these places: near ones are preferred, and one is forbidden."""

from __future__ import annotations

from itertools import permutations

from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.sketch import Area, Cell, Decision, Kind, Sketch, SketchRobot, SketchRule


def test_near_places_are_preferred_step_by_step() -> None:
    area = Area(7, 5)
    homes = {"A": Cell(0, 0), "B": Cell(6, 0), "C": Cell(3, 4)}
    free = [Cell(1, 1), Cell(5, 2), Cell(3, 3), Cell(6, 4)]
    forbidden = area.number(free[0])
    rules = [SketchRule("R1", "different", "place"), SketchRule("R2", "never", "place", ("A",), {"value": forbidden})]
    for name, home in homes.items():
        settings = {"value": area.number(home), "step": 2}
        rules.append(SketchRule(f"R{len(rules) + 1}", "rather", "place", (name,), {**settings}))
    values = tuple(area.number(cell) for cell in [*free, *homes.values()])
    robots = tuple(SketchRobot(name, cell) for name, cell in homes.items())
    never_home = tuple(
        SketchRule(f"H{number}", "never", "place", (), {"value": area.number(cell)})
        for number, cell in enumerate(homes.values())
    )
    sketch = Sketch("near", area, robots, (Decision("place", Kind.PLACE, values),), (*rules, *never_home))
    assert not [trouble for trouble in troubles(sketch) if trouble.is_error]
    best = min(
        sum(2 * (abs(cell.x - home.x) + abs(cell.y - home.y)) for cell, home in zip(some, homes.values(), strict=True))
        for some in permutations(free, 3)
        if area.number(some[0]) != forbidden
    )
    assert model_of(sketch).solve("syncbb", runtime="simulator").cost == best
