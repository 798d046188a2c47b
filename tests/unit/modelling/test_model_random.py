"""`Model.random`: problems in Python whose costs depend on chance."""

from __future__ import annotations

import copy
from decimal import Decimal
from pathlib import Path

import pytest

import robochoc
from robochoc import ModelError
from robochoc.modelling.errors import UnknownNameError
from tests.support.cases import looped


def gusts() -> robochoc.Model:
    model = robochoc.Model("gusts")
    camera = model.robot("Camera").variable("height", range(1, 5))
    relay = model.robot("Relay").variable("height", range(1, 5))
    wind = model.random("wind", {0: 0.7, 3: Decimal("0.3")}, seen_by=[relay])
    model.add(relay + wind <= 5, relay != camera)
    model.minimize(camera * wind + 2 * (4 - camera) + 3 * abs(camera - relay))
    return model


def test_the_policy_has_the_least_expected_or_worst_cost(tmp_path: Path) -> None:
    model = gusts()
    solution = model.solve("dpop")
    assert (solution.cost, solution["Relay.height.wind.3"]) == (Decimal("7.5"), 2)
    assert model.solve("dpop", risk="worst").cost == 12
    with pytest.raises(UnknownNameError, match=r"'Relay\.height' has no value"):
        solution[model["Relay.height"]]
    model.save(tmp_path / "gusts")
    assert "<random " in (tmp_path / "gusts" / "Relay.xml").read_text()
    for again in (copy.deepcopy(model), robochoc.Model.load(tmp_path / "gusts")):
        assert again.solve("dpop").cost == solution.cost


def test_values_of_a_policy_are_the_users() -> None:
    model = robochoc.Model("words")
    wind = model.random("wind", {0: 0.5, 1: 0.5})
    sail = model.robot("boat").variable("sail", ["small", "large"])
    later = model.robot("crew").variable("rest", ["yes", "no"])
    tide = model.random("tide", {-1: 0.25, 1: 0.75}, seen_by=[later])
    model.add((sail == "small") | (wind == 0), (later == "yes") | (tide == 1), (later == "no") | (tide == -1))
    solution = model.solve("abt")
    assert dict(solution.values) == {"boat.sail": "small", "crew.rest.tide.m1": "yes", "crew.rest.tide.1": "no"}


@looped(
    ("arguments", "message"),
    [
        (("g", {0: 1 / 3, 1: 2 / 3}), "a probability is not an exact decimal"),
        (("g", {0: 0.5, 1: 0.6}), "the probabilities of 'g' have the sum 1.1"),
        (("g", {0: 1.5, 1: -0.5}), "the probability of an outcome is not positive"),
        (("g", {}), "0 outcomes"),
        (("g", {"a": 1}), "the outcome 'a' is not an integer"),
        (("g", {True: 1}), "the outcome True is not an integer"),
        (("g", [0, 1]), "invalid distribution"),
        (("wind", {0: 1}), "variable 'wind' exists already"),
        (("a b", {0: 1}), "variable 'a b' is not a valid name"),
    ],
)
def test_mistakes_are_named(arguments: tuple[str, object], message: str) -> None:
    with pytest.raises(ModelError) as refused:
        gusts().random(*arguments)
    assert message in str(refused.value)


def test_seen_by_is_a_list_of_variables() -> None:
    model = gusts()
    for seen_by in ("Relay.height", model["Relay.height"], 3):
        with pytest.raises(ModelError, match="invalid seen_by"):
            model.random("g", {0: 1}, seen_by=seen_by)  # type: ignore[arg-type]


def test_what_only_chance_decides_is_refused() -> None:
    model = gusts()
    wind = model["wind"]
    with pytest.raises(ModelError, match="wind in seen_by is not a variable of a robot"):
        model.random("more", {0: 1}, seen_by=[wind])
    model.minimize(wind * 2)
    with pytest.raises(ModelError, match="over wind only, which no robot decides"):
        model.solve()
