"""Random models of robots with 2 to 4 variables, whose rules concern some variables of several robots."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from random import Random

import robochoc
from robochoc.modelling.terms import ModelVariable


def random_model(chance: Random, *, costs: bool) -> robochoc.Model:
    """3 or 4 robots: sums, counts, expressions, tables and different values over one variable of each; private rules.

    With `costs`, some rules are soft, and values have costs.
    """
    model = robochoc.Model("several")
    owned: list[list[ModelVariable]] = []
    for number in range(chance.choice((3, 4))):
        robot = model.robot(f"R{number}")
        many = chance.choice((2, 2, 3, 4))
        owned.append([robot.variable(f"v{place}", range(chance.choice((2, 2, 3)))) for place in range(many)])

    def add(rule: object) -> None:
        model.add(rule, cost=chance.randint(1, 9) if costs and chance.random() < 0.5 else None)

    for _ in range(chance.randint(1, 3)):
        column = [own[chance.randrange(2)] for own in owned]
        add(_shared_rule(chance, chance.sample(column, chance.randint(3, len(column)))))
    for one, other in itertools.combinations(owned, 2):
        if chance.random() < 0.6:
            add(_pair_rule(chance, chance.choice(one), chance.choice(other)))
    for own in owned:
        if chance.random() < 0.5:
            add(_pair_rule(chance, *chance.sample(own, 2)))
    if costs:
        model.minimize(sum(chance.randint(0, 5) * one for own in owned for one in own))
    return model


def _shared_rule(chance: Random, scope: Sequence[ModelVariable]) -> object:
    """Return a rule over three or more robots."""
    match chance.choice(("count", "sum", "different", "expression", "table")):
        case "count":
            value = chance.randint(0, 2)
            return sum(one == value for one in scope) <= chance.randint(1, len(scope) - 1)
        case "sum":
            total = sum(chance.choice((-1, 1, 2)) * one for one in scope)
            return total <= chance.randint(0, 4) if chance.random() < 0.5 else total >= chance.randint(-1, 3)
        case "different":
            return robochoc.all_different(scope[:3])
        case "expression":
            return (scope[0] == 0) | (robochoc.maximum(*scope[1:]) >= 1)
        case _:
            rows = [row for row in itertools.product(range(3), repeat=3) if chance.random() < 0.7]
            return robochoc.allowed(scope[:3], rows or [(0, 0, 0)])


def _pair_rule(chance: Random, one: ModelVariable, other: ModelVariable) -> object:
    return chance.choice((one != other, one <= other, one + other != 2, (one == 0) | (other == 0)))


def slots_and_tasks(robots: int, chance: Random) -> robochoc.Model:
    """Robots that each choose one of 3 slots and one of 6 tasks; two at most share a slot, and no two share a task."""
    model = robochoc.Model("slots")
    owned = [
        [robot.variable("slot", range(3)), robot.variable("task", range(6))]
        for robot in [model.robot(f"R{number}") for number in range(robots)]
    ]
    model.add([sum(slot == number for slot, _ in owned) <= 2 for number in range(3)])
    model.add([(one != other) | (one == 0) for (_, one), (_, other) in itertools.combinations(owned, 2)])
    for slot, task in owned:
        model.minimize(chance.randint(-9, 9) * slot)
        model.minimize(robochoc.costs(task, {number: chance.randint(0, 30) for number in range(6)}))
    return model
