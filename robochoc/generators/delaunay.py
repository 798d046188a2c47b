"""Delaunay triangulations of random points, as graphs.

Two points are linked if a circle through both contains no other point (Delaunay, "Sur la sphère vide", 1934). Points
have integer coordinates, so all tests are exact, and a seed gives the same graph on every machine. The triangulation is
built triangle by triangle from an edge of the convex hull, in O(n^2).
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from robochoc.generators.draws import check_bounds, random_integer
from robochoc.generators.graphs import Edge, Graph

MAX_POINTS = 1000
SIDE = 1 << 24
"""The length of the square's side."""

Point = tuple[int, int]


def delaunay(agents: int) -> Graph:
    """Return the Delaunay triangulation of uniformly random points in a square. It is planar and connected.

    Raises:
        ValueError: There are more than `MAX_POINTS` points.
    """
    check_bounds({"agents": (agents, 1, MAX_POINTS)})

    def draw(chance: Random) -> list[Edge]:
        edges = None
        while edges is None:
            points = [(random_integer(chance, 0, SIDE), random_integer(chance, 0, SIDE)) for _ in range(agents)]
            edges = triangulated(points)
        return edges

    return Graph(agents, "delaunay", draw)


def triangulated(points: Sequence[Point]) -> list[Edge] | None:
    """Return the edges of the triangulation, in ascending order; None if it is not unique, or points are equal."""
    if len({*points}) < len(points):
        return None
    if len(points) < 2:  # noqa: PLR2004 - no pair
        return []
    start, end = _edge_of_hull(points)
    edges = {(min(start, end), max(start, end))}
    waiting, done = [(start, end)], {(end, start)}
    while waiting:
        one, other = waiting.pop()
        if (one, other) in done:
            continue
        third, unique = _third(points, one, other)
        if not unique:
            return None
        done.add((one, other))
        if third is not None:
            for begin, close in ((other, third), (third, one)):
                done.add((begin, close))
                edges.add((min(begin, close), max(begin, close)))
                waiting.append((close, begin))
    if len(points) > 2 and len(edges) == 1:  # noqa: PLR2004 - all points are on a line
        return None
    return sorted((one + 1, other + 1) for one, other in edges)


def _edge_of_hull(points: Sequence[Point]) -> tuple[int, int]:
    """Return an edge of the convex hull with all other points on its left side."""
    start = min(range(len(points)), key=points.__getitem__)
    end, *others = (one for one in range(len(points)) if one != start)
    for one in others:
        turn = _turn(points[start], points[end], points[one])
        if turn < 0 or (turn == 0 and points[one] < points[end]):
            end = one
    return start, end


def _third(points: Sequence[Point], one: int, other: int) -> tuple[int | None, bool]:
    """Return the third point of the triangle on the left of an edge (None: there is none), and whether it is unique."""
    third, unique = None, True
    for place, point in enumerate(points):
        if place in {one, other} or _turn(points[one], points[other], point) <= 0:
            continue
        inside = 1 if third is None else _inside(points[one], points[other], points[third], point)
        if inside > 0:
            third, unique = place, True
        elif inside == 0:
            unique = False
    return third, unique


def _turn(a: Point, b: Point, c: Point) -> int:
    """Return a positive number if c is on the left of the line from a to b, 0 if it is on the line."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _inside(a: Point, b: Point, c: Point, d: Point) -> int:
    """Return a positive number if d is inside the circle through a, b and c (counterclockwise), 0 if it is on it."""
    ax, ay, bx, by, cx, cy = a[0] - d[0], a[1] - d[1], b[0] - d[0], b[1] - d[1], c[0] - d[0], c[1] - d[1]
    return (
        (ax * ax + ay * ay) * (bx * cy - cx * by)
        - (bx * bx + by * by) * (ax * cy - cx * ay)
        + (cx * cx + cy * cy) * (ax * by - bx * ay)
    )
