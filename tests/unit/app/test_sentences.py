"""Rules in plain words."""

from __future__ import annotations

import re
from pathlib import Path
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robochoc.app
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sentences import listed, sentence, short, value_words, weight_of
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.texts import catalogue, say
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import random_sketch, spoiled

LEVEL, PLACE = Decision("level", DecisionKind.LEVEL, (1, 2, 3)), Decision("place", DecisionKind.PLACE)
ROBOTS = tuple(SketchRobot(name, Cell(0, 0)) for name in ("North", "South", "East"))
TEAM = Sketch("team", Area(4, 3), ROBOTS, (LEVEL, PLACE))


@looped("key", PALETTE)
def test_every_rule_of_the_palette_has_words(key: str) -> None:
    entry = PALETTE[key]
    for part in ("name", "short", "sentence", "help"):
        assert say_as_is(f"rule.{key}.{part}")
    assert all(f"{{{opening.name}}}" in say_as_is(f"rule.{key}.sentence") for opening in entry.openings)
    assert all(say(f"opening.{opening.name}") for opening in entry.openings)
    assert all(say(f"kind.{kind}") for kind in entry.kinds)


def say_as_is(key: str) -> str:
    return catalogue()[key]


def test_a_sentence_names_the_robots_and_what_was_filled_in() -> None:
    rule = SketchRule("R1", "apart", "level", ("North", "South"), {"gap": 2})
    assert sentence(TEAM, rule) == "In level, North and South are always at least 2 apart."
    assert short(TEAM, rule) == "at least 2 apart"


def test_a_rule_for_everybody_says_so() -> None:
    rule = SketchRule("R1", "different", "level")
    assert sentence(TEAM, rule) == "In level, all robots choose different values."


def test_a_leader_and_an_order_are_told() -> None:
    leader = SketchRule("R1", "north-of", "place", ("East", "South", "North"))
    assert sentence(TEAM, leader) == "In place, East is further north than South and North."
    order = SketchRule("R1", "in-order", "level", ("East", "South", "North"))
    assert sentence(TEAM, order) == "In level, the order is East, South and North: each chooses less than the next one."


def test_cells_are_told_by_column_and_row() -> None:
    rule = SketchRule("R1", "never", "place", ("North",), {"value": 5})
    assert sentence(TEAM, rule) == "For North, place is never: column 2, row 2."
    assert value_words(TEAM, LEVEL, 5) == "5"


def test_braces_in_a_value_mean_nothing() -> None:
    task = Decision("task", DecisionKind.TASK, ("{decision} {robots}",))
    rule = SketchRule("R1", "never", "task", ("North",), {"value": "{decision} {robots}"})
    sketch = msgspec.structs.replace(TEAM, decisions=(task,))
    assert sentence(sketch, rule) == "For North, task is never: {decision} {robots}."


def test_what_is_missing_is_left_open() -> None:
    assert sentence(TEAM, SketchRule("R1", "apart", "nothing")) == "In nothing, … are always at least … apart."
    assert "magic" in sentence(TEAM, SketchRule("R1", "magic", "level"))


def test_what_a_rule_counts_is_told() -> None:
    assert weight_of(SketchRule("R1", "different", "level")) == "It must hold."
    soft = SketchRule("R1", "different", "level", cost=3, private=True, on=False)
    assert weight_of(soft).startswith("Breaking it costs 3 each time. Private: only the first robot")
    assert weight_of(SketchRule("R1", "little", "level", private=True)) == "Private: no other robot learns it."
    assert not weight_of(SketchRule("R1", "little", "level"))


def test_names_are_listed_as_in_a_sentence() -> None:
    names = ["A", "B", "C", "D", "E", "F"]
    told = [listed(names[:count]) for count in (0, 1, 2, 4, 6)]
    assert told == ["nobody", "A", "A and B", "A, B, C and D", "A, B, C and 3 others"]


@given(st.integers(0, 10**9))
@examples(60)
def test_whatever_is_drawn_has_words(seed: int) -> None:
    random = Random(seed)
    sketch = spoiled(random, random_sketch(random))
    for rule in sketch.rules:
        told = sentence(sketch, rule)
        if rule.kind in PALETTE:
            holes = (f"{{{name}}}" for name in ("robots", "decision", "leader", "others", *rule.settings))
            named = str(msgspec.to_builtins(sketch))
            assert not [hole for hole in holes if hole in told and hole not in named]


# The catalogue of texts


APP = Path(robochoc.app.__file__).parent
_KEY = re.compile(r"""["']([a-z]+(?:[.-][a-z0-9-]+)+)["']""")
_BUILT = re.compile(r"""f["']([a-z-]+\.(?:[a-z-]+\.)*)\{""")


def _asked() -> tuple[set[str], set[str]]:
    """All that looks like a key in the code, and the beginnings of those that are put together."""
    code = "\n".join(file.read_text(encoding="utf-8") for file in APP.rglob("*.py"))
    return set(_KEY.findall(code)), set(_BUILT.findall(code))


def test_every_text_that_is_asked_for_is_there() -> None:
    code = "\n".join(file.read_text(encoding="utf-8") for file in APP.rglob("*.py"))
    said = set(re.findall(r"""say\(\s*["']([^"'{]+)["']""", code)) | set(re.findall(r"""EditError\("([^"]+)\"""", code))
    assert said - set(catalogue()) == set()


def test_no_text_is_there_for_nobody() -> None:
    asked, built = _asked()
    assert {key for key in catalogue() if key not in asked and not key.startswith(tuple(built) or "-")} == set()


def test_what_a_text_names_is_filled_in() -> None:
    assert say("gallery.robots", count=3) == "3 robots"
    with pytest.raises(KeyError):
        say("no.such.text")
