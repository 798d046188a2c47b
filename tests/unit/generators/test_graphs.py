"""Constraint graphs: so many edges, the shape that is asked for, the same from the same seed."""

from __future__ import annotations

import itertools
from collections import Counter
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team
from robochoc.generators.coloring import coloring_of
from robochoc.generators.delaunay import SIDE, Point, delaunay, triangulated
from robochoc.generators.draws import random_integer
from robochoc.generators.graphs import (
    Edge,
    Graph,
    grid,
    links_all,
    nearest_to_a_square,
    scale_free,
    small_world,
    tree,
)
from robochoc.generators.random_csp import random_on
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team
from tests.support.binary_problems import edges_of, relation_of, shared_constraints
from tests.support.evaluation import best, digest
from tests.support.examples import examples

SEEDS = st.integers(0, 2**32)


def drawn(graph: Graph, seed: int) -> list[Edge]:
    """Return the edges, which are simple, ascending and between nodes that there are."""
    edges = graph.draw(Random(seed))
    assert edges == sorted(set(edges))
    assert all(1 <= one < other <= graph.agents for one, other in edges)
    assert edges == graph.draw(Random(seed))
    return edges


def degrees(edges: list[Edge]) -> Counter[int]:
    return Counter(itertools.chain.from_iterable(edges))


@given(st.integers(1, 9), SEEDS)
@examples(60)
def test_delaunay_links_points_with_an_empty_circle_through_both(agents: int, seed: int) -> None:
    """All triples of points are tried: a triangle is drawn if no other point is inside its circle."""
    edges = drawn(delaunay(agents), seed)
    assert links_all(edges, agents)
    assert len(edges) <= max(agents - 1, 3 * agents - 6)
    chance = Random(seed)
    points = [(random_integer(chance, 0, SIDE), random_integer(chance, 0, SIDE)) for _ in range(agents)]
    if agents > 2:
        expected = set()
        for triple in itertools.combinations(range(agents), 3):
            centre, radius = circle(*[points[one] for one in triple])
            if all(distance(centre, point) >= radius for point in points):
                expected |= {(one + 1, other + 1) for one, other in itertools.combinations(triple, 2)}
        assert set(edges) == expected


def circle(a: Point, b: Point, c: Point) -> tuple[tuple[Fraction, Fraction], Fraction]:
    """Return the centre and the squared radius of the circle through three points."""
    (x, y), (p, q), (r, s) = a, (b[0] - a[0], b[1] - a[1]), (c[0] - a[0], c[1] - a[1])
    twice = 2 * (p * s - q * r)
    right = Fraction(s * (p * p + q * q) - q * (r * r + s * s), twice)
    up = Fraction(p * (r * r + s * s) - r * (p * p + q * q), twice)
    return (x + right, y + up), right * right + up * up


def distance(centre: tuple[Fraction, Fraction], point: Point) -> Fraction:
    return (centre[0] - point[0]) ** 2 + (centre[1] - point[1]) ** 2


def test_points_without_a_unique_triangulation() -> None:
    for points in ([(0, 0), (0, 1), (1, 0), (1, 1)], [(0, 0), (1, 1), (2, 2)], [(0, 0), (0, 0), (1, 2)]):
        assert triangulated(points) is None
    assert triangulated([(0, 0), (1, 0), (2, 0), (1, 2)]) == [(1, 2), (1, 4), (2, 3), (2, 4), (3, 4)]


@given(st.integers(2, 25), st.integers(1, 24), SEEDS)
@examples(60)
def test_scale_free(agents: int, links: int, seed: int) -> None:
    links = min(links, agents - 1)
    edges = drawn(scale_free(agents, links), seed)
    assert len(edges) == links * (agents - links)
    assert links_all(edges, agents)
    new = Counter(other for _, other in edges)
    assert all(new[node] == links for node in range(links + 1, agents + 1))


def test_scale_free_graphs_have_hubs_that_came_early() -> None:
    """The mean degree of node i falls like the root of i; a uniform choice has no such hubs."""
    total: Counter[int] = Counter()
    for seed in range(200):
        total += degrees(drawn(scale_free(60, 2), seed))
    early, late = (sum(total[node] for node in nodes) / 200 / 10 for nodes in (range(1, 11), range(51, 61)))
    assert early > 4 * late
    assert 2 <= late < 2.5


