"""Problems on maps: what robots reach, by other means than the generators', and that answers are what maps say."""

from __future__ import annotations

import itertools
from fractions import Fraction
from math import floor
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team, read_team, write_team
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice, reachability_of
from robochoc.maps.ground_map import ground_map_json, read_ground_map
from robochoc.maps.occupancy.grid import OccupancyGrid, read_occupancy_grid, summed_area
from robochoc.maps.occupancy.packed import unpacked
from robochoc.maps.reachability.cell_size import cells_of, passable
from robochoc.maps.reachability.cells import Cells
from robochoc.maps.reachability.free_space import free_space
from robochoc.maps.reachability.path_lengths import UNREACHED, lengths_from
from robochoc.maps.reachability.reachability import Reachability
from robochoc.model.expression import evaluate
from robochoc.model.problem import Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.evaluation import best, digest
from tests.support.examples import examples
from tests.support.flights_on_maps import gaps
from tests.support.maps import ROOMS, Pixel, drawn_rows, fitting, free_pixels, ways, write_map
from tests.support.program import ROOT

BUILDING = str(ROOT / "docs/examples/building/building.yaml")


@pytest.fixture
def rooms(tmp_path: Path) -> str:
    return str(write_map(tmp_path, ROOMS))


def grid_of(rows: list[str], **how: str) -> OccupancyGrid:
    with TemporaryDirectory() as folder:
        return read_occupancy_grid(write_map(Path(folder), rows, **how))


def pixels(flags: np.ndarray) -> set[Pixel]:
    return {(x, y) for y, x in np.argwhere(flags).tolist()}


def answers(team: Team, protocol: str) -> tuple[Fraction, dict[str, int]]:
    found = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
    assert found.cost is not None
    return Fraction(found.cost), dict(found.assignment)


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    choice = MapChoice(map=BUILDING, agents=3, cells=40)
    teams = [formation(choice, 3, shape=shape, heading=30)[0] for shape in ("wedge", "circle")]
    assert {team.name: digest(team) for team in teams} == {
        "formation-building-wedge-3-3": "29326cb01c154856",
        "formation-building-circle-3-3": "482739f670eada8e",
    }


# Pixels, cells and ways


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32), st.sampled_from(["0", "0.4", "0.5", "0.8", "1.2"]))
@examples(60)
def test_a_robot_keeps_its_radius_from_all_that_is_not_free(columns: int, rows: int, seed: int, radius: str) -> None:
    drawn = drawn_rows(Random(seed), columns, rows)
    found = pixels(passable(grid_of(drawn).free, Fraction("0.4"), Fraction(radius)))
    assert found == fitting(drawn, Fraction(radius) / Fraction("0.4"))


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32), st.none() | st.integers(0, 180))
@examples(60)
def test_ways_are_the_shortest_and_cut_no_corner(columns: int, rows: int, seed: int, longest: int | None) -> None:
    drawn = drawn_rows(Random(seed), columns, rows, 0.35)
    free = free_pixels(drawn)
    flags = grid_of(drawn).free
    for x, y in sorted(free)[:2]:
        found = lengths_from((y, x), flags, longest)
        wanted = {pixel: length for pixel, length in ways((x, y), free).items() if longest is None or length <= longest}
        assert {(x, y): int(found[y, x]) for x, y in pixels(found != UNREACHED)} == wanted


@given(
    st.integers(1, 9),
    st.integers(1, 9),
    st.integers(0, 2**32),
    st.sampled_from(["0", "-0.25", "1.3", "-7.77"]),
    st.sampled_from(["0.5", "0.75", "1", "1.7", "0.2"]),
)
@examples(8)
def test_a_cell_is_free_where_all_its_pixels_are(columns: int, rows: int, seed: int, corner: str, side: str) -> None:
    drawn = drawn_rows(Random(seed), columns, rows, 0.1)
    grid = grid_of(drawn, resolution="0.5", origin=f"[{corner}, 0, 0]")
    cells = Cells(grid, Fraction(side), free_space(grid.free, Fraction(0)))
    free, known = free_pixels(drawn), set[tuple[int, int]]()
    for cell in range(cells.columns * cells.rows):
        x, y = cells.centre(cell)
        half = Fraction(side) / 2 - Fraction(1, 1000)
        inside = {
            (floor((x + right - Fraction(corner)) / Fraction("0.5")), floor((y + up) / Fraction("0.5")))
            for right in spread(half)
            for up in spread(half)
        }
        assert (cell in cells.free) is (inside <= free)
        walls = {(x, y) for x, y in inside if 0 <= x < columns and 0 <= y < rows and drawn[rows - 1 - y][x] == "#"}
        assert (cell in cells.blocked) is bool(walls)
        known |= inside
    assert known >= set(itertools.product(range(columns), range(rows)))


