"""An answer in words, as a table and as a picture; hostile names in them; what rules cost."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import cast
from xml.etree import ElementTree as ET

import msgspec
import pytest

from robochoc.app.pages.decide.answer import headline, table_html
from robochoc.app.pages.decide.picture import falling_svg, team_svg, values_of
from robochoc.app.runs.fitting import fitting
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.paid import paid
from robochoc.app.runs.result import RunResult, decoded
from robochoc.app.runs.run import Record, Run, State
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Cell, Decision, Kind, Sketch, SketchRobot, Value
from tests.support.rule_teams import random_rules
from tests.support.slot_sketches import slots

HOSTILE = "<img src=x onerror=alert(1)>\"'&{x}"


def _run(result: RunResult | None, state: State = State.ENDED, message: str = "", robots: int = 3) -> Run:
    run = Run(Path("00001"), Record(RunOptions(), state=state, message=message), slots(robots, 3))
    run.result = result
    return run


@pytest.mark.parametrize(
    ("run", "words"),
    [
        (_run(RunResult("optimal", assignment={"a": 1}, cost=5)), "All 3 decide. It costs 5: proven the best."),
        (_run(RunResult("solution", assignment={"a": 1})), "All 3 decide."),
        (_run(RunResult("solution", assignment={"a": 1}, cost=2), robots=1), "The robot decides. It costs 2."),
        (
            _run(RunResult("unknown", assignment={"a": 1}, cost=9, bound=4), State.STOPPED),
            "All 3 decide. It was stopped; this is the best so far. It costs 9. Nothing costs less than 4.",
        ),
        (
            _run(RunResult("unknown", assignment={"a": 1}, cost=9)),
            "All 3 decide. A limit was reached; this is the best so far. It costs 9.",
        ),
        (_run(RunResult("no-solution")), "There is no solution: the rules cannot all hold."),
        (
            _run(RunResult("optimal", assignment={"a": 1}, withdrawn=("Drone1",), cost=1)),
            "2 of 3 decide. These step aside, and it is proven that it cannot be fewer, by their weights: Drone1.",
        ),
        (_run(None, State.FAILED, "no such thing"), "It could not be decided: no such thing"),
        (_run(None, State.FAILED, "lost"), "The application ended during this run, and the run with it. Decide again."),
        (
            _run(None, State.STOPPED),
            "It ended before anything was found. Give it more time, or choose another protocol.",
        ),
    ],
)
def test_that_the_answer_is_told_in_words(run: Run, words: str) -> None:
    assert headline(run) == words


def test_that_hostile_names_are_text() -> None:
    sketch = Sketch(
        HOSTILE, robots=(SketchRobot(HOSTILE, Cell(0, 0)),), decisions=(Decision(HOSTILE, Kind.TASK, (HOSTILE,)),)
    )
    result = RunResult("solution", assignment={f"{HOSTILE}.{HOSTILE}": HOSTILE})
    says = values_of(sketch, result.assignment)
    assert says == {HOSTILE: HOSTILE}
    for made in (table_html(sketch, result), team_svg(sketch, says), team_svg(sketch, {}, aside=frozenset({HOSTILE}))):
        assert "<img" not in made
        tree = ET.fromstring(made)  # noqa: S314 - our own
        assert not [one for one in tree.iter() if one.tag.endswith(("img", "script"))]
    assert HOSTILE in "".join(ET.fromstring(table_html(sketch, result)).itertext())  # noqa: S314 - our own


def test_that_a_place_is_short_in_the_picture_and_said_in_the_table() -> None:
    sketch = Sketch(robots=(SketchRobot("A", Cell(0, 0)),), decisions=(Decision("spot", Kind.PLACE),))
    result = RunResult("solution", assignment={"A.spot": 17})
    assert values_of(sketch, result.assignment) == {"A": "(2, 3)"}
    assert "column 2, row 3" in table_html(sketch, result)


def test_that_the_picture_shows_who_speaks_and_what_is_not_settled() -> None:
    sketch = slots(3, 3)
    made = team_svg(
        sketch, {"Drone1": "2"}, unsettled=frozenset({"Drone1"}), spoken={("Drone1", "Drone2"): 9, ("Drone1", "x"): 1}
    )
    assert made.count('class="said"') == 1
    assert made.count('class="unsettled"') == 3
    assert team_svg(sketch, {"Drone1": "2"}).count('class="settled"') == 1


def test_that_a_falling_cost_is_a_line() -> None:
    assert falling_svg([(0.0, 5.0)]) == ""
    assert "from 9 to 4" in falling_svg([(0.0, 9.0), (1.0, 6.0), (2.0, 4.0)])


def test_that_what_rules_cost_is_the_cost_of_the_answer() -> None:
    seen = 0
    for seed in range(40):
        sketch = random_rules(Random(seed))
        soft = [msgspec.structs.replace(rule, cost=rule.cost or 7, private=False) for rule in sketch.rules]
        sketch = msgspec.structs.replace(sketch, rules=tuple(soft))
        solution = model_of(sketch).solve("syncbb", runtime="simulator")
        if solution.cost is None:
            continue
        values: dict[str, Value] = {f"{name}.d": cast("Value", solution[f"{name}.d"]) for name in ("A", "B", "C")}
        costs = [*paid(sketch, values).values()]
        assert sum(costs) == solution.cost, seed
        seen += solution.cost > 0
    assert seen > 5


def test_that_only_protocols_that_fit_are_offered() -> None:
    with_costs, without = fitting(slots(3, 3)), fitting(slots(3, 3, little=False))
    assert "abt" in dict(without.protocols)
    assert "abt" not in dict(with_costs.protocols)
    assert with_costs.chosen in dict(with_costs.protocols)
    assert with_costs.why


@pytest.mark.parametrize("content", [b"", b"{", b'{"verdict":"optimal"}', b"nonsense\n", b"[]\n", b"\xff\n"])
def test_that_half_a_result_is_none(content: bytes) -> None:
    assert decoded(content) is None
