"""What notebooks show: teams, models, outcomes and scenes as HTML, in which foreign texts are texts."""

from __future__ import annotations

import json
import re
from decimal import Decimal
from pathlib import Path

from lxml import html

import robochoc
from robochoc.formats.result import result_json
from robochoc.modelling.html_tables import MAX_ROWS, table
from robochoc.modelling.team_html import MAX_ROBOTS
from tests.support.program import ROOT

HOSTILE = "<script>alert('1')</script>&\"'\u202e"


def words(page: str) -> str:
    """Return the text of a piece of HTML."""
    return " ".join(" ".join(map(str, html.fromstring(page).itertext())).split())


def charging() -> robochoc.Model:
    model = robochoc.Model("charging")
    slots = [model.robot(f"drone{n}").variable("slot", range(1, 4)) for n in range(3)]
    model.add(robochoc.all_different(slots))
    model.minimize(sum(slots))
    return model


def test_a_model_shows_robots_constraints_and_the_graph() -> None:
    model = charging()
    shown = model._repr_html_()
    said = words(shown)
    assert "charging 3 robots, 3 variables, 6 constraints: a DisWCSP, minimised" in said
    assert "ne(drone0.slot,drone1.slot)" in said
    assert shown.count("<line ") == 3
    assert shown.count("<circle ") == 3
    assert repr(model) == "<model charging: 3 robots, 3 variables, 1 constraint>"
    assert repr(model.team) == "<team charging: 3 robots>"
    assert model.team._repr_html_() == shown


def test_a_problem_from_files_shows_itself_too() -> None:
    problem = robochoc.load(ROOT / "docs/examples/patrol")
    assert "4 robots, 4 variables" in words(problem._repr_html_())
    assert repr(problem) == "<problem patrol: 4 robots, 14 constraints>"


def test_an_outcome_shows_values_epochs_and_what_it_took() -> None:
    told = robochoc.load(ROOT / "docs/examples/rescue").solve("dynabt", runtime="simulator")
    said = words(told._repr_html_())
    assert "rescue: solution for all 7 robots" in said
    assert "Spare spare 2" in said
    assert "2 +Spare 7 solution" in said
    assert re.search(r"messages bytes NCCCs checks seconds 131 ", said)


def test_users_values_are_shown_and_escaped() -> None:
    model = robochoc.Model(HOSTILE)
    x = model.robot("a").variable("x", [HOSTILE, "other"])
    y = model.robot("b").variable("y", [HOSTILE, "other"])
    model.add(x != y, x == HOSTILE)
    told = model.solve("abt", runtime="simulator")
    for shown in (model._repr_html_(), told._repr_html_()):
        assert "<script" not in shown
        assert "alert('1')" not in shown.replace("&#x27;", "'") or "&lt;script&gt;" in shown
        assert "\u202e" not in shown
        assert "<script>alert" in words(shown)


def test_an_unfinished_model_shows_what_is_missing() -> None:
    model = robochoc.Model()
    model.robot("a")
    assert "a has no variable" in words(model._repr_html_())


def test_long_tables_and_large_graphs_are_cut() -> None:
    assert "... and 3 more" in table(("n",), [(n,) for n in range(MAX_ROWS + 3)])
    model = robochoc.Model()
    flags = [model.robot(f"r{n}").boolean("on") for n in range(MAX_ROBOTS + 1)]
    model.add(flags[0] != flags[1])
    assert "<svg" not in model._repr_html_()


def test_the_scene_is_a_page_in_a_frame_that_reaches_nothing(tmp_path: Path) -> None:
    model = charging()
    for number, robot in enumerate(model.robots.values()):
        robot.topic(f"/{robot.name}", x=robot["slot"], y=number + 1, z=1)
    scene = model.solve("dpop", runtime="simulator").scene(height=300)
    (frame,) = html.fromstring(f"<div>{scene._repr_html_()}</div>").iter("iframe")
    assert frame.get("sandbox") == "allow-scripts"
    assert frame.get("srcdoc") == scene.html
    scene.save(tmp_path / "scene.html")
    assert (tmp_path / "scene.html").read_text() == scene.html
    assert "charging" in repr(scene)
    assert len(repr(scene)) < 100


def test_small_costs_have_no_exponents() -> None:
    model = robochoc.Model("small")
    x, y = (model.robot(name).variable("x", range(2)) for name in "ab")
    rule = model.add(x == y, cost=Decimal("0.000000015"))
    model.minimize(x * 1e-8 + y * Decimal("1.5") - 1e-9)
    assert repr(rule) == "<C1: (a.x == b.x), cost 0.000000015>"
    assert repr(x * 1e-8 + y * Decimal("1.5") - 1e-9) == "(0.00000001*a.x + 1.5*b.x - 0.000000001)"
    assert repr(x / 3) == "(1/3*a.x)"
    told = model.solve("dpop", runtime="simulator")
    assert repr(told) == "<small: optimal solution for all 2 robots, cost -0.000000001; dpop, simulator>"
    for shown in (model._repr_html_(), told._repr_html_()):
        assert not re.search("[0-9]E-", shown)
    assert "0.000000015" in model._repr_html_()
    assert json.loads(result_json(told))["cost"] == -1e-9


def test_an_outcome_is_a_dictionary() -> None:
    told = charging().solve("dpop", runtime="simulator")
    assert told.to_dict() == json.loads(result_json(told))
    assert told.to_dict()["verdict"] == "optimal"
