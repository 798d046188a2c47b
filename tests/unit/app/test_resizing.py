"""A map of another size: what names a cell still names the same one."""

from __future__ import annotations

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from robochoc.app.sketch.edits import with_area
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from tests.support.examples import examples
from tests.support.sketches import random_sketch

AREA = Area(4, 3, frozenset({Cell(0, 0), Cell(3, 2)}))
PLACE = Decision("place", DecisionKind.PLACE, tuple(AREA.number(cell) for cell in (Cell(1, 1), Cell(3, 0), Cell(0, 2))))
RULES = (
    SketchRule("R1", "never", "place", (), {"value": AREA.number(Cell(1, 1))}),
    SketchRule("R2", "never", "place", (), {"value": AREA.number(Cell(3, 0))}),
    SketchRule("R3", "only", "place", (), {"values": [AREA.number(Cell(1, 1)), AREA.number(Cell(3, 0))]}),
    SketchRule("R4", "table", "place", (), {"rows": [[5, 5], [5, 3]]}),
    SketchRule("R5", "apart", "place", (), {"gap": 5}),
    SketchRule("R6", "never", "level", (), {"value": 5}),
)
DECISIONS = (PLACE, Decision("level", DecisionKind.LEVEL, (5, 6)))
TEAM = Sketch("team", AREA, (SketchRobot("A", Cell(3, 2)),), DECISIONS, RULES)


def test_cells_stay_where_they_are() -> None:
    larger = with_area(TEAM, 7, 3)
    assert [larger.area.cell(int(value)) for value in larger.decisions[0].values] == [
        Cell(1, 1),
        Cell(3, 0),
        Cell(0, 2),
    ]
    assert larger.decisions[1] == TEAM.decisions[1]
    told = [rule.settings for rule in larger.rules]
    assert told == [
        {"value": 8},
        {"value": 3},
        {"values": [8, 3]},
        {"rows": [[8, 8], [8, 3]]},
        {"gap": 5},
        {"value": 5},
    ]


def test_what_is_gone_is_forgotten() -> None:
    smaller = with_area(TEAM, 2, 2)
    assert (smaller.robots[0].at, smaller.area.blocked) == (Cell(1, 1), frozenset({Cell(0, 0)}))
    assert smaller.decisions[0].values == (3,)
    told = [rule.settings for rule in smaller.rules]
    assert told == [{"value": 3}, {}, {"values": [3]}, {"rows": [[3, 3]]}, {"gap": 5}, {"value": 5}]


@given(st.integers(0, 10**9))
@examples(40)
def test_a_map_that_becomes_larger_and_small_again_is_the_same(seed: int) -> None:
    sketch = random_sketch(Random(seed))
    there = with_area(sketch, sketch.area.columns + 3, sketch.area.rows + 2)
    back = with_area(there, sketch.area.columns, sketch.area.rows)
    assert back == sketch
