"""Turned maps: their cells, places and ways, by other means than the generators'."""

from __future__ import annotations

import math
from fractions import Fraction
from math import floor
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice, reachability_of
from robochoc.generators.maps.patrol import patrol
from robochoc.maps.occupancy.grid import OccupancyGrid, read_occupancy_grid
from robochoc.maps.reachability.cells import Cells
from robochoc.maps.reachability.free_space import free_space
from robochoc.maps.reachability.line_of_sight import lines_of_sight
from robochoc.model.expression import evaluate
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.maps import Pixel, drawn_rows, fitting, free_pixels, ways, write_map
from tests.support.program import ROOT

YAWS = st.floats(-4, 4, width=32).filter(lambda yaw: abs(math.remainder(yaw, math.pi / 2)) > 0.01)
CLOSE = 1e-5
"""What differs by less than that many pixels is not held against anybody: floating point is the judge here."""
Point = tuple[float, float]


def grid_of(rows: list[str], **how: str) -> OccupancyGrid:
    with TemporaryDirectory() as folder:
        return read_occupancy_grid(write_map(Path(folder), rows, **how))


def in_pixels(place: Point, origin: Point, yaw: float, side: float) -> Point:
    """Return a place of the map's frame in pixels of the image, from its lower left corner, as map_server has it."""
    x, y = place[0] - origin[0], place[1] - origin[1]
    return (x * math.cos(yaw) + y * math.sin(yaw)) / side, (y * math.cos(yaw) - x * math.sin(yaw)) / side


def overlap(square: list[Point], axes: list[Point], pixel: Pixel) -> float:
    """Return by how much a square overlaps a pixel along the axis along which they do the least."""
    corners = [(pixel[0] + right, pixel[1] + up) for right in (0, 1) for up in (0, 1)]
    found = []
    for x, y in [(1.0, 0.0), (0.0, 1.0), *axes]:
        one, other = ([a * x + b * y for a, b in points] for points in (square, corners))
        found.append(min(max(one) - min(other), max(other) - min(one)))
    return min(found)


def wanted_cells(rows: list[str], cells: Cells, origin: Point, yaw: float) -> tuple[dict[int, bool], dict[int, bool]]:
    """Return which cells are free, and which are blocked. Cells of which that hangs on rounding are left out."""
    free, side, half = free_pixels(rows), float(cells.grid.resolution), float(cells.side) / 2
    walls = {(x, y) for y, row in enumerate(reversed(rows)) for x, one in enumerate(row) if one == "#"}
    axes = [(math.cos(yaw), -math.sin(yaw)), (math.sin(yaw), math.cos(yaw))]
    frees, blocked = {}, {}
    for cell in range(cells.columns * cells.rows):
        x, y = (float(part) for part in cells.centre(cell))
        corners = [(x + right * half, y + up * half) for right in (-1, 1) for up in (-1, 1)]
        square = [in_pixels(corner, origin, yaw, side) for corner in corners]
        spans = [range(floor(min(ends)) - 1, floor(max(ends)) + 2) for ends in zip(*square, strict=True)]
        overlaps = {(a, b): overlap(square, axes, (a, b)) for a in spans[0] for b in spans[1]}
        if any(abs(one) < CLOSE for one in overlaps.values()):
            continue
        touched = {pixel for pixel, one in overlaps.items() if one > 0}
        frees[cell], blocked[cell] = touched <= free, bool(touched & walls)
    return frees, blocked


