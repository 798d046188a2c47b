"""Models and teams: from files and back, with what changes over time."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from enum import Enum
from pathlib import Path

import pytest

import robochoc
from robochoc.formats import InvalidInputError, read_team
from robochoc.model.problem import AddAgent, Robot, Team
from tests.support.program import ROOT

Kind = Enum("Kind", ["FIRST", "SECOND"])
TEAMS = ["docs/examples/" + name for name in ("arm", "hangar", "patrol", "rescue", "secrets")]


def plain(team: Team) -> list[Robot]:
    """Return the robots of a team, whose children come in the order of their names."""
    return [replace(one, children=tuple(sorted(one.children, key=lambda c: c.name))) for one in team.robots]


def changing() -> tuple[robochoc.Model, list[str]]:
    """Return a model whose robots leave, come and change, and what opens its epochs."""
    model = robochoc.Model("rescue")
    a, b, c = (model.robot(name) for name in "abc")
    x, y, z = (robot.variable("level", range(1, 4)) for robot in (a, b, c))
    mode = b.variable("mode", ["fast", "slow"])
    model.add(x != y)
    model.add(y != z, name="yz")
    model.after_solution().remove_robot(a)
    coming = model.after_solution()
    spare = coming.robot("spare", weight=2)
    level = spare.variable("level", range(1, 4))
    coming.add(level != y, level >= 2, (mode == "fast").implies(level == 3))
    coming.add(abs(y - z) >= 2, name="apart")
    closing = model.after_messages(20)
    closing.remove_value(y, 3)
    closing.remove_constraint("yz")
    closing.add_value(z, 5)
    closing.add_value(mode, "off")
    closing.add((mode == "off") | (z != 5))
    model.after_solution().remove_constraint("apart")
    opened = ["the start", "-a", "+spare, +apart (b, c)"]
    opened.append("b.level without 3, -yz (b, c), c.level with 5, b.mode with off, +C3 (b, c)")
    return model, [*opened, "-apart (b, c)"]


@pytest.mark.parametrize("name", TEAMS)
def test_a_team_is_the_same_as_a_model_and_saved(name: str, tmp_path: Path) -> None:
    team = read_team(ROOT / name)
    model = robochoc.Model.load(ROOT / name)
    assert plain(model.team) == plain(team)
    assert model.team.scenario == team.scenario
    model.save(tmp_path / team.name)
    again = read_team(tmp_path / team.name)
    assert plain(again) == plain(team)
    assert again.scenario == team.scenario


def test_a_loaded_team_is_solved_and_extended() -> None:
    model = robochoc.Model.load(ROOT / "docs/examples/patrol")
    assert model.solve("dpop", runtime="simulator").cost == 6
    lead, south = model["lead"], model["south"]
    model.add(lead + south >= 5, name="high")
    model.minimize(Decimal("0.25") * lead)
    extra = model.robot("Extra").variable("level", ["up", "down"])
    model.add((extra == "up").implies(south == 3))
    told = model.solve("dpop", runtime="simulator")
    assert told.cost == model.solve("central").cost
    assert told[lead] + told[south] >= 5  # type: ignore[operator]


def test_events_happen_and_are_saved(tmp_path: Path) -> None:
    model, opened = changing()
    told = model.solve("dynabt", runtime="simulator")
    assert [epoch.opened_by for epoch in told.epochs] == opened
    assert [epoch.verdict for epoch in told.epochs] == ["solution"] * 5
    assert told.verified
    model.save(tmp_path / "rescue")
    loaded = robochoc.Model.load(tmp_path / "rescue")
    assert loaded.team.scenario == read_team(tmp_path / "rescue").scenario
    again = loaded.solve("dynabt", runtime="simulator")
    assert [epoch.opened_by for epoch in again.epochs] == opened
    loaded.after_solution().remove_robot("c")
    assert loaded.solve("dynabt", runtime="simulator").epochs[-1].opened_by == "-c"
    loaded.save(tmp_path / "rescue", replace=True)
    assert len(read_team(tmp_path / "rescue").scenario) == 5


def test_nothing_half_written_is_left(tmp_path: Path) -> None:
    model, _ = changing()
    model.save(tmp_path / "team")
    before = {path: path.read_bytes() for path in (tmp_path / "team").rglob("*.xml")}
    with pytest.raises(InvalidInputError, match="exists already"):
        model.save(tmp_path / "team")
    model.robot("empty")
    with pytest.raises(robochoc.ModelError, match="empty has no variable"):
        model.save(tmp_path / "team", replace=True)
    assert {path: path.read_bytes() for path in (tmp_path / "team").rglob("*.xml")} == before
    assert [path.name for path in tmp_path.iterdir()] == ["team"]


def test_values_of_files_are_integers_and_symbols(tmp_path: Path) -> None:
    model = robochoc.Model("kinds")
    x = model.robot("a").variable("x", ["red", "green"])
    y = model.robot("b").variable("y", [Decimal("0.5"), Decimal("1.5")])
    model.add(x == "green")
    model.maximize(y - 0.1)
    model.save(tmp_path / "kinds")
    told = robochoc.Model.load(tmp_path / "kinds").solve("dpop", runtime="simulator")
    assert told.values == {"a.x": "green", "b.y": 3}
    assert told.cost == Decimal("1.4")
    assert robochoc.load(tmp_path / "kinds").solve("dpop", runtime="simulator")["a.x"] == "green"


def test_symbols_that_are_there_already_are_not_taken_for_new_texts() -> None:
    model = robochoc.Model("first")
    model.robot("a").variable("x", ["v1_2", "other"])
    more = robochoc.Model.of(model.team)
    new = more.robot("b").variable("y", ["1 2", "other"])
    more.add(new != more["a.x"], more["a.x"] == "v1_2", new != "other")
    assert more.solve("abt", runtime="simulator").values == {"a.x": "v1_2", "b.y": "1 2"}


def twice(value: int) -> int:
    return 2 * value


COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda model: pickle.loads(pickle.dumps(model)),  # noqa: S301 - its own
}


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_a_copy_of_a_model_is_a_model_of_its_own(copied: Callable[[robochoc.Model], robochoc.Model]) -> None:
    model = robochoc.Model("original")
    one, other = (model.robot(name) for name in "ab")
    x, y = one.variable("x", Kind), other.variable("y", range(4))
    model.add((x == Kind.FIRST) | (y > 1), robochoc.function(twice, y) <= 4)
    one.knows((x == Kind.FIRST).implies(y != 1))
    other.knows((x == Kind.SECOND) | (y != 3))
    event = model.after_solution()
    event.add(event.robot("c").variable("z", [1, 2]) == y)
    before = model.solve("abt", runtime="simulator").values

    again = copied(model)
    assert again.team == model.team
    assert again.solve("abt", runtime="simulator").values == before
    assert again["a.x"] is not x
    again.add(again["b.y"] != 0, name="more")
    again.add(again["a.x"] == Kind.SECOND)
    again.robot("d").boolean("flag")
    assert [rule.name for rule in again.constraints] == ["C1", "more", "C5"]
    assert (len(model.constraints), len(model.robots), model.team.name) == (1, 3, "original")
    with pytest.raises(robochoc.ModelError):
        again.add(y == 1)


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_deep_and_wide_terms_are_copied(copied: Callable[[robochoc.Model], robochoc.Model]) -> None:
    model = robochoc.Model()
    x = model.robot("a").variable("x", range(5))
    deep, wide = 1 * x, 1 * x
    for _ in range(99):
        deep = abs(deep - 1)
    for _ in range(12):
        wide = abs(wide) + wide
    model.add(deep >= 0, wide >= 0)
    assert copied(model).team == model.team


def test_what_pickle_does_not_take_it_says() -> None:
    model = robochoc.Model()
    x = model.robot("a").variable("x", range(3))
    model.add(robochoc.function(lambda value: value > 1, x))
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(model)
    assert copy.deepcopy(model).solve("abt", runtime="simulator")["a.x"] == 2


def test_a_robot_joins_below_robots_that_no_constraint_orders() -> None:
    """Its constraint of three goes with the lowest of those that are there, by the order and not by their names."""
    model = robochoc.Model()
    high, low = (model.robot(name, priority=rank).variable("x", range(3)) for name, rank in (("z", 1), ("a", 0)))
    event = model.after_solution()
    added = event.robot("m").variable("x", range(3))
    event.add(high + low + added <= 3)
    (change,) = model.team.scenario[0].changes
    assert isinstance(change, AddAgent)
    assert [(parent.name, len(parent.constraints)) for parent in change.robot.parents] == [("z", 0), ("a", 1)]
