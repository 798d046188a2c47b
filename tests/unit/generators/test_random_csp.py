"""Model B random problems: exact numbers, every problem as likely as any other, the same from the same seed."""

from __future__ import annotations

from collections import Counter
from hashlib import sha256
from pathlib import Path

import pytest

from robochoc.formats import read_team
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import constraint_graph
from robochoc.model.problem import Robot, Semantics
from tests.support.binary_problems import edges_of, relation_of, shared_constraints
from tests.support.cases import looped
from tests.support.program import robochoc_within

SIZES = [
    (20, 10, 0.2, 0.6, 38, 60),
    (10, 3, 0.5, 0.33, 22, 3),  # 22.5 and 2.97: halves to the even number
    (7, 4, 1, 1, 21, 16),
    (7, 4, 0, 0.5, 0, 8),
    (5, 4, 0.5, 0, 5, 0),
    (1, 1, 1, 1, 0, 1),
]


@looped(("agents", "domain", "density", "tightness", "count", "forbidden"), SIZES)
def test_the_numbers_are_exact(
    agents: int, domain: int, density: float, tightness: float, count: int, forbidden: int
) -> None:
    for seed in range(5):
        team = random_csp(agents, domain, density, tightness, seed)
        assert team.order == tuple(f"Robot{number}" for number in range(1, agents + 1))
        assert [list(one.domain) for one in team.variables.values()] == [list(range(1, domain + 1))] * agents
        found = shared_constraints(team)
        assert len(found) == len(edges_of(team)) == count
        for one in found:
            assert relation_of(one).semantics is Semantics.CONFLICTS
            assert len(relation_of(one).tuples) == len(set(relation_of(one).tuples)) == forbidden
            assert all(1 <= value <= domain for row in relation_of(one).tuples for value in row)


def test_a_constraint_stands_with_the_lower_robot() -> None:
    team = random_csp(9, 3, 0.5, 0.4, 1)
    for robot in team.robots:
        for parent in robot.parents:
            (constraint,) = parent.constraints
            assert constraint.variables == (f"V{parent.name[5:]}", f"V{robot.name[5:]}")
            assert int(parent.name[5:]) < int(robot.name[5:])


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds. Python 3.11, 3.12 and 3.13 agree on them."""
    team = random_csp(5, 3, 0.5, 0.4, 0)
    assert sorted(edges_of(team)) == [(1, 3), (1, 5), (2, 5), (3, 4), (3, 5)]
    said = [(one.scope, relation_of(one).tuples) for one in shared_constraints(random_csp(20, 10, 0.2, 0.6, 42))]
    assert sha256(repr(said).encode()).hexdigest()[:16] == "416e7a52e72a25a4"
    assert random_csp(5, 3, 0.5, 0.4, 0) == team
    assert shared_constraints(team) != shared_constraints(random_csp(5, 3, 0.5, 0.4, 1))


def test_every_graph_and_every_pair_of_values_is_as_likely_as_any_other() -> None:
    graphs: Counter[object] = Counter()
    tables: Counter[object] = Counter()
    for seed in range(1500):
        team = random_csp(4, 2, 0.5, 0.5, seed)
        graphs[edges_of(team)] += 1
        tables[relation_of(shared_constraints(team)[0]).tuples] += 1
    for seen, number in ((graphs, 20), (tables, 6)):  # 3 of 6 edges; 2 of 4 pairs
        expected = 1500 / number
        assert len(seen) == number
        assert sum((count - expected) ** 2 / expected for count in seen.values()) < 50  # chi-square, 19 degrees


def test_connected_draws_connected_graphs_alone_all_alike() -> None:
    graphs: Counter[object] = Counter()
    for seed in range(3000):
        team = random_csp(4, 1, 0.5, 0, seed, connected=True)
        graphs[edges_of(team)] += 1
        assert all(constraint_graph(team).values())
    assert len(graphs) == 16  # Cayley: the trees on 4 labelled nodes
    assert max(graphs.values()) < 1.4 * min(graphs.values())


def test_connected_keeps_a_graph_that_is() -> None:
    def robots(*, connected: bool) -> tuple[Robot, ...]:
        return random_csp(10, 3, 0.9, 0.3, 5, connected=connected).robots

    assert robots(connected=True) == robots(connected=False)


# On the command line


@pytest.mark.usefixtures("in_a_folder")
def test_generate_random_writes_where_it_says(tmp_path: Path) -> None:
    words = ["generate", "random", "--agents", 6, "--domain", 3, "--density", 0.4, "--tightness", 0.3, "--seed", 4]
    done = robochoc_within(*words)
    folder = Path("instances") / "random-6-3-0.4-0.3-4"
    assert done.stdout == f"{folder}: 6 robots, 6 constraints; next: robochoc solve {folder}\n"
    assert read_team(tmp_path / folder) == random_csp(6, 3, 0.4, 0.3, 4)
    again = robochoc_within(*words)
    assert again.returncode == 1
    assert "--force" in again.stderr
    assert robochoc_within(*words, "--force").returncode == 0
    assert robochoc_within(*words, "--connected", "-o", tmp_path / "linked").returncode == 0
    assert all(constraint_graph(read_team(tmp_path / "linked")).values())
