"""An answer in words, as a table and as a picture; hostile names in them; what rules cost."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from random import Random
from typing import cast
from xml.etree import ElementTree as ET

import msgspec

from robochoc.app.pages.decide.answer import headline, table_html
from robochoc.app.pages.decide.no_solution_panel import hints_about_rules
from robochoc.app.pages.decide.picture import UNIT, TargetCell, falling_svg, shown_part, targets_of, team_svg, values_of
from robochoc.app.runs.fitting import fitting
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.prepared_team import value_of
from robochoc.app.runs.result import RunResult, decoded
from robochoc.app.runs.rule_costs import rule_costs
from robochoc.app.runs.run import Record, Run, RunState
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.edits import with_importance
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, Value
from robochoc.model.outcome import Verdict
from robochoc.verification.checker import assignment_cost
from tests.support.cases import looped
from tests.support.rule_teams import random_rules
from tests.support.run_results import run_result
from tests.support.sketches import random_sketch
from tests.support.slot_sketches import slots

HOSTILE = "<img src=x onerror=alert(1)>\"'&{x}"


def _run(
    result: RunResult | None,
    state: RunState = RunState.ENDED,
    message: str = "",
    robots: int = 3,
    *,
    withdraw: bool = False,
    costs: bool = True,
) -> Run:
    record = Record(RunOptions(withdraw=withdraw), state=state, message=message)
    run = Run(Path("00001"), record, slots(robots, 3, little=costs))
    run.result = result
    return run


@looped(
    ("run", "words"),
    [
        (_run(run_result(Verdict.OPTIMAL, {"a": 1}, cost=5)), "All 3 decide. It costs 5: proven the best."),
        (_run(run_result(Verdict.SOLUTION, {"a": 1})), "All 3 decide."),
        (_run(run_result(Verdict.SOLUTION, {"a": 1}, cost=2), robots=1), "The robot decides. It costs 2."),
        (
            _run(run_result(Verdict.UNKNOWN, {"a": 1}, cost=9, bound=4), RunState.STOPPED),
            (
                "All 3 decide. The search was stopped; this is the best answer so far. It costs 9. "
                "No answer costs less than 4."
            ),
        ),
        (
            _run(run_result(Verdict.UNKNOWN, {"a": 1}, cost=1_234_567, bound=1_234_566), RunState.STOPPED),
            (
                "All 3 decide. The search was stopped; this is the best answer so far. It costs 1,234,567. "
                "No answer costs less than 1,234,566."
            ),
        ),
        (_run(run_result(Verdict.SOLUTION, {"a": 1}, cost=0), costs=False), "All 3 decide."),
        (_run(run_result(Verdict.OPTIMAL, {"a": 1}, cost=0), costs=False), "All 3 decide."),
        (
            _run(run_result(Verdict.UNKNOWN, {"a": 1}, withdrawn=("Drone1",), cost=5, bound=1), withdraw=True),
            (
                "2 of 3 decide. These step aside: Drone1. A limit was reached; this is the best answer so far. "
                "It costs 5. At least this number of robots must step aside: 1."
            ),
        ),
        (
            _run(
                run_result(Verdict.UNKNOWN, {"a": 1}, withdrawn=("Drone1",), cost=0, bound=0),
                withdraw=True,
                costs=False,
            ),
            "2 of 3 decide. These step aside: Drone1. A limit was reached; this is the best answer so far.",
        ),
        (
            _run(run_result(Verdict.UNKNOWN, {"a": 1}, cost=9)),
            "All 3 decide. A limit was reached; this is the best answer so far. It costs 9.",
        ),
        (_run(run_result(Verdict.NO_SOLUTION)), "There is no solution: the rules cannot all hold."),
        (
            _run(run_result(Verdict.OPTIMAL, {"a": 1}, withdrawn=("Drone1",), cost=1)),
            (
                "2 of 3 decide. These step aside: Drone1. It is proven that their total weight cannot be lower. "
                "It costs 1."
            ),
        ),
        (_run(None, RunState.FAILED, "no such thing"), "The search failed: no such thing"),
        (
            _run(None, RunState.FAILED, "lost"),
            "The application ended during this run. Decide again.",
        ),
        (
            _run(None, RunState.STOPPED),
            "The search ended without an answer. Allow more time, or choose another protocol.",
        ),
    ],
)
def test_that_the_answer_is_told_in_words(run: Run, words: str) -> None:
    assert headline(run) == words


def test_that_robots_that_step_aside_are_weighed() -> None:
    result = run_result(Verdict.UNKNOWN, {"a": 1}, withdrawn=("Drone1",), cost=5, bound=3)
    run = Run(Path("00001"), Record(RunOptions(withdraw=True)), with_importance(slots(3, 3), "Drone1", weight=3))
    run.result = result
    assert headline(run).endswith("The robots that step aside have a total weight of at least 3.")


def test_that_hostile_names_are_text() -> None:
    sketch = Sketch(
        HOSTILE,
        robots=(SketchRobot(HOSTILE, Cell(0, 0)),),
        decisions=(Decision(HOSTILE, DecisionKind.TASK, (HOSTILE,)),),
    )
    result = run_result(Verdict.SOLUTION, {f"{HOSTILE}.{HOSTILE}": HOSTILE})
    says = values_of(sketch, result.values)
    assert says == {HOSTILE: HOSTILE}
    for made in (table_html(sketch, result), team_svg(sketch, says), team_svg(sketch, {}, aside=frozenset({HOSTILE}))):
        assert "<img" not in made
        tree = ET.fromstring(made)  # noqa: S314 - our own
        assert not [one for one in tree.iter() if one.tag.endswith(("img", "script"))]
    assert HOSTILE in "".join(ET.fromstring(table_html(sketch, result)).itertext())  # noqa: S314 - our own


def test_that_a_place_is_short_in_the_picture_and_said_in_the_table() -> None:
    sketch = Sketch(robots=(SketchRobot("A", Cell(0, 0)),), decisions=(Decision("spot", DecisionKind.PLACE),))
    result = run_result(Verdict.SOLUTION, {"A.spot": 17})
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


def _places() -> Sketch:
    """Two robots that choose cells of a map with a wall, and a level besides."""
    area = Area(4, 3, frozenset({Cell(1, 1)}))
    robots = (SketchRobot("Ada", Cell(0, 0)), SketchRobot("Ben", Cell(3, 0)))
    decisions = (Decision("spot", DecisionKind.PLACE), Decision("level", DecisionKind.LEVEL, (1, 2)))
    return Sketch(area=area, robots=robots, decisions=decisions)


def test_that_places_are_drawn_on_the_map_with_an_arrow_from_home() -> None:
    sketch = _places()
    assignment: dict[str, Value] = {"Ada.spot": 11, "Ada.level": 2, "Ben.spot": 3, "Ben.level": 1}
    targets = targets_of(sketch, assignment)
    assert targets == {"Ada": TargetCell(Cell(3, 2), "2"), "Ben": TargetCell(Cell(3, 0), "1")}
    made = team_svg(sketch, values_of(sketch, assignment), targets=targets)
    assert made.count('class="home"') == made.count('class="way"') == 1  # Ben stays where he is
    assert f'class="wall" d="M{UNIT} {-2 * UNIT}h' in made
    written = [one.text for one in ET.fromstring(made).iter() if one.get("class") == "value"]  # noqa: S314 - our own
    assert written == ["Ada · 2", "Ben · 1"]
    assert "(4, 3) · 2" in made  # it is read aloud


def test_that_who_has_no_place_is_drawn_at_home() -> None:
    sketch = _places()
    made = team_svg(sketch, {}, aside=frozenset({"Ada"}), targets={"Ada": TargetCell(Cell(3, 2))})
    assert 'class="home"' not in made
    assert (made.count('class="aside"'), made.count('class="unsettled"')) == (1, 1)


def test_that_of_a_large_map_the_part_is_drawn_that_matters() -> None:
    robots = (SketchRobot("Ada", Cell(30, 30)),)
    sketch = Sketch(
        area=Area(60, 60), robots=robots, decisions=(Decision("spot", DecisionKind.PLACE, (31 * 60 + 33,)),)
    )
    assert shown_part(sketch) == (Cell(29, 29), Cell(34, 32))


def test_that_a_falling_cost_is_a_line_with_a_caption() -> None:
    assert falling_svg([(0.0, 5)]) == ""
    assert falling_svg([(0.0, 5)], bound=6) == ""  # which cannot be
    assert falling_svg([], bound=6) == ""
    assert falling_svg([(0.0, 5)], bound=5) == ""  # the first one is the best
    banded = falling_svg([(0.0, 5)], bound=3, until=2.0)
    assert "between 3 and 5" in banded
    assert banded.count('class="band"') == 1
    assert "between" not in falling_svg([(0.0, 9), (1.0, 6)], bound=6)
    made = falling_svg([(0.0, 9), (1.0, 6), (2.0, 4)])
    assert "fell from 9 to 4 in 2.0 s" in ET.fromstring(made)[1].text  # type: ignore[operator] # noqa: S314 - our own


def test_that_costs_are_told_with_all_their_digits() -> None:
    made = falling_svg([(0.0, 2_345_678), (1.0, Decimal("1234567.125"))], bound=1_234_567)
    assert "fell from 2,345,678 to 1,234,567.125 in 1.0 s" in made
    assert "between 1,234,567 and 1,234,567.125" in made


def test_that_a_rule_that_nobody_can_keep_is_explained() -> None:
    sketch = slots(3, 2)
    assert [(one.element, one.key) for one in hints_about_rules(sketch)] == [("R1", "trouble.never-crowded")]
    assert hints_about_rules(slots(3, 3)) == []


def test_that_what_rules_cost_adds_up_after_somebody_stepped_aside() -> None:
    sketch = slots(4, 3)
    values: dict[str, Value] = {"Drone1.slot": 2, "Drone2.slot": 1, "Drone4.slot": 3}
    assert rule_costs(sketch, values) == {"R2": 6}


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
        costs = [*rule_costs(sketch, values).values()]
        assert sum(costs) == solution.cost, seed
        seen += solution.cost > 0
    assert seen > 5


def test_that_only_protocols_that_fit_are_offered() -> None:
    with_costs, without = fitting(slots(3, 3)), fitting(slots(3, 3, little=False))
    assert "abt" in dict(without.protocols)
    assert "abt" not in dict(with_costs.protocols)
    assert with_costs.chosen in dict(with_costs.protocols)
    assert with_costs.why
    assert with_costs.costs
    assert not without.costs


@looped("content", [b"", b"{", b'{"verdict":"optimal"}', b"nonsense\n", b"[]\n", b"\xff\n"])
def test_that_half_a_result_is_none(content: bytes) -> None:
    assert decoded(content) is None


@looped("seed", range(40))
def test_that_rules_cost_in_any_answer_what_the_checker_says(seed: int) -> None:
    random = Random(seed)
    drawn = random_sketch(random)
    rules = tuple(msgspec.structs.replace(rule, cost=rule.cost or 7, private=False) for rule in drawn.rules)
    sketch = msgspec.structs.replace(drawn, rules=rules)
    model = model_of(sketch)
    for _ in range(10):
        codes = {name: random.choice([*one.domain]) for name, one in model.team.variables.items() if one.domain}
        values = {name: value_of(model, name, code) for name, code in codes.items()}
        assert sum(rule_costs(sketch, values).values()) == assignment_cost(model.team, codes)
