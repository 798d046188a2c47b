"""Runs of the application that are over, without any process: for what is made of them."""

from __future__ import annotations

from pathlib import Path

import msgspec

from robochoc.app.runs.options import JOURNAL, RESULT, RunOptions
from robochoc.app.runs.run import SKETCH, Record, Run, RunState
from robochoc.app.sketch import edits
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRule

STARTED = 1_700_000_000.0


def cube(robots: int = 3, name: str = "Cube", kind: DecisionKind = DecisionKind.LEVEL) -> Sketch:
    """Return robots that choose different values, and would all rather have the first one."""
    sketch = Sketch(name, Area(8, 4))
    for number in range(robots):
        sketch = edits.with_robot(sketch, Cell(number % 8, number // 8))
    sketch = edits.with_decision(sketch, Decision("level", kind, tuple(range(1, robots + 1))))
    sketch = edits.with_rule(sketch, SketchRule("", "different", "level"))
    return edits.with_rule(sketch, SketchRule("", "prefers", "level", settings={"value": 1}, cost=3))


def kept_run(folder: Path, sketch: Sketch, **differing: object) -> Run:
    """Return a run of `sketch` that is over, in its folder below `folder`; `differing` of its result."""
    place = folder / "runs" / "00001"
    place.mkdir(parents=True)
    assignment = {f"{robot.name}.level": number for number, robot in enumerate(sketch.robots, 1)}
    result: dict[str, object] = {
        "team": sketch.name,
        "verdict": "optimal",
        "protocol": "syncbb",
        "runtime": "simulator",
        "seed": 7,
        "assignment": assignment,
        "cost": 3 * (len(sketch.robots) - 1),
        "withdrawn": [],
        "epochs": [],
        "verified": True,
        "metrics": {
            "messages": 12,
            "bytes": 345,
            "ncccs": 67,
            "checks": 89,
            "wall_s": 0.5,
            "messages_by_type": {"CPA": 12},
            "compile_s": 0.0,
            "memory": 0,
            "simulated_s": 0.0,
            "largest": 40,
            "cycles": 0,
        },
        **differing,
    }
    (place / RESULT).write_bytes(msgspec.json.encode(result) + b"\n")
    (place / SKETCH).write_bytes(msgspec.json.encode(sketch))
    (place / JOURNAL).write_bytes(b"what was said")
    arguments = ["solve", "Cube", "--seed", "7"]
    record = Record(RunOptions(seed=7), arguments, state=RunState.ENDED, started=STARTED, ended=STARTED + 1)
    run = Run(place, record, sketch)
    run.save()
    run.read_result()
    return run
