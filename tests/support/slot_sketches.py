"""Sketches for tests of the application."""

from __future__ import annotations

from robochoc.app.sketch import edits
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRule


def slots(robots: int, slots: int, *, little: bool = True, name: str = "Berths") -> Sketch:
    """Return a team whose robots choose different slots, low ones rather (`little`)."""
    sketch = Sketch(name=name)
    for number in range(robots):
        sketch = edits.with_robot(sketch, Cell(number % 8, number // 8))
    sketch = edits.with_decision(sketch, Decision("slot", DecisionKind.SLOT, tuple(range(1, slots + 1))))
    sketch = edits.with_rule(sketch, SketchRule("", "different", "slot"))
    if little:
        sketch = edits.with_rule(sketch, SketchRule("", "little", "slot", settings={"step": 1}))
    return sketch
