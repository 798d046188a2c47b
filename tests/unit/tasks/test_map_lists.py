"""Lists with a map: ways lead around walls, and what a robot cannot reach it cannot do."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

import robochoc
from robochoc.formats.team_reader import GROUND_FILE
from robochoc.maps.ground_map import read_ground_map
from robochoc.run import Options, Runtime, solve
from tests.support.foreign_problems import optimum
from tests.support.program import ROOT
from tests.support.random_task_lists import Meaning, random_list, read_or_refused, rounded_fraction, written
from tests.support.small_maps import SmallMap
from tests.support.task_lists import imported, mistakes

BUILDING = ROOT / "docs" / "examples" / "building" / "building.yaml"
LIST = f"""map: {BUILDING}
tours: yes
robots:
  ann: {{at: [1, 1], most: 2}}
  bob: {{at: [8, 1], radius: 0.6}}
tasks:
  left: {{at: [1, 5], worth: 10}}
  right: {{at: [9, 5], worth: 22}}
"""
_UNREACHED = Fraction(10**18)


class MapMeaning(Meaning):
    """The meaning of a list on a map."""

    def __init__(self, told: dict[str, Any], small: SmallMap) -> None:
        super().__init__(told)
        self.small = small

    def length(self, start: Sequence[object] | None, end: Sequence[object] | None, places: int) -> Fraction:
        if not start or not end:
            return Fraction()
        first, last = (pixel for place in (start, end) for pixel in self.small.free if self.small.place(pixel) == place)
        found = self.small.length(first, last)
        if found is None:
            return _UNREACHED
        return rounded_fraction(found, places)


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("count", [30, pytest.param(400, marks=pytest.mark.slow)])
def test_random_lists_on_maps_have_the_optimum_of_all_allocations(count: int, tmp_path: Path) -> None:
    chance, solved = Random(f"maps {count}"), 0
    while solved < count:
        small, told = SmallMap.drawn(chance), random_list(chance)
        for one in (*told["robots"].values(), *told["tasks"].values()):
            if one and "at" in one:
                one["at"] = small.place(chance.choice(small.free))
        told = {**told, "distance": "map", "map": small.write(tmp_path), "radius": 0}
        meaning = MapMeaning(told, small)
        if [*meaning.refusals()]:
            continue
        path = tmp_path / "list.yaml"
        path.write_text(written(told, "block"))
        team, error = read_or_refused(path)
        assert team is not None, error
        assert optimum(team) == meaning.best(), path.read_text()
        solved += 1


def test_travel_times_are_those_of_the_shortest_ways(tmp_path: Path) -> None:
    chance = Random("travel")
    for _ in range(20):
        small = SmallMap.drawn(chance)
        pixels = chance.sample(small.free, min(6, len(small.free)))
        times = robochoc.travel_times(
            tmp_path / small.write(tmp_path), [small.place(one) for one in pixels], radius=0, speed=0.5
        )
        for place, start in enumerate(pixels):
            for other, end in enumerate(pixels):
                found = small.length(start, end)
                assert times[place, other] == pytest.approx(np.inf if found is None else float(found) / 0.5)


def test_a_robot_does_only_what_it_can_reach(tmp_path: Path) -> None:
    team = imported(LIST, tmp_path).team
    assert [[one.name for one in robot.variables] for robot in team.robots] == [
        ["ann.left", "ann.right", "ann.tour"],
        ["bob.right", "bob.tour"],
    ]
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    times = robochoc.travel_times(BUILDING, [[1, 1], [1, 5], [8, 1], [9, 5]])
    assert float(outcome.cost or 0) == 32 - round(times[0, 1]) - round(times[2, 3])


def test_the_map_is_in_the_folder(tmp_path: Path) -> None:
    ground = read_ground_map(imported(LIST.replace("[9, 5]", "[9, 5.25]"), tmp_path).files[GROUND_FILE])
    assert ground.walls is not None
    assert (ground.scale, ground.walls.radius, ground.walls.speed) == (0.25, 0.6, 1.0)
    assert ground.places == {"ann": (1.0, 1.0), "bob": (8.0, 1.0)}


@pytest.mark.parametrize(
    ("now", "then", "told"),
    [
        ("[1, 5]", "[0, 4]", "7: the task 'left' at 0,4 is in a wall, or in unknown space (move it)"),
        ("[1, 5]", "[1, 50]", "7: the task 'left' at 1,50 is not on the map, which lies between"),
        ("[1, 5]", "[1, 5, 0]", "a place has a different number of coordinates"),
        ("at: [8, 1]", "at: [8, 0.3]", "5: the robot 'bob' does not fit at its place: an obstacle is nearer than"),
        ("radius: 0.6", "radius: 600", "5: the radius 600 m is more than 100 pixels of this map"),
        ("building.yaml", "buildings.yaml", "1: the map "),
        ("tours: yes", "distance: streets", "1: has a map and distance: streets (delete one of them)"),
        (
            f"map: {BUILDING}",
            f"map: {BUILDING}\nradius: 1000",
            "more than 100 pixels of this map (use a smaller radius)",
        ),
        (f"map: {BUILDING}", "radius: 0.3", "1: the list has a radius, but there is no map"),
        (f"map: {BUILDING}", "distance: map", "1: has distance: map, but no map (write map: FILE)"),
        (f"map: {BUILDING}\n", "", "4: the robot 'bob' has a radius, but there is no map"),
    ],
)
def test_mistakes_have_their_line(now: str, then: str, told: str, tmp_path: Path) -> None:
    assert told in mistakes(LIST.replace(now, then), tmp_path)


@pytest.mark.parametrize(
    ("places", "options", "told"),
    [
        ([[1, 1, 1]], {}, "write X and Y only"),
        ([1, 1], {}, "places has the shape"),
        ([[0, 4]], {}, "place 0 at 0,4 is in a wall"),
        ([[1, float("nan")]], {}, "place 0 is .* use finite numbers"),
        ([["a", "b"]], {}, "places is not an array of numbers"),
        ([[1, 1]], {"radius": float("inf")}, "radius is inf"),
        ([[1, 1]], {"speed": "x"}, "speed is 'x'"),
        ([[1, 1]], {"radius": -1}, "radius is -1"),
        ([[1, 1]], {"radius": 100}, "more than 100 pixels"),
        ([[1, 1]], {"speed": 0}, "speed is 0"),
    ],
)
def test_travel_times_refuse_what_they_cannot_use(
    places: Any,  # noqa: ANN401 - also wrong ones
    options: dict[str, float],
    told: str,
) -> None:
    with pytest.raises(robochoc.OptionError, match=told):
        robochoc.travel_times(BUILDING, places, **options)


def test_travel_times_of_no_places_and_in_space() -> None:
    assert robochoc.travel_times(BUILDING, np.zeros((0, 2))).shape == (0, 0)
    house = ROOT / "docs" / "examples" / "house" / "house.bt"
    times = robochoc.travel_times(house, np.array([[2, 2, 1], [6, 4, 3.5]]))
    assert times[0, 1] == times[1, 0]
    assert 4 < times[0, 1] < 20