@given(st.integers(3, 20), st.integers(1, 9), st.floats(0, 1), SEEDS)
@examples(60)
def test_small_world(agents: int, half: int, rewiring: float, seed: int) -> None:
    neighbours = min(2 * half, (agents - 1) // 2 * 2)
    edges = drawn(small_world(agents, neighbours, rewiring), seed)
    assert len(edges) == agents * neighbours // 2
    assert min(degrees(edges)[node] for node in range(1, agents + 1)) >= neighbours // 2


def test_a_small_world_without_rewiring_is_the_ring() -> None:
    assert drawn(small_world(6, 2, 0), 1) == [(1, 2), (1, 6), (2, 3), (3, 4), (4, 5), (5, 6)]
    moved = [
        len(set(drawn(small_world(40, 4, 0.25), seed)) - set(drawn(small_world(40, 4, 0), 0))) for seed in range(40)
    ]
    assert 15 < sum(moved) / 40 < 22  # a quarter of 80 edges, less what comes back


@given(st.integers(1, 8), st.integers(1, 8))
@examples(30)
def test_grids(rows: int, columns: int) -> None:
    flat, torus = (drawn(grid(rows, columns, torus=around), 0) for around in (False, True))
    assert len(flat) == rows * (columns - 1) + columns * (rows - 1)
    assert set(flat) <= set(torus)
    if min(rows, columns) > 2:
        assert set(degrees(torus).values()) == {4}
        assert len(torus) == 2 * rows * columns
    assert rows * columns == 1 or links_all(flat, rows * columns)
    assert nearest_to_a_square(rows * columns) >= min(rows, columns)


@given(st.integers(1, 30), SEEDS)
@examples(50)
def test_trees(agents: int, seed: int) -> None:
    edges = drawn(tree(agents), seed)
    assert len(edges) == agents - 1
    assert links_all(edges, agents)


def test_every_tree_is_as_likely_as_any_other() -> None:
    seen = Counter(tuple(drawn(tree(4), seed)) for seed in range(1600))
    assert len(seen) == 16  # Cayley: 4**2
    assert max(seen.values()) < 1.6 * min(seen.values())


def test_graphs_are_as_networkx_knows_them() -> None:
    nx = pytest.importorskip("networkx")
    for seed in range(5):
        ours, theirs = scale_free(30, 3).draw(Random(seed)), nx.barabasi_albert_graph(30, 3, seed)
        assert len(ours) == theirs.number_of_edges()
        ours, theirs = small_world(30, 4, 0.2).draw(Random(seed)), nx.watts_strogatz_graph(30, 4, 0.2, seed)
        assert len(ours) == theirs.number_of_edges()
        assert nx.is_tree(nx.Graph(tree(30).draw(Random(seed))))
    for rows, columns, around in itertools.product((1, 2, 3, 4), (2, 3, 5), (False, True)):
        ours = nx.Graph(grid(rows, columns, torus=around).draw(Random(0)))
        assert nx.is_isomorphic(ours, nx.grid_2d_graph(rows, columns, periodic=around))


GOLDEN = {
    "random-9-3-scale-free2-0.3-0": "e9722dc54c8b6430",
    "random-9-3-small-world4-0.2-0.3-0": "dfc470e94d52c840",
    "random-9-3-grid3x3-0.3-0": "f3811170b471d681",
    "random-9-3-torus3x3-0.3-0": "9ac83be5b2de81ab",
    "random-9-3-tree-0.3-0": "0b7aed490ff73a56",
    "random-9-3-tree-0.0-utility9.00-0": "7e05f2db7dcdf737",
    "coloring-9-3-tree-hard-0": "729e40bc93578198",
    "coloring-9-3-tree-weighted20.0-0": "2fc8e9b97114e45e",
    "coloring-9-2-small-world2-0.5-0-connected": "b10ba7f34d4bece8",
}


def goldens() -> dict[str, Team]:
    graphs = [scale_free(9), small_world(9, 4, 0.2), grid(3, 3), grid(3, 3, torus=True), tree(9)]
    teams = [
        *(random_on(graph, 3, 0.3) for graph in graphs),
        random_on(tree(9), 3, 0, max_cost=9, costs=CostUnits(maximize=True, places=2)),
        coloring_of(tree(9), 3, conflicts="hard"),
        coloring_of(tree(9), 3, conflicts="weighted", max_cost=20, places=1),
        coloring_of(small_world(9, 2, 0.5, connected=True), 2),
    ]
    return {team.name: team for team in teams}


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    assert {name: digest(team) for name, team in goldens().items()} == GOLDEN


def test_teams_on_graphs_are_valid() -> None:
    for team in goldens().values():
        check_team(team)
        assert len(team.robots) == 9


def test_costs_are_in_units_of_their_places() -> None:
    team = random_on(tree(8), 3, 0, 5, max_cost=1, costs=CostUnits(places=3))
    pairs = list(itertools.product((1, 2, 3), repeat=2))
    prices = {relation_of(one).cost(pair) for one in shared_constraints(team) for pair in pairs}
    assert len(prices) > 50
    assert all(0 <= price <= 1000 for price in prices)
    weights = [one.cost for one in shared_constraints(coloring_of(tree(50), 3, 1, conflicts="weighted", places=1))]
    assert all(1 <= weight <= 100 for weight in weights)
    assert max(weights) > 90


def test_kinds_of_colouring() -> None:
    ring = small_world(5, 2, 0)
    soft, hard = coloring_of(ring, 2), coloring_of(ring, 2, conflicts="hard")
    assert edges_of(soft) == edges_of(hard) == {(1, 2), (2, 3), (3, 4), (4, 5), (1, 5)}
    assert soft.kind is ProblemKind.DISWCSP
    assert best(soft) == 1  # an odd ring and two colours
    assert hard.kind is ProblemKind.DISCSP
    assert best(hard) is None
    assert best(coloring_of(ring, 3, conflicts="hard")) == 0
    weighted = coloring_of(ring, 2, conflicts="weighted", places=2)
    assert best(weighted) == Fraction(min(int(one.cost) for one in shared_constraints(weighted)), 100)