def spread(half: Fraction) -> list[Fraction]:
    """Return distances from -half to half, at most a pixel apart."""
    return [half * step / 4 for step in range(-4, 5)]


def test_a_cell_is_free_only_where_a_robot_fits_at_its_centre() -> None:
    grid = grid_of(["....."] * 5, origin="[-0.25, -0.25, 0]")
    assert len(cells_of(grid, Fraction(0), 100, Fraction(1, 2)).free) == 25
    assert len(cells_of(grid, Fraction(1, 2), 100, Fraction(1, 2)).free) == 9


def test_cells_are_as_small_as_their_number_allows() -> None:
    grid = grid_of(["." * 12] * 12, resolution="0.1", origin="[-0.05, -0.05, 0]")
    for most, side in ((144, "0.1"), (143, "0.2"), (25, "0.2"), (24, "0.3")):
        cells = cells_of(grid, Fraction(0), most)
        assert cells.side == Fraction(side)
        assert len(cells.free) <= most
    with pytest.raises(ValueError, match=r"49 cells of 0.2 m are free, more than 9"):
        cells_of(grid_of(["." * 14] * 14, resolution="0.1", origin="[-0.1, -0.1, 0]"), Fraction(0), 9, Fraction("0.2"))


def test_pixels_are_summed_once_for_all_sides_of_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map may have 4,000,000 pixels, and cells hundreds of pixels as sides."""
    grid = grid_of(["." * 40] * 40)
    sizes = []

    def counted(flags: np.ndarray) -> np.ndarray:
        sizes.append(flags.shape)
        return summed_area(flags)

    monkeypatch.setattr("robochoc.maps.occupancy.grid.summed_area", counted)
    assert cells_of(grid, Fraction(0), 4).side == 6  # of twelve pixels
    assert sizes == [(40, 40)]


def reached(rows: list[str], start: Pixel, radius: Fraction, seconds_a_pixel: Fraction) -> dict[Pixel, int]:
    """Return the tenths of seconds to each pixel that a robot can reach."""
    found = ways(start, fitting(rows, radius))
    return {pixel: floor(length * seconds_a_pixel * Fraction(2, 3) + Fraction(1, 2)) for pixel, length in found.items()}


@given(st.integers(3, 9), st.integers(3, 9), st.integers(0, 2**32), st.integers(1, 3))
@examples(40)
def test_robots_reach_what_lies_in_no_other_room(columns: int, rows: int, seed: int, agents: int) -> None:
    drawn = drawn_rows(Random(seed), columns, rows, 0.3)
    with TemporaryDirectory() as folder:
        choice = MapChoice(map=str(write_map(Path(folder), drawn)), agents=agents, radius=0.2, cell=0.5, speed=0.4)
        if len(free := free_pixels(drawn)) < agents:
            with pytest.raises(ValueError, match="free"):
                reachability_of(choice, Random(seed))
            return
        # Cells are pixels here, moved by half of one: each lies on a corner of four.
        path = Path(choice.map)
        path.write_text(path.read_text().replace("[0, 0, 0]", "[-0.25, -0.25, 0]"))
        reach = reachability_of(choice, Random(seed))
    assert len(set(reach.starts)) == agents
    for (x, y), seconds in zip(reach.starts, reach.seconds, strict=True):
        start = int(x * 2), int(y * 2)
        assert start in free
        wanted = reached(drawn, start, Fraction("0.4"), Fraction("0.5") / Fraction("0.4"))
        assert {reach.cells.coordinates(cell): time for cell, time in seconds.items()} == wanted


def disc_reaches(rows: list[str], start: tuple[float, float], radius: float) -> set[Pixel]:
    """Return the pixels that a disc gets to from a place in pixels, moved by sixteenths of a pixel.

    The disc is smaller by a sixteenth, as it may have to be moved beside its way.
    """
    steps = (np.arange(16 * len(rows[0])) + 0.5) / 16, (np.arange(16 * len(rows)) + 0.5) / 16
    x, y = np.meshgrid(*steps)
    apart = gaps(rows, 1, np.column_stack((x.ravel(), y.ravel()))).reshape(x.shape)
    left = {(column, row) for row, column in np.argwhere(apart >= radius - 1 / 16).tolist()}
    waiting, found = [(floor(16 * start[0]), floor(16 * start[1]))], set()
    while waiting:
        here = waiting.pop()
        found.add(here)
        beside = {(here[0] + right, here[1] + up) for right in (-1, 0, 1) for up in (-1, 0, 1)} & left
        left -= beside
        waiting += beside
    return {(column // 16, row // 16) for column, row in found}


@given(st.integers(3, 7), st.integers(3, 7), st.integers(0, 2**32), st.sampled_from(["0.2", "0.45", "0.7", "1.1"]))
@examples(25)
def test_ways_lead_where_a_disc_of_the_radius_gets(columns: int, rows: int, seed: int, radius: str) -> None:
    drawn = drawn_rows(Random(seed), columns, rows, 0.2)
    room = free_space(grid_of(drawn).free, Fraction(radius))
    for row, column in np.argwhere(room.passable).tolist()[:2]:
        found = pixels(lengths_from((row, column), room.passable, None, room.joined) != UNREACHED)
        parts = room.parts
        inside = room.points[row * parts : (row + 1) * parts, column * parts : (column + 1) * parts]
        up, right = np.argwhere(inside)[0].tolist()
        start = column + (right + 0.5) / parts, row + (up + 0.5) / parts
        assert found <= disc_reaches(drawn, start, float(radius))


@looped(
    ("side", "door", "radius", "rooms"),
    [("0.25", 1, 0.2, 1), ("0.25", 2, 0.2, 2), ("0.25", 1, 0.12, 2), ("0.05", 8, 0.2, 1), ("0.05", 9, 0.2, 2),
     ("0.5", 1, 0.24, 2), ("0.5", 1, 0.26, 1), ("0.1", 5, 0.2, 2), ("0.1", 4, 0.21, 1)],
)  # fmt: skip
def test_a_door_is_a_way_for_robots_that_fit_through(
    tmp_path: Path, side: str, door: int, radius: float, rooms: int
) -> None:
    width, height = (int(size / Fraction(side)) for size in (4, 2))
    solid = {(width // 2, y) for y in range(height) if not 1 <= y < 1 + door}
    rows = ["".join("#" if (x, y) in solid else "." for x in range(width)) for y in range(height)]
    assert len(reached_halves(tmp_path, rows, side, "1,1", radius)) == rooms


def reached_halves(folder: Path, rows: list[str], side: str, at: str, radius: float) -> set[bool]:
    """Return in which halves of a map, above its diagonal and below it, a robot gets to cells of half a metre."""
    path = write_map(folder, rows, resolution=side)
    reach = reachability_of(MapChoice(map=str(path), at=at, radius=radius, cell=0.5), Random(0))
    middle = Fraction(side) * (len(rows) + len(rows[0])) / 2
    return {sum(reach.cells.centre(cell)) > middle for cell in reach.reached}


def test_a_robot_fits_between_pillars_at_two_corners_of_a_pixel_or_not(tmp_path: Path) -> None:
    """The pixel itself is free, and all around it are that hold no pillar."""
    rows = ["#......", ".......", "..#....", ".......", "....#..", ".......", "......#"]
    halves = [reached_halves(tmp_path, rows, "0.5", "0.75,0.75", radius) for radius in (0.3, 0.4)]
    assert [len(found) for found in halves] == [2, 1]


def test_who_has_little_time_gets_less_far(rooms: str) -> None:
    choice = MapChoice(map=rooms, at="1,1", cell=0.5, radius=0, speed=0.5)
    near, far = (
        reachability_of(MapChoice(**{**vars(choice), "within": time}), Random(0)).seconds[0] for time in (2.0, None)
    )
    assert near == {cell: time for cell, time in far.items() if time <= 20}
    assert 0 < len(near) < len(far)


# Formations


def check_answer(team: Team, reach: Reachability, assignment: dict[str, int]) -> None:
    """Hold an answer against the map: all cells are different, and ways lead there over pixels that are passable."""
    assert len(set(assignment.values())) == len(team.robots)
    fits = pixels(reach.cells.passable)
    for robot, start in zip(sorted(team.robots, key=lambda one: one.name), reach.starts, strict=True):
        topic, variable = robot.topics[0], robot.variables[0].name
        assert topic.x is not None
        assert topic.y is not None
        place = [evaluate(one, assignment) * reach.cells.side for one in (topic.x, topic.y)]
        (row, column), end = reach.cells.pixel(start) or (-1, -1), reach.cells.pixel((place[0], place[1])) or (-1, -1)
        assert (end[1], end[0]) in ways((column, row), fits)
        assert assignment[variable] in robot.variables[0].domain


@looped(
    ("shape", "seed", "protocols"),
    [
        ("line", 0, ("central", "dpop")),
        ("column", 1, ("central", "dpop")),
        ("wedge", 0, ("central", "dpop", "syncbb", "afb", "bnb-adopt")),
        ("circle", 1, ("central", "dpop")),
        ("grid", 1, ("central", "dpop")),
    ],
)
def test_formations_take_as_little_time_as_can_be(
    shape: str, seed: int, protocols: tuple[str, ...], tmp_path: Path
) -> None:
    choice = MapChoice(map=BUILDING, agents=4, cells=60)
    made, ground = formation(choice, seed, shape=shape, anchor="7,2", heading=90)
    write_team(made, tmp_path / "team")
    team = read_team(tmp_path / "team")
    check_team(team)
    reach = reachability_of(choice, Random(seed))
    slots = sorted({cell for variable in made.variables.values() for cell in variable.domain})
    assert len(slots) == 4
    totals = [
        sum(reach.seconds[robot][slot] for robot, slot in enumerate(order))
        for order in itertools.permutations(slots)
        if all(slot in reach.seconds[robot] for robot, slot in enumerate(order))
    ]
    wanted = best(team)
    assert wanted == Fraction(min(totals), 10)
    checked: list[dict[str, int]] = []
    for protocol in protocols:
        cost, assignment = answers(team, protocol)
        assert cost == wanted, protocol
        if assignment not in checked:
            check_answer(team, reach, assignment)
            checked.append(assignment)
    assert ground.scale == float(reach.cells.side)


def test_waypoints_are_metres_in_the_frame_of_the_map(tmp_path: Path) -> None:
    path = str(write_map(tmp_path, ROOMS, origin="[-7.3, 4.1, 0]"))
    choice = MapChoice(map=path, agents=2, radius=0)
    team, ground = formation(choice, 1)
    reach = reachability_of(choice, Random(1))
    assert ground.first == reach.cells.first != (0, 0)
    for protocol in ("dpop", "central"):
        check_answer(team, reach, answers(team, protocol)[1])


def test_slots_are_where_the_shape_is(tmp_path: Path) -> None:
    """In the open: ahead is x, to the left is y, and turned by 90 degrees ahead is y."""
    path = str(write_map(tmp_path, ["." * 20] * 20, origin="[-0.25, -0.25, 0]"))
    choice = MapChoice(map=path, at="1,1 1,2 1,3 1,4", radius=0, cell=0.5)

    cells = Cells(
        read_occupancy_grid(Path(path)), Fraction(1, 2), free_space(np.ones((20, 20), dtype=np.bool_), Fraction(0))
    )

    def slots(shape: str, heading: float = 0.0) -> list[tuple[float, float]]:
        team, _ = formation(choice, shape=shape, heading=heading, anchor="5,5", spacing=1)
        return sorted((float(x), float(y)) for x, y in map(cells.centre, team.variables["V1"].domain))

    assert slots("line") == [(5, 3.5), (5, 4.5), (5, 5.5), (5, 6.5)]
    assert slots("line", 90) == slots("column") == [(3.5, 5), (4.5, 5), (5.5, 5), (6.5, 5)]
    assert slots("wedge") == [(3, 3), (4, 4), (4, 6), (5, 5)]
    assert slots("grid") == [(4.5, 4.5), (4.5, 5.5), (5.5, 4.5), (5.5, 5.5)]
    offsets = tmp_path / "offsets.txt"
    offsets.write_text("# ahead, left\n0,0\n-1, 2\n-1 -2  # behind\n\n2.5,0\n0,-4\n")
    assert slots(str(offsets)) == [(4, 3), (4, 7), (5, 1), (5, 5), (7.5, 5)]
    assert slots(str(offsets), -90)[0] == (1, 5)


def test_a_slot_in_a_wall_moves_to_the_nearest_cell(rooms: str) -> None:
    team, ground = formation(
        MapChoice(map=rooms, at="1,1 1,2", cell=0.5, radius=0), shape="line", spacing=0.5, anchor="2.25,0.9"
    )
    x = {value % ground.columns for one in team.variables.values() for value in one.domain}
    assert x <= {3, 6}  # left and right of the wall


def test_the_flight_reads_the_same_map(rooms: str) -> None:
    _, ground = formation(MapChoice(map=rooms, at="1,1 3,2.9", cell=0.5, radius=0), anchor="1,2")
    assert ground.first == (0, 0)
    assert {name: ground.x_and_y(*cell) for name, cell in ground.starts.items()} == {"Robot1": (2, 2), "Robot2": (6, 6)}
    assert ground.places == {"Robot1": (1.0, 1.0), "Robot2": (3.0, 2.9)}
    assert not ground.blocked
    assert read_ground_map(ground_map_json(ground)) == ground
    walls = ground.walls
    assert walls is not None
    grid = read_occupancy_grid(Path(rooms))
    assert (walls.rows, walls.columns) == grid.free.shape
    assert (walls.resolution, walls.corner) == (float(grid.resolution), tuple(map(float, grid.origin)))
    assert (walls.radius, walls.speed) == (0, 0.5)
    assert (unpacked(walls.free, walls.rows, walls.columns) == grid.free).all()
    assert (unpacked(walls.occupied, walls.rows, walls.columns) == grid.occupied).all()