@given(
    st.integers(1, 8),
    st.integers(1, 8),
    st.integers(0, 2**32),
    YAWS,
    st.sampled_from([("0", "0"), ("-0.25", "3.1"), ("1.3", "-7.77")]),
    st.sampled_from(["0.2", "0.5", "0.75", "1.1"]),
)
@examples(40)
def test_cells_of_turned_maps_are_squares_of_the_frame(
    columns: int, rows: int, seed: int, yaw: float, corner: tuple[str, str], side: str
) -> None:
    drawn = drawn_rows(Random(seed), columns, rows, 0.15)
    grid = grid_of(drawn, origin=f"[{corner[0]}, {corner[1]}, {yaw:.12f}]")
    cells = Cells(grid, Fraction(side), free_space(np.ones_like(grid.free), Fraction(0)))
    free, blocked = wanted_cells(drawn, cells, (float(corner[0]), float(corner[1])), float(f"{yaw:.12f}"))
    assert {cell: cell in cells.free for cell in free} == free
    assert {cell: cell in cells.blocked for cell in blocked} == blocked
    assert 2 * len(free) >= cells.columns * cells.rows  # few depend on rounding


@looped("yaw", ["1.5707963267948966", "-4.71238898", "1.57080", "3.14159265358979", "-1.5708", "6.2832"])
def test_quarter_turns_are_those_of_the_image(tmp_path: Path, yaw: str) -> None:
    """The same map, drawn as it lies in its frame, makes the same problem."""
    rows = drawn_rows(Random(5), 7, 4, 0.2)
    quadruple_squares = round(float(yaw) / (math.pi / 2)) % 4
    turned, corner = rows, (0, 0)
    for _ in range(quadruple_squares):
        corner = (-corner[1] - len(turned), corner[0])
        turned = ["".join(row[-1 - number] for row in turned) for number in range(len(turned[0]))]
    plain = [f"{1 + corner[0] * 0.5}", f"{2 + corner[1] * 0.5}"]
    for folder, image, origin in (
        ("turned", rows, f"[1, 2, {yaw}]"),
        ("drawn", turned, f"[{plain[0]}, {plain[1]}, 0]"),
    ):
        (tmp_path / folder).mkdir()
        write_map(tmp_path / folder, image, origin=origin)
    one, other = (
        reachability_of(MapChoice(map=str(tmp_path / name / "plan.yaml"), agents=2, radius=0, cell=0.25), Random(1))
        for name in ("turned", "drawn")
    )
    assert isinstance(one.cells, Cells)
    assert one.cells.grid.rotation.is_zero
    assert one.seconds == other.seconds
    assert one.seconds[0]
    assert one.starts == other.starts
    assert one.ground() == other.ground()


def test_the_frame_is_the_one_of_ros() -> None:
    """Counterclockwise: with a yaw of 90 degrees the image's columns go up, and its rows to the left."""
    grid = grid_of(["#..", "..."], origin=f"[10, 20, {math.pi / 2}]", resolution="1")
    assert [*grid.origin] == [8, 20]
    assert grid.free.tolist() == [[False, True], [True, True], [True, True]]
    askew = grid_of(["#..", "..."], origin="[10, 20, 0.6435011087932844]", resolution="1")  # 3, 4, 5
    x, y = askew.in_pixels((Fraction(14), Fraction(23)))
    assert (float(x), float(y)) == pytest.approx((5, 0), abs=1e-12)
    assert [float(part) for corner in askew.corners for part in corner] == pytest.approx(
        [10, 20, 12.4, 21.8, 8.8, 21.6, 11.2, 23.4], abs=1e-12
    )


def test_a_hair_of_a_turn_is_none() -> None:
    rows = ["..."] * 3
    assert grid_of(rows, origin="[0, 0, 0.000001]").rotation.is_zero
    assert grid_of(rows, origin="[0, 0, 1.5707]").rotation.is_zero
    assert not grid_of(rows, origin="[0, 0, 0.01]").rotation.is_zero
    assert not grid_of(["." * 2000] * 2, origin="[0, 0, 0.00001]").rotation.is_zero


