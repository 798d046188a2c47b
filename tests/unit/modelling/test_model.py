"""What a model says: values of all kinds, operators, tables, functions, and what robots then know."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from decimal import Decimal
from enum import Enum, IntEnum
from fractions import Fraction
from typing import Any

import robochoc
from robochoc.model.constraint import Function, Predicate, Relation
from robochoc.model.outcome import Verdict
from robochoc.modelling.terms import ModelVariable
from tests.support.cases import looped


class Color(Enum):
    RED = "r"
    GREEN = "g"


class Level(IntEnum):
    LOW = 1
    HIGH = 5


def two(domain: object, other: object = None) -> tuple[robochoc.Model, ModelVariable, ModelVariable]:
    """Return a model of two robots with a variable each."""
    model = robochoc.Model("two")
    first = model.robot("a").variable("x", domain)
    return model, first, model.robot("b").variable("y", domain if other is None else other)


def only(model: robochoc.Model) -> robochoc.Solution:
    """Return the solution of a model, by a distributed protocol."""
    return model.solve("abt" if model.team.kind == "DisCSP" else "syncbb", runtime="simulator")


def test_five_drones_charge_in_slots() -> None:
    model = robochoc.Model("charging")
    drones = [model.robot(f"drone{i}") for i in range(5)]
    slot = [drone.variable("slot", range(1, 6)) for drone in drones]
    model.add(robochoc.all_different(slot))
    model.minimize(sum(abs(s - want) for s, want in zip(slot, [1, 1, 2, 3, 3], strict=True)))
    outcome = model.solve("adopt", runtime="simulator")
    assert outcome.verdict is Verdict.OPTIMAL
    assert outcome.cost == 5
    assert {outcome[one] for one in slot} == {1, 2, 3, 4, 5}
    assert outcome.values["drone0.slot"] == outcome[slot[0]] == outcome["drone0.slot"]
    assert all(len(robot.private) == 1 for robot in model.team.robots)
    assert repr(outcome) == "<charging: optimal solution for all 5 robots, cost 5; adopt, simulator>"


@looped(
    ("domain", "wanted"),
    [
        (range(3), 2),
        (["fast", "slow mode"], "slow mode"),
        (Color, Color.GREEN),
        (Level, Level.HIGH),
        (bool, True),
        ([(0, 0), (0, 1)], (0, 1)),
        ([Decimal("0.5"), Decimal("1.25")], Decimal("1.25")),
        ([0.1, 0.2], 0.2),
        ([Fraction(1, 3), 2], Fraction(1, 3)),
        ([frozenset({1}), frozenset({2})], frozenset({2})),
        ([10**17, 5, -3], -3),
    ],
)
def test_values_come_back_as_they_were_written(domain: object, wanted: object) -> None:
    model, x, y = two(domain)
    model.add(x == wanted, y != x)
    told = only(model)
    assert told[x] == wanted
    assert type(told[x]) is type(wanted)
    assert told[y] in x.domain
    assert told[y] != wanted


def test_symbols_of_one_name_and_two_kinds_stay_apart() -> None:
    model, x, y = two(["1 2", "1_2", "1-2"], [(1, 2), (1, 3)])
    model.add(x == "1_2", y == (1, 2))
    assert only(model).values == {"a.x": "1_2", "b.y": (1, 2)}


OPERATORS: list[tuple[str, Callable[..., Any]]] = [
    ("//", lambda x, y: x // y),
    ("%", lambda x, y: x % y),
    ("sum", lambda x, y: x + y * 3 - 1),
    ("neg", lambda x, y: -x + y),
    ("abs", lambda x, y: abs(x - y)),
    ("swapped", lambda x, y: 3 - y + 0 * x),
    ("**", lambda x, y: x**2 + y),
    ("r//", lambda x, y: 2 // y + x),
    ("r%", lambda x, y: 7 % y - x),
    ("r**", lambda x, y: 2 ** (y + 2) + x),
]


@looped("means", [means for _, means in OPERATORS])
def test_operators_mean_what_they_mean_in_python(means: Callable[..., Any]) -> None:
    for first, second in itertools.product((-7, 7), (-2, 2)):
        model, x, y = two([-7, 7], [-2, 2])
        model.add(x == first, y == second)
        model.minimize(means(x, y))
        told = model.solve("central", runtime="simulator")
        assert told.cost == told[means(x, y)] == means(first, second)


def test_conditions_combine() -> None:
    model, x, y = two(range(5))
    model.add((x == 3).implies(y > x), ~(x < 3) & (x != 4), (y == 4) ^ (x == 9), x.is_in([3, 4, 77]))
    assert only(model).values == {"a.x": 3, "b.y": 4}


def test_conditions_count_as_numbers_and_truth_values_as_conditions() -> None:
    model = robochoc.Model()
    flags = [model.robot(f"r{n}").boolean("on") for n in range(3)]
    model.add(sum(flags) == 2, flags[0].implies(~flags[1]), flags[0])
    assert only(model).values == {"r0.on": True, "r1.on": False, "r2.on": True}


def test_tables_and_functions() -> None:
    model, x, y = two(range(4), ["low", "high"])
    model.add(robochoc.allowed([x, y], [(0, "low"), (2, "low"), (3, "high"), (9, "low")]))
    model.add(robochoc.forbidden(x, [0]))
    model.add(robochoc.function(lambda value, mode: value % 2 == 0 or mode == "low", x, y))
    assert only(model).values == {"a.x": 2, "b.y": "low"}


def test_costs_of_tables_forbid_by_infinity() -> None:
    model, x, y = two(range(3))
    model.minimize(2 * robochoc.costs([x, y], {(0, 0): 1, (1, 1): Decimal("-0.25")}, default=math.inf))
    told = only(model)
    assert told.values == {"a.x": 1, "b.y": 1}
    assert told.cost == Decimal("-0.5")


def test_elements_extremes_choices_and_resources() -> None:
    model, x, y = two(range(-1, 4))
    model.add(robochoc.element([5, y, 7], x) == 3)
    assert only(model).values == {"a.x": 1, "b.y": 3}
    model, x, y = two(range(6))
    model.add(robochoc.maximum(x, y) == 5, robochoc.minimum([x, y, 9]) == 4, robochoc.if_then_else(x > y, 1, 0) == 1)
    assert only(model).values == {"a.x": 5, "b.y": 4}
    model, x, y = two(range(3))
    model.add(robochoc.cumulative([x, y], [2, 1], [1, 2], 2), x == 0)
    assert only(model).values == {"a.x": 0, "b.y": 2}


def test_terms_over_the_same_variables_become_one_cost() -> None:
    model, x, y = two(range(4))
    model.minimize(3 * (abs(x - y) + 2 * x) + x - 0.5 * y + (x - y) ** 2 + 7)
    held = {one.name: one for one in model.team.constraints()}
    assert sorted(one.variables for one in held.values()) == [("a.x",), ("a.x", "b.y"), ("b.y",)]
    kinds = {one.variables: type(one.definition) for one in held.values()}
    assert kinds == {("a.x", "b.y"): Function, ("a.x",): Function, ("b.y",): Relation}
    assert model.team.robots[0].costs.constant == 70
    assert only(model).cost == 7


def test_a_sum_is_maximised_and_soft_constraints_count_against_it() -> None:
    model, x, y = two(range(4))
    model.maximize(x + 2 * y)
    model.maximize(Fraction(1, 4) * x)
    model.add(x + y <= 3, cost=Decimal("0.5"))
    model.add(y <= 2)
    told = only(model)
    assert told.values == {"a.x": 3, "b.y": 2}
    assert told.cost == Decimal("7.25")


def test_all_different_becomes_pairs_with_one_name_and_a_soft_one_is_whole() -> None:
    model = robochoc.Model()
    colors = [model.robot(f"r{n}").variable("c", Color) for n in range(3)]
    rule = model.add(robochoc.all_different(*colors), name="apart")
    assert [one.name for one in model.team.constraints()] == ["apart"] * 3
    assert all(isinstance(one.definition, Predicate) for one in model.team.constraints())
    assert repr(rule) == "<apart: all_different(r0.c, r1.c, r2.c)>"
    assert only(model).verdict is Verdict.NO_SOLUTION
    model.remove(rule)
    model.add(robochoc.all_different(colors), cost=2)
    assert only(model).cost == 2


def test_what_one_robot_alone_is_told_stays_with_it() -> None:
    model, x, y = two(range(4))
    model.add(x < 3, x + y == 4)
    first, second = model.team.robots
    assert [one.variables for one in first.private] == [("a.x",)]
    assert [one.variables for one in second.shared] == [("a.x", "b.y")]


def test_robots_come_in_the_order_of_their_priorities() -> None:
    model = robochoc.Model()
    for name, priority in (("a", 0), ("b", 2), ("c", 0), ("d", 1)):
        model.robot(name, priority=priority, weight=3 if name == "d" else 1).variable("v", range(2))
    model.add(model["a.v"] != model["b.v"])
    assert model.team.order == ("b", "d", "a", "c")
    assert [parent.name for parent in model.team["a"].parents] == ["b"]
    assert model.team["d"].weight == 3


def test_each_side_of_a_partially_known_constraint_keeps_its_part() -> None:
    model, x, y = two(range(4))
    model.robots["a"].knows(x != y)
    model.robots["b"].knows(y > x, y == 1)
    first, second = model.team.robots
    assert [one.variables for child in first.children for one in child.constraints] == [("a.x", "b.y")]
    assert {one.model for one in second.shared} == {"PKC"}
    assert only(model).values == {"a.x": 0, "b.y": 1}


def test_topics_say_where_a_decision_sends_a_robot() -> None:
    model, x, _ = two(range(4))
    model.robots["a"].topic("/a/waypoint", x=1, y=x * 2 + 1, z=x // 2)
    (topic,) = model.team["a"].topics
    assert (topic.name, topic.type) == ("/a/waypoint", "geometry_msgs/PoseStamped")
    assert robochoc.Model.of(model.team).team["a"].topics == (topic,)
