"""The program beside a sketch makes the same team, whatever was drawn and whatever it is called."""

from __future__ import annotations

import ast
from random import Random

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.python_program import names_in_python, python_source
from robochoc.app.sketch.python_text import PythonText, python_literal, text_with
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.model.problem import Team
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import HOSTILE, random_sketch, without_costs

LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3, 4))
ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate(("A", "B", "C", "D")))


def team_of(source: str) -> Team:
    """The team that a program makes. It is not solved."""
    program, solving, _ = source.partition("outcome = model.solve()")
    assert solving
    names: dict[str, object] = {}
    exec(compile(program, "sketch", "exec"), names)  # noqa: S102 - the test is about what it does
    team = names["model"].team  # type: ignore[attr-defined] # a model
    assert isinstance(team, Team)
    return team


@looped("kind", PALETTE)
@given(seed=st.integers(0, 10**9))
@examples(6)
def test_every_rule_makes_the_same_team(kind: str, seed: int) -> None:
    sketch = without_costs(random_sketch(Random(seed), [kind]))
    assert team_of(python_source(sketch)) == model_of(sketch).team


@given(st.integers(0, 10**9))
@examples(60)
def test_rules_together_make_the_same_team(seed: int) -> None:
    sketch = without_costs(random_sketch(Random(seed)))
    assert team_of(python_source(sketch)) == model_of(sketch).team


def with_rule(rule: SketchRule) -> Sketch:
    return Sketch("team", Area(4, 2), ROBOTS, (LEVEL,), (rule,))


def rule_lines(rule: SketchRule) -> list[str]:
    """The lines of the only rule of a team."""
    lines = python_source(with_rule(rule)).splitlines()
    return lines[next(place for place, line in enumerate(lines) if line.startswith("# In")) + 1 : -3]


def test_pairs_are_a_loop_as_somebody_would_write_it() -> None:
    assert rule_lines(SketchRule("R1", "different", "level")) == [
        "for a, b in itertools.combinations(level_of, 2):",
        '    model.add(level_of[a] != level_of[b], name=f"R1.{a}.{b}")',
    ]
    assert rule_lines(SketchRule("R1", "apart", "level", ("A", "B", "D"), {"gap": 2}, 5)) == [
        'for a, b in itertools.combinations(["A", "B", "D"], 2):',
        '    model.add(abs(level_of[a] - level_of[b]) >= 2, cost=5, name=f"R1.{a}.{b}")',
    ]


def test_other_links_are_loops_too() -> None:
    assert rule_lines(SketchRule("R1", "leader-above", "level", ("C", "A", "B"))) == [
        'for b in ["A", "B"]:',
        '    model.add(level_of["C"] > level_of[b], name=f"R1.C.{b}")',
    ]
    assert rule_lines(SketchRule("R1", "in-order", "level")) == [
        "for a, b in itertools.pairwise(level_of):",
        '    model.add(level_of[a] < level_of[b], name=f"R1.{a}.{b}")',
    ]
    assert rule_lines(SketchRule("R1", "at-most", "level", (), {"value": 3, "count": 2})) == [
        'model.add(sum(level_of[a] == 3 for a in level_of) <= 2, name="R1")'
    ]


def test_two_robots_need_no_loop() -> None:
    rule = SketchRule("R1", "different", "level", ("A", "B"), private=True)
    assert rule_lines(rule) == ['robots["A"].knows(level_of["A"] != level_of["B"], name="R1.A.B")']


def test_a_program_can_be_read() -> None:
    robots = tuple(SketchRobot(f"Drone{number}", Cell(number % 60, number // 60)) for number in range(121))
    sketch = Sketch("team", Area(60, 3), robots, (LEVEL,), (SketchRule("R1", "different", "level"),))
    source = python_source(sketch)
    assert len(source.splitlines()) < 80
    assert max(map(len, source.splitlines())) <= 120


def test_decisions_have_names_of_their_own_in_python() -> None:
    decisions = tuple(Decision(name, DecisionKind.LEVEL, (1,)) for name in ("a.b", "a_b", "a-b", "class", "robots"))
    names = [*names_in_python(Sketch(decisions=decisions)).values()]
    assert names == ["a_b_of", "a_b__of", "a_b___of", "class_of", "robots_of"]


@looped("text", [*HOSTILE, "'", '"', "\\", '{"', '"""', "\\'", "{0}", "a\rb"])
def test_no_text_leaves_its_quotes(text: str) -> None:
    assert ast.literal_eval(python_literal(text)) == text
    assert ast.literal_eval(python_literal([(text,), [text, 1]])) == [(text,), [text, 1]]
    told = eval(text_with([text, PythonText("a"), text]), {"a": "mid"})  # noqa: S307 - the same
    assert told == f"{text}.mid.{text}"


@looped("name", HOSTILE)
def test_a_hostile_sketch_writes_nothing_else(name: str) -> None:
    """Not even a sketch that has errors writes a program that does anything but what its texts say."""
    robots = (SketchRobot(name, Cell(0, 0)), *ROBOTS)
    rule = SketchRule(name, "only", name, (), {"values": [name, "x"]})
    sketch = Sketch(name, Area(), robots, (Decision(name, DecisionKind.TASK, (name, "x")),), (rule,))
    calls = {
        node.func.attr if isinstance(node.func, ast.Attribute) else ast.unparse(node.func)
        for node in ast.walk(ast.parse(python_source(sketch)))
        if isinstance(node, ast.Call)
    }
    assert calls <= {"Model", "robot", "variable", "add", "is_in", "solve", "print"}
    assert troubles(sketch)


def test_a_rule_that_does_not_count_is_left_out() -> None:
    rule = SketchRule("R1", "different", "level")
    off = msgspec.structs.replace(rule, on=False)
    assert team_of(python_source(with_rule(off))) == model_of(with_rule(off)).team
    assert "model.add" not in python_source(with_rule(off))