@given(st.integers(2, 9), st.integers(2, 9), st.integers(0, 2**32), YAWS, st.sampled_from([0.0, 0.3, 0.6]))
@examples(40)
def test_ways_on_turned_maps_take_the_time_of_the_image(
    columns: int, rows: int, seed: int, yaw: float, radius: float
) -> None:
    """Turned or not, ways are found on the image's pixels: only where a cell's centre lies differs."""
    drawn = drawn_rows(Random(seed), columns, rows, 0.2)
    fits, origin = fitting(drawn, Fraction(str(radius)) * 2), (1.0, -2.0)
    with TemporaryDirectory() as folder:
        path = write_map(Path(folder), drawn, origin=f"[1, -2, {yaw:.12f}]")
        try:
            reach = reachability_of(
                MapChoice(map=str(path), agents=1, radius=radius, cell=0.25, speed=0.4), Random(seed)
            )
        except ValueError:
            return
    cells = reach.cells

    def pixel(place: tuple[Fraction, ...]) -> Pixel:
        x, y = in_pixels((float(place[0]), float(place[1])), origin, float(f"{yaw:.12f}"), 0.5)
        return floor(x), floor(y)

    times = ways(pixel(reach.starts[0]), fits)
    wanted = {
        cell: floor(times[at] * Fraction("0.5") / Fraction("0.4") * Fraction(2, 3) + Fraction(1, 2))
        for cell in cells.free
        if (at := pixel(cells.centre(cell))) in times
    }
    found = reach.seconds[0]
    if radius:  # a robot may not fit through between two pixels, which makes ways longer
        assert {cell for cell, time in found.items() if time < wanted[cell]} == set()
    else:
        assert found == wanted


def test_lines_of_sight_on_a_turned_map_are_those_of_the_image() -> None:
    rows = ["....." + "#" + "....."] * 4 + ["." * 11] + ["....." + "#" + "....."] * 4
    yaw = 0.4
    grid = grid_of(rows, origin=f"[0, 0, {yaw}]")
    cells = Cells(grid, Fraction(1, 2), free_space(grid.free, Fraction(0)))
    sight = lines_of_sight(cells)
    found = sight.visible_cells(Fraction(4))
    through = 0
    for one in cells.free:
        for other in cells.free:
            ends = [in_pixels((float(x), float(y)), (0, 0), yaw, 0.5) for x, y in map(cells.centre, (one, other))]
            if math.dist(*ends) > 8 - CLOSE or (ends[0][0] < 5) == (ends[1][0] < 5):
                continue
            (a, b), (c, d) = ends
            heights = [b + (d - b) * (wall - a) / (c - a) for wall in (5, 6)]
            if min(abs(one - two) for one in heights for two in (4, 5)) < CLOSE:
                continue
            clear = all(4 < height < 5 for height in heights)
            through += clear
            assert (other in found[one]) is clear
    assert through > 10


def test_teams_on_a_turned_building(tmp_path: Path) -> None:
    """A formation, a coverage and a patrol: their answers stand in the frame of the map, where robots fit."""
    for name in ("building.yaml", "building.pgm"):
        (tmp_path / name).write_bytes((ROOT / "docs/examples/building" / name).read_bytes())
    path = tmp_path / "building.yaml"
    path.write_text(path.read_text().replace("[-0.25, -0.25, 0]", "[-3, 2, 0.7]"))
    rows = [
        "".join({"0": "#", "254": ".", "205": "?"}[shade] for shade in line.split())
        for line in (tmp_path / "building.pgm").read_text().splitlines()[4:]
    ]
    fits = fitting(rows, Fraction("0.8"))
    choice = MapChoice(map=str(path), agents=3, cells=60)
    for team, ground in (
        formation(choice, 1, anchor="-1,7"),
        coverage(MapChoice(map=str(path), agents=3, cells=30), 1),
        patrol(choice, 1),
    ):
        found = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
        scale = ground.scale
        assert scale is not None
        for robot in team.robots:
            topic = robot.topics[0]
            assert topic.x is not None
            assert topic.y is not None
            place = [evaluate(one, found.assignment) * scale for one in (topic.x, topic.y)]
            x, y = in_pixels((place[0], place[1]), (-3, 2), 0.7, 0.25)
            assert (floor(x), floor(y)) in fits
