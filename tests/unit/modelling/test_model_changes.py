"""What a model shows cannot be changed without effect; constraints are removed by identity."""

from __future__ import annotations

import copy
import pickle
from itertools import combinations
from random import Random
from typing import Any

import pytest

import robochoc
from robochoc.modelling.errors import ModelError


def three() -> tuple[robochoc.Model, list[Any]]:
    """Return a model of three robots with two values each."""
    model = robochoc.Model("three")
    return model, [model.robot(f"r{i}").variable("x", range(2)) for i in range(3)]


def test_views_are_read_only() -> None:
    model, (x, *_) = three()
    rule = model.add(x == 1)
    changes: list[tuple[str, type[Exception]]] = [
        ("model.constraints.append(rule)", AttributeError),
        ("model.constraints.clear()", AttributeError),
        ("del model.robots['r2']", TypeError),
        ("del model.variables['r2.x']", TypeError),
        ("model.robots['r0'].variables.clear()", AttributeError),
        ("model.events.clear()", AttributeError),
        ("model.objective.clear()", AttributeError),
        ("model.constraints = []", AttributeError),
        ("model.robots['r0'].parts.clear()", AttributeError),
        ("model.robots['r0'].topics.clear()", AttributeError),
        ("model.after_solution().steps.clear()", AttributeError),
        ("model.robots['r0'].name = 'other'", AttributeError),
        ("model.robots['r0'].weight = 3", AttributeError),
        ("model.robots['r0'].priority = 3", AttributeError),
        ("rule.cost = 3", AttributeError),
    ]
    for change, error in changes:
        with pytest.raises(error):
            exec(change, {"model": model, "rule": rule})  # noqa: S102 - as a user writes it
    assert model.constraints == (rule,)
    assert list(model.robots) == ["r0", "r1", "r2"]


def test_a_change_of_the_name_counts() -> None:
    model, _ = three()
    assert model.solve("abt", runtime="simulator").team == "three"
    model.name = "other"
    assert model.solve("abt", runtime="simulator").team == model.team.name == "other"


def test_a_constraint_is_removed() -> None:
    model, (x, y, z) = three()
    different = model.add(robochoc.all_different(x, y, z), name="a")
    model.add(x != y, name="a")
    assert model.solve("abt", runtime="simulator").verdict == "no-solution"
    model.remove(different)
    assert model.solve("abt", runtime="simulator").verdict == "solution"
    assert len(model.constraints) == 1
    part = model.robots["r0"].knows(x != z)
    model.remove(part)
    assert not model.robots["r0"].parts
    for absent in (different, part):
        with pytest.raises(ModelError, match="is not a constraint of <model three: 3 robots"):
            model.remove(absent)


def test_copies_of_a_model_have_their_own_constraints() -> None:
    model, (x, y, _) = three()
    rule = model.add(x != y)
    for copied in (copy.copy(model), pickle.loads(pickle.dumps(model))):  # noqa: S301 - this test's own bytes
        with pytest.raises(ModelError, match="is not a constraint of"):
            copied.remove(rule)
        with pytest.raises(ModelError, match="is not a constraint of"):
            copied.after_solution().remove_constraint(rule)
        copied.remove(copied.constraints[0])
        assert (copied.constraints, model.constraints) == ((), (rule,))


def test_an_event_removes_one_constraint_of_several_with_its_name() -> None:
    model, (x, y, z) = three()
    first = model.add(x != y, name="a")
    model.add(y != z, name="a")
    model.after_solution().remove_constraint(first)
    assert [epoch.opened_by for epoch in model.solve("dynabt", runtime="simulator").epochs][1] == "-a (r0, r1)"
    model.after_solution().remove_constraint("a")
    assert [epoch.opened_by for epoch in model.solve("dynabt", runtime="simulator").epochs][2] == "-a (r1, r2)"


def test_a_name_removes_all_constraints_that_have_it() -> None:
    model, (x, y, z) = three()
    model.add(x != y, name="a")
    model.add(y != z, name="a")
    model.after_solution().remove_constraint("a")
    changed = model.solve("dynabt", runtime="simulator").epochs[1]
    assert changed.opened_by == "-a (r0, r1), -a (r1, r2)"


def test_constraints_that_files_cannot_tell_apart_are_refused() -> None:
    model, (x, y, _) = three()
    first = model.add(x != y, name="a")
    model.add(x <= y, name="a")
    model.after_solution().remove_constraint(first)
    with pytest.raises(ModelError, match=r"<a: \(r0.x != r1.x\)> has the same name and robots as <a: "):
        _ = model.team


def test_a_constraint_is_added_again_after_its_removal() -> None:
    model, (x, y, _) = three()
    event, later = model.after_solution(), model.after_solution()
    event.remove_constraint(model.add(x != y, name="a"))
    again = event.add(x == y, name="a")
    later.remove_constraint(again)
    epochs = model.solve("dynabt", runtime="simulator").epochs
    assert [epoch.opened_by for epoch in epochs[1:]] == ["-a (r0, r1), +a (r0, r1)", "-a (r0, r1)"]


def test_random_removals_against_brute_force() -> None:
    """Constraints of few names over all pairs; each event removes one by identity, or all of a name."""
    chance = Random(8)
    for _ in range(15):
        model = robochoc.Model("m")
        variables = [model.robot(f"r{i}").variable("x", range(2)) for i in range(4)]
        rules = {
            model.add(x != y, name=chance.choice("ab")): (x, y)
            for x, y in combinations(variables, 2)
            if chance.random() < 3 / 4
        }
        satisfiable = [_can_differ(list(rules.values()), variables)]
        for _ in range(3):
            if not rules:
                break
            one = chance.choice(list(rules))
            by_name = chance.random() < 1 / 3
            model.after_solution().remove_constraint(one.name if by_name else one)
            gone = [rule for rule in rules if (rule.name == one.name if by_name else rule is one)]
            for rule in gone:
                del rules[rule]
            satisfiable.append(_can_differ(list(rules.values()), variables))
        outcome = model.solve("dynabt", runtime="simulator")
        found = [epoch.verdict == "solution" for epoch in outcome.epochs] or [outcome.verdict == "solution"]
        assert found == satisfiable


def _can_differ(pairs: list[tuple[Any, Any]], variables: list[Any]) -> bool:
    """Return whether two values are enough for all pairs to differ."""
    places = {id(variable): place for place, variable in enumerate(variables)}
    links = [(places[id(x)], places[id(y)]) for x, y in pairs]
    return any(all((code >> i ^ code >> k) & 1 for i, k in links) for code in range(2 ** len(variables)))
