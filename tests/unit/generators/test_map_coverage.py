"""Coverage of a map: lines of sight by other means, and the least cost by trying all."""

from __future__ import annotations

import itertools
from fractions import Fraction
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team, read_team, write_team
from robochoc.generators.maps.coverage import coverage, worth_of_a_cell
from robochoc.generators.maps.map_team import MapChoice, reachability_of
from robochoc.maps.occupancy.grid import read_occupancy_grid
from robochoc.maps.reachability.cells import Cells
from robochoc.maps.reachability.free_space import free_space
from robochoc.maps.reachability.line_of_sight import lines_of_sight
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.evaluation import best, digest
from tests.support.examples import examples
from tests.support.maps import drawn_rows, free_pixels, touched, write_map
from tests.support.program import ROOT

BUILDING = str(ROOT / "docs/examples/building/building.yaml")


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    team, _ = coverage(MapChoice(map=BUILDING, agents=3, cells=40), 3, sensing=2.5)
    assert {team.name: digest(team)} == {"coverage-building-3-3": "9972dfbcd9573c02"}


def seen_on(rows: list[str], cells: Cells, sensing: Fraction) -> dict[int, set[int]]:
    """Return the cells that are seen from each, pixel by pixel."""
    free = free_pixels(rows)
    solid = set(itertools.product(range(len(rows[0])), range(len(rows)))) - free
    size, (left, low) = cells.grid.resolution, cells.grid.origin
    found: dict[int, set[int]] = {}
    for one, other in itertools.product(cells.free, repeat=2):
        (a, b), (c, d) = cells.centre(one), cells.centre(other)
        if (a - c) ** 2 + (b - d) ** 2 <= sensing**2:
            start, end = ((a - left) / size, (b - low) / size), ((c - left) / size, (d - low) / size)
            if not any(touched(start, end, pixel) for pixel in solid):
                found.setdefault(one, set()).add(other)
    return found


@given(
    st.integers(3, 9),
    st.integers(3, 9),
    st.integers(0, 2**32),
    st.sampled_from(["-0.25", "0", "0.1"]),
    st.sampled_from(["0.5", "0.3", "0.75"]),
    st.sampled_from(["0", "1", "1.6", "9"]),
)
@examples(8)
def test_walls_are_in_the_way(columns: int, rows: int, seed: int, corner: str, side: str, sensing: str) -> None:
    drawn = drawn_rows(Random(seed), columns, rows, 0.15)
    with TemporaryDirectory() as folder:
        grid = read_occupancy_grid(write_map(Path(folder), drawn, origin=f"[{corner}, -0.25, 0]"))
    cells = Cells(grid, Fraction(side), free_space(grid.free, Fraction(0)))
    assert lines_of_sight(cells).visible_cells(Fraction(sensing)) == seen_on(drawn, cells, Fraction(sensing))


def least(choice: MapChoice, seed: int, sensing: Fraction, worth: Fraction) -> tuple[Fraction, Fraction]:
    """Return the least cost in pairs, and the least one if the union counted: by trying all, seen pixel by pixel."""
    reach = reachability_of(choice, Random(seed))
    rows = ["".join(".#"[not free] for free in row) for row in reach.cells.grid.free[::-1]]
    assert isinstance(reach.cells, Cells)
    seen = seen_on(rows, reach.cells, sensing)
    a_cell = worth_of_a_cell(reach, worth)
    pairs, unions = [], []
    for places in itertools.product(*reach.seconds):
        if len(set(places)) == len(places):
            time = sum(seconds[place] for seconds, place in zip(reach.seconds, places, strict=True))
            views = [seen[place] for place in places]
            twice = sum(len(one & other) for one, other in itertools.combinations(views, 2))
            everything = len(reach.cells.free)
            pairs.append(time + a_cell * (everything - sum(map(len, views)) + twice))
            unions.append(time + a_cell * (everything - len(set().union(*views))))
    return Fraction(min(pairs), 10), Fraction(min(unions), 10)


@looped("agents", [1, 2, 3])
def test_robots_see_as_much_as_can_be(agents: int, tmp_path: Path) -> None:
    for seed in range(2):
        choice = MapChoice(map=BUILDING, agents=agents, cells=16, within=20)
        made, ground = coverage(choice, seed, sensing=3, worth=4)
        write_team(made, tmp_path / f"{seed}")
        team = read_team(tmp_path / f"{seed}")
        check_team(team)
        in_pairs, as_union = least(choice, seed, Fraction(3), Fraction(4))
        assert best(team) == in_pairs >= as_union
        assert agents > 2 or in_pairs == as_union
        for protocol in ("central", "dpop", "syncbb", "afb", "bnb-adopt") if agents == 3 else ("central", "dpop"):
            found = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
            assert found.cost is not None
            assert Fraction(found.cost) == in_pairs, protocol
        assert ground.starts.keys() == {robot.name for robot in team.robots}


def test_robots_in_rooms_without_a_door_do_not_see_the_same(tmp_path: Path) -> None:
    path = write_map(tmp_path, ["##########", "#...##...#", "#...##...#", "##########"], origin="[-0.25, -0.25, 0]")
    team, _ = coverage(MapChoice(map=str(path), at="0.5,0.5 3,0.5", cell=0.5, radius=0))
    assert [len(variable.domain) for variable in team.variables.values()] == [6, 6]
    assert not [one for robot in team.robots for one in robot.shared]
    assert best(team) == 0  # each sees its room from where it stands


def test_what_is_worth_nothing_does_not_bring_robots_together() -> None:
    team, _ = coverage(MapChoice(map=BUILDING, agents=3, cells=16), worth=0)
    assert {one.name for robot in team.robots for one in robot.shared} == {"different"}
    assert best(team) == 0


def test_no_two_robots_stand_in_one_cell() -> None:
    team, _ = coverage(MapChoice(map=BUILDING, at="1.5,1.5 1.5,1.5", cell=0.5, within=4), worth=0)
    found = best(team)
    assert found is not None
    assert found > 0  # one of them has to leave
