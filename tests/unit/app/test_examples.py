"""The gallery: every example is sound, is decided at once, and has a picture."""

from __future__ import annotations

import time
from random import Random

from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.example_sketches import KEYS, example, examples, shows, title_of
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Area, Cell, Sketch, SketchRobot, SketchRule
from robochoc.app.sketch.thumbnail import thumbnail
from tests.support.cases import looped
from tests.support.examples import examples as draws
from tests.support.sketches import HOSTILE, random_sketch, spoiled


def test_there_are_enough_of_them_and_each_has_words() -> None:
    found = examples()
    assert len(found) >= 8
    assert [*found] == [*KEYS]
    assert all(sketch.name == key and sketch.story and title_of(key) for key, sketch in found.items())


def test_those_that_fly_come_first_and_each_says_what_it_shows() -> None:
    flying = [sketch.flies for sketch in examples().values()]
    assert flying == sorted(flying, reverse=True)
    assert {*flying} == {True, False}
    assert len({shows(key) for key in KEYS}) == len(KEYS)


@looped("key", KEYS)
def test_an_example_is_sound_and_decided_at_once(key: str) -> None:
    sketch = example(key)
    assert troubles(sketch) == []
    began = time.process_time()
    outcome = model_of(sketch).solve(runtime="simulator")
    assert outcome.verdict in {"solution", "optimal"}
    assert time.process_time() - began < 1


def test_together_they_show_most_of_the_palette() -> None:
    shown = {rule.kind for sketch in examples().values() for rule in sketch.rules}
    assert len(shown) >= 0.75 * len(PALETTE)


@looped("key", KEYS)
def test_an_example_has_a_picture_of_its_robots(key: str) -> None:
    drawn = etree.fromstring(thumbnail(example(key)).encode())
    assert len(drawn.findall("{*}circle")) == len(example(key).robots)


def test_a_picture_is_small_and_quick_for_the_largest_team() -> None:
    robots = tuple(SketchRobot(f"D{number}", Cell(number % 60, number // 60)) for number in range(1_000))
    sketch = Sketch("team", Area(60, 60), robots, (), (SketchRule("R1", "different", "level"),))
    assert len(thumbnail(sketch)) < 100_000


@given(st.integers(0, 10**9))
@draws(40)
def test_nothing_hostile_leaves_its_place_in_a_picture(seed: int) -> None:
    random = Random(seed)
    sketch = random_sketch(random)
    robots = tuple(SketchRobot(f"{random.choice(HOSTILE)}{robot.name}<b>\"'&", robot.at) for robot in sketch.robots)
    hostile = Sketch(random.choice(HOSTILE), sketch.area, robots, sketch.decisions, spoiled(random, sketch).rules)
    drawn = etree.fromstring(thumbnail(hostile).encode())
    assert {etree.QName(one).localname for one in drawn.iter()} <= {"svg", "path", "circle", "text"}
    names = {name for one in drawn.iter() for name in one.attrib}
    assert not {str(name) for name in names if str(name).startswith("on") or "href" in str(name)}


def test_what_is_far_too_large_has_a_picture_of_nothing() -> None:
    for sketch in (
        Sketch(area=Area(10**9, 10**9)),
        Sketch(area=Area(0, -1)),
        Sketch(robots=(SketchRobot("A", Cell(10**5_000, 0)),)),
        Sketch(robots=(SketchRobot("A", Cell(0, 0)),) * 10_000),
    ):
        assert etree.fromstring(thumbnail(sketch).encode()).findall("{*}circle") == []
