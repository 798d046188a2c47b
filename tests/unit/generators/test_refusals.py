"""What generators refuse, and what they say."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import InvalidInputError
from robochoc.generators.coloring import coloring, coloring_of
from robochoc.generators.graphs import grid, scale_free, small_world, tree, uniform
from robochoc.generators.ising import ising
from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice
from robochoc.generators.maps.patrol import patrol
from robochoc.generators.meetings import meetings
from robochoc.generators.queens3d import MAX_N, QueensModel, queens3d
from robochoc.generators.random_csp import random_csp, random_on
from robochoc.generators.scenario import random_scenario
from robochoc.generators.sensors import Reach, grid_sensors, sensors
from robochoc.generators.stochastic import stochastic
from robochoc.generators.tasks import Skills, Travel, tasks
from robochoc.generators.tracking import tracking
from robochoc.model.cost_units import CostUnits
from tests.support.cases import cases, looped
from tests.support.maps import ROOMS, write_map
from tests.support.program import ROOT, robochoc_within

BUILDING = str(ROOT / "docs/examples/building/building.yaml")
HOUSE = str(ROOT / "docs/examples/house/house.bt")
NAN = float("nan")
Rows = list[tuple[Callable[[], object], str]]


def on_graphs() -> Rows:
    return [
        (lambda: scale_free(5, 5), "links is 5; it must be from 1 to 4"),
        (lambda: scale_free(1), "agents is 1"),
        (lambda: small_world(9, 3), "neighbours is 3; it must be even"),
        (lambda: small_world(4, 4), "neighbours is 4; it must be from 2 to 3"),
        (lambda: small_world(9, 4, 1.5), "rewiring is 1.5"),
        (lambda: grid(2000, 2000), "agents is 4000000"),
        (lambda: grid(0, 4), "rows is 0"),
        (lambda: tree(1_000_001), "agents is 1000001"),
        (lambda: scale_free(1_000_000, 6), "constraints is 5999964"),
        (lambda: small_world(1_000_000, 12), "constraints is 6000000"),
        (lambda: uniform(10_000, 5_000_001, "x"), "constraints is 5000001"),
        (lambda: uniform(9, 4, "x", connected=True).draw(Random(0)), "needs 8 constraints"),
        (lambda: random_on(tree(5), 3, 0.2, costs=CostUnits(places=2)), "give a maximum cost"),
        (lambda: random_on(tree(5), 3, 0.2, max_cost=3, costs=CostUnits(places=10)), "places is 10"),
        (lambda: random_on(grid(30, 30), 40, 0, max_cost=3), "more than 1,000,000"),
        (lambda: coloring_of(tree(5), 0), "colors is 0"),
        (lambda: coloring_of(tree(5), 3, conflicts="weighted", max_cost=0), "max-cost is 0"),
        (lambda: coloring(0, 3, 0), "agents is 0"),
        (lambda: coloring(3, 0, 1), "colors is 0"),
        (lambda: coloring(3, 3, 2.5), "degree is 2.5; among 3"),
        (lambda: coloring(3, 3, NAN), "degree is nan"),
        (lambda: coloring(3, 3, 1, conflicts="sof"), r"^conflicts='sof' is not allowed; did you mean 'soft'\?$"),
        (lambda: random_csp(0, 3, 0.5, 0.5), "agents is 0"),
        (lambda: random_csp(1_000_001, 3, 0.5, 0.5), "agents is 1000001"),
        (lambda: random_csp(10_000, 3, 1, 0), "constraints is 49995000"),
        (lambda: random_csp(3, 0, 0.5, 0.5), "domain is 0"),
        (lambda: random_csp(3, 3, -0.1, 0.5), "density is -0.1; it must be from 0 to 1"),
        (lambda: random_csp(3, 3, 1.1, 0.5), "density is 1.1"),
        (lambda: random_csp(3, 3, NAN, 0.5), "density is nan"),
        (lambda: random_csp(3, 3, 0.5, 2), "tightness is 2"),
        (lambda: random_csp(1000, 1000, 1, 1), "more than 1,000,000"),
        (
            lambda: random_csp(20, 2, 0.05, 0.5, connected=True),
            "needs 19 constraints, and the density makes 10",
        ),
        (lambda: random_csp(60, 2, 59 / 1770, 0.5, connected=True), "increase the density"),
        (lambda: random_csp(3, 3, 0.5, 0, max_cost=-1), "max-cost is -1; it must be from 0 to 1000000"),
        (lambda: random_csp(3, 3, 0.5, 0, max_cost=1_000_001), "max-cost is 1000001; it must be from 0 to 1000000"),
        (
            lambda: random_csp(100, 100, 0.1, 0, max_cost=5),
            "together have 4,950,000 pairs of values, more than 1,000,000",
        ),
        (
            lambda: random_csp(6, 4, 0.6, 0.25, asymmetric=True),
            "asymmetric problem requires costs; give a maximum cost",
        ),
    ]


def of_families() -> Rows:
    return [
        (lambda: ising(1, 3), "rows is 1"),
        (lambda: ising(1001, 1000), "rows x columns is 1001000"),
        (lambda: ising(3, 3, places=10), "places is 10"),
        (lambda: ising(3, 3, coupling=-1), "coupling is -1"),
        (lambda: ising(3, 3, field=NAN), "field is nan"),
        (lambda: meetings(0, 3, 1, 3), "agents is 0"),
        (lambda: stochastic(agents=3, domain=2, reach=4), "reach is 4; it must be from 1 to 3"),
        (lambda: stochastic(agents=3, domain=2, outcomes=11), "outcomes is 11"),
        (lambda: stochastic(agents=3, domain=2, observed=NAN), "observed is nan"),
        (lambda: stochastic(agents=1, domain=2, random=9, outcomes=3, reach=1, observed=1), "more than 4,096 joint"),
        (lambda: meetings(3, 3, 4, 3), "participants is 4; it must be from 1 to 3"),
        (lambda: meetings(3, 3, 2, 0), "slots is 0"),
        (lambda: meetings(3, 3, 2, 3, max_length=4), "max-length is 4; it must be from 1 to 3"),
        (lambda: meetings(3, 3, 2, 3, max_value=0), "max-value is 0"),
        (lambda: meetings(3, 3, 2, 3, model="private"), "private"),
        (lambda: meetings(3, 2, 2, 4, model="x"), r"^model='x' is not allowed; expected "),
        (lambda: queens3d(0), "n is"),
        (lambda: queens3d(-1), "n is"),
        (lambda: queens3d(MAX_N + 1), "n is"),
        (lambda: queens3d(3, "ful"), r"^model='ful' is not allowed; did you mean 'full'\?$"),
        (lambda: queens3d(3, robots="x"), r"^robots='x' is not allowed; expected cells, rows$"),
        (lambda: sensors(0, 1), "sensors is 0"),
        (lambda: sensors(3, 1, visibility=1.2), "visibility is 1.2"),
        (lambda: sensors(3, 1, compatibility=NAN), "compatibility is nan"),
        (lambda: sensors(3, 1, needed=11), "needed is 11"),
        (lambda: sensors(3, 1, visibility=0), "no sensor sees target 1"),
        (lambda: sensors(3, 1, visibility=0, model="sensors"), "no sensor sees target 1"),
        (lambda: sensors(3, 1, model="target"), r"^model='target' is not allowed; did you mean 'targets'\?$"),
        (lambda: sensors(200, 30, visibility=1), "1,200,000 pairs of sensors see the same target"),
        (lambda: grid_sensors(1, 3, 1), "rows is 1"),
        (lambda: grid_sensors(2, 3, 3), "targets is 3; it must be from 1 to 2"),
        (lambda: grid_sensors(2, 3, 1, reach=Reach(sight=0)), "sight is 0"),
        (lambda: tracking(5, 1, 2), "agents is 5; it must be from 1 to 4"),
        (lambda: tracking(1, 5, 2), "targets is 5"),
        (lambda: tracking(1, 1, 101), "side is 101"),
        (lambda: tracking(20, 1, 5, sensing=5), "20 robots can get near target 1"),
        (lambda: tracking(1000, 9, 100, mobility=50), "1,000 robots can go to 10,000 cells each"),
        (lambda: tasks(0, 1), "agents is 0"),
        (lambda: tasks(1, 1, skills=Skills(2, 3)), "skilled is 3; it must be from 1 to 2"),
        (lambda: tasks(1, 1, travel=Travel(places=10)), "places is 10"),
    ]


def of_scenarios() -> Rows:
    team = random_csp(3, 1, 0, 0)
    kinds = ["remove-value", "remove-constraint"]
    return [
        (
            lambda: random_scenario(team, 1, 1, kinds=kinds),
            "no further change of the kinds remove-value, remove-constraint",
        ),
        (lambda: random_scenario(team, 0, 1), "events is 0"),
        (lambda: random_scenario(team, 1, NAN), "rate is nan"),
        (lambda: random_scenario(random_scenario(team, 1, 1), 1, 1), "has a scenario already"),
        (lambda: random_scenario(team, 1, 0.1, kinds=["x"]), r"^kinds='x' is not allowed; expected "),
    ]


@looped("rows", [on_graphs, of_families, of_scenarios])
def test_impossible_problems(rows: Callable[[], Rows]) -> None:
    refuse(rows())


def test_too_many_constraints(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.generators.draws.MAX_CONSTRAINTS", 100)
    monkeypatch.setattr("robochoc.generators.maps.coverage.MAX_TUPLES", 10_000)
    refuse(
        [
            (lambda: meetings(1, 20, 1, 3), "more than 100 constraints"),
            (lambda: sensors(2, 9, visibility=1), "more than 100 constraints"),
            (lambda: tasks(20, 1), "more than 100 constraints"),
            (lambda: coverage(MapChoice(map=BUILDING, agents=2, cell=0.5)), "more than 10,000 pairs"),
        ]
    )
    monkeypatch.setattr("robochoc.maps.reachability.line_of_sight.MAX_PAIRS", 100)
    with pytest.raises(ValueError, match="pairs of cells are within the sensing range, more than 100"):
        coverage(MapChoice(map=BUILDING, agents=2))


def refuse(rows: Rows) -> None:
    with cases() as each:
        for make, said in rows:
            with each(said), pytest.raises(ValueError, match=said):
                make()


# On maps


def test_texts_are_members_of_enums() -> None:
    assert queens3d(3, "full") == queens3d(3, QueensModel.FULL)


def test_formations_on_a_map(tmp_path: Path) -> None:
    rooms = str(write_map(tmp_path, ROOMS))
    with cases() as each:
        for how, shape, said in (
            ({"agents": None}, {}, "agents is missing"),
            ({"agents": 3, "at": "1,1 2,1"}, {}, "agents is 3, but at has 2 places"),
            ({"agents": 101}, {}, "agents is 101; it must be from 1 to 100"),
            ({"at": "1;1"}, {}, "at has '1;1'; expected places in metres"),
            ({"at": "9,9"}, {}, "robot 1 at 9,9 is not on the map"),
            ({"at": "0.2,1"}, {}, "robot 1 at 0.2,1 does not fit there"),
            ({"at": "0.7,1", "radius": 0.45}, {}, "robot 1 at 0.7,1 does not fit there"),
            ({"radius": 3}, {}, "no pixel is free for a robot of the radius 3 m"),
            ({"radius": 51}, {}, "the radius 51 m is more than 100 pixels"),
            ({"speed": 0}, {}, "speed is 0"),
            ({"cell": 5}, {}, "no cell of 5 m is free"),
            ({"cell": 0.001}, {}, "4501 columns and 3501 rows; at most 1000 are allowed"),
            ({"cell": 0.5, "cells": 3}, {}, "free, more than 3"),
            ({"agents": 40, "cell": 0.5}, {}, "40 robots do not fit on"),
            ({}, {"shape": "ring"}, "shape 'ring' is not one of line, column"),
            ({}, {"anchor": "1,1 2,2"}, "anchor has 2 places; give one place"),
            ({}, {"spacing": 0}, "spacing is 0"),
            (
                {"at": "1,1 3.5,1", "within": 1.5, "cell": 0.5, "radius": 0},
                {"anchor": "1,1", "spacing": 0.5},
                "robot 2 cannot reach any slot",
            ),
        ):
            choice = {"map": rooms, **({} if "at" in how else {"agents": 2}), **how}
            with each(said), pytest.raises(ValueError, match=said):
                formation(MapChoice(**choice), **shape)  # type: ignore[arg-type]


@looped(
    ("text", "said"),
    [
        ("1,2,3", "offsets.txt:1: invalid offset '1,2,3'"),
        ("0,0", "has 1 slots .*expected from 2"),
        ("0,0\n" * 101, "has 101 slots"),
    ],
)
def test_offsets(tmp_path: Path, text: str, said: str) -> None:
    choice = MapChoice(map=str(write_map(tmp_path, ROOMS)), agents=2)
    file = tmp_path / "offsets.txt"
    file.write_text(text)
    with pytest.raises(InvalidInputError, match=said):
        formation(choice, shape=str(file))


def test_coverages_and_patrols() -> None:
    building = partial(MapChoice, map=BUILDING)
    three = building(agents=3)
    refuse(
        [
            (lambda: coverage(building(agents=2), sensing=-1), "sensing is -1"),
            (lambda: coverage(building(agents=2), worth=20_000), "worth is 20000"),
            (lambda: coverage(building(at="1.1,1.1", within=0)), "robot 1 cannot reach any cell"),
            (lambda: patrol(three, rounds=3), "3 robots make 9 visits, more than 6 points"),
            (lambda: patrol(three, points=101), "points is 101"),
            (lambda: patrol(three, rounds=5), "rounds is 5"),
            (lambda: patrol(three, points=50, rounds=3), "50 points in 3 rounds"),
            (lambda: patrol(building(agents=1, cells=9), points=10), "fewer than 10 points"),
            (lambda: patrol(building(agents=1), idle=-1), "idle is -1"),
            (lambda: patrol(building(agents=1), apart=-1), "apart is -1"),
            (lambda: patrol(building(agents=1), visit="1 2"), "visit has '1'"),
            (
                lambda: patrol(building(at="1,1 9,5", within=3, cell=0.5), visit="1,1 1,2"),
                "robot 2 cannot reach any point",
            ),
        ]
    )


def test_teams_in_space() -> None:
    house = partial(MapChoice, map=HOUSE)
    refuse(
        [
            (lambda: formation(house(at="1,1")), "at has '1,1'; expected X,Y,Z on a three-dimensional map"),
            (lambda: formation(house(agents=2), anchor="1,1"), "anchor has '1,1'; expected X,Y,Z"),
            (lambda: patrol(house(agents=2), visit="1,1 2,2"), "visit has '1,1'; expected X,Y,Z"),
            (lambda: formation(house(at="1,1,1,1")), "at has '1,1,1,1'; expected places in metres"),
            (lambda: formation(house(at="1,1,99")), "robot 1 at 1,1,99 is not on the map"),
            (lambda: formation(house(at="1,1,2.2")), "robot 1 at 1,1,2.2 does not fit there"),
            (lambda: formation(house(agents=2, radius=3)), "no voxel is free for a robot of the radius 3 m"),
            (lambda: formation(house(agents=2, radius=26)), "the radius 26 m is more than 100 pixels"),
            (lambda: formation(house(agents=2, cell=0.005)), "1701 columns, 1301 rows and 1001 levels"),
            (lambda: formation(house(agents=2, cell=0.5, cells=3)), "free, more than 3"),
            (lambda: formation(house(agents=2, cell=3)), "no cell of 3 m is free"),
            (
                lambda: formation(MapChoice(map=BUILDING, at="1,1,1")),
                "at has '1,1,1'; expected X,Y on a map of the ground",
            ),
        ]
    )


# On the command line


@pytest.mark.usefixtures("in_a_folder")
def test_wrong_usage_writes_nothing(tmp_path: Path) -> None:
    random = "random --agents 5 --domain 3 --density 0.4"
    with cases() as each:
        for words, said in (
            (f"{random} --tightness 0.3 --density 1.5", "density is 1.5"),
            (f"{random} --tightness nan", "'nan' is not a finite number"),
            (f"{random} --tightness 0.3 --agents 0", "--agents"),
            (f"{random} --tightness 0.3 --seed -1", "--seed"),
            (f"{random} --tightness 0.3 --density 0.1 --connected", "needs 4 constraints"),
            (random, "Missing option '--tightness'"),
            (f"{random} --max-cost -1", "--max-cost"),
            (f"{random} --max-cost 1000001", "--max-cost"),
            ("coloring --agents 5 --degree 5", "degree is 5.0; among 5 robots it must be from 0 to 4"),
            ("coloring --agents 5", "--degree"),
        ):
            with each(words):
                done = robochoc_within("generate", *words.split())
                assert done.returncode == 2
                assert said in done.stderr
                assert not list(tmp_path.iterdir())
