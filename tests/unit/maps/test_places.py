"""Where on a map values are: by the generators' own cells, and what is no place."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

import msgspec
import pytest

from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.map_team import MapChoice, reachability_of
from robochoc.generators.maps.patrol import patrol
from robochoc.maps.ground_map import GroundMap
from robochoc.maps.places import MapPlaces
from robochoc.model.constraint import Domain, Variable
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import Robot, Team, Topic
from tests.support.maps import write_map
from tests.support.program import ROOT

ROWS = ["......", "......", "..##..", "......", "......"]


@pytest.mark.parametrize("origin", ["[0, 0, 0]", "[-7.3, 4.1, 0]"])
def test_they_are_the_centres_of_cells(tmp_path: Path, origin: str) -> None:
    choice = MapChoice(map=str(write_map(tmp_path, ROWS, origin=origin)), agents=2, radius=0, cell=0.5)
    team, ground = coverage(choice, 3)
    cells = reachability_of(choice, Random(3)).cells
    places = MapPlaces(team, ground)
    for robot in team.robots:
        for variable in robot.variables:
            for value in variable.domain:
                (place,) = places.places_of({variable.name: value}).values()
                assert place == tuple(map(float, cells.centre(value)))


def test_so_they_are_of_later_visits_and_in_three_dimensions(tmp_path: Path) -> None:
    choice = MapChoice(map=str(write_map(tmp_path, ROWS)), agents=2, radius=0, cell=0.5)
    team, ground = patrol(choice, 1, points=4, rounds=2)
    cells = reachability_of(choice, Random(1)).cells
    values = {name: variable.domain.ranges[0][0] for name, variable in team.variables.items()}
    assert MapPlaces(team, ground).places_of(values) == {
        name: tuple(map(float, cells.centre(value))) for name, value in values.items()
    }
    house = MapChoice(map=str(ROOT / "docs/examples/house/house.bt"), agents=2, cell=1)
    team, ground = coverage(house, 1)
    values = {name: variable.domain.ranges[0][0] for name, variable in team.variables.items()}
    assert {len(place) for place in MapPlaces(team, ground).places_of(values).values()} == {3}
    assert all(part == Fraction(part) for place in MapPlaces(team, ground).places_of(values).values() for part in place)


def robot(x: Expression, *more: Variable) -> Team:
    topic = Topic("/a", x=x, y=Constant(2), z=Constant(1))
    return Team("t", (Robot("A", (Variable("V", Domain("D", (range(5),))), *more), topics=(topic,)),))


def test_what_is_no_place_is_not_told() -> None:
    ground = GroundMap(9, 9, scale=0.5)
    plain = robot(Name("V"))
    assert MapPlaces(plain, ground).places_of({"V": 3}) == {"V": (1.5, 1.0)}
    assert MapPlaces(plain, None).places_of({"V": 3}) == {}
    assert MapPlaces(plain, msgspec.structs.replace(ground, scale=None)).places_of({"V": 3}) == {}
    assert MapPlaces(robot(Apply("div", (Constant(8), Name("V")))), ground).places_of({"V": 0}) == {}
    assert MapPlaces(robot(Apply("pow", (Constant(10), Constant(400)))), ground).places_of({"V": 1}) == {}
    huge = Apply("add", (Apply("pow", (Constant(10), Constant(400))), Name("V")))
    assert MapPlaces(robot(huge), ground).places_of({"V": 1}) == {}
    speed = Variable("S", Domain("E", (range(90, 95),)))
    assert MapPlaces(robot(Name("V"), speed), ground).places_of({"V": 3, "S": 91}) == {"V": (1.5, 1.0)}
    both = robot(Apply("add", (Name("V"), Name("S"))), speed)
    assert MapPlaces(both, ground).places_of({"V": 3, "S": 91}) == {}
