"""Random problems with costs: Model B's graphs, every cost as likely as any other, and graphs to be coloured."""

from __future__ import annotations

from collections import Counter
from hashlib import sha256
from pathlib import Path

import pytest

from robochoc.formats import read_team
from robochoc.generators.coloring import coloring
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import constraint_graph
from robochoc.model.problem import INFINITE, ConstraintModel, ProblemKind, Relation, Semantics
from tests.support.binary_problems import edges_of, relation_of, shared_constraints
from tests.support.program import robochoc_within


def test_the_graph_is_model_bs() -> None:
    for seed in range(5):
        team = random_csp(12, 3, 0.4, 0, seed, max_cost=9)
        assert team.kind is ProblemKind.DISWCSP
        assert team.name == f"random-12-3-0.4-0.0-cost9-{seed}"
        assert len(edges_of(team)) == len(shared_constraints(team)) == round(0.4 * 66)
        assert {relation_of(one).semantics for one in shared_constraints(team)} == {Semantics.SOFT}
    linked = random_csp(12, 3, 0.2, 0, 1, connected=True, max_cost=9)
    assert all(constraint_graph(linked).values())


def test_so_many_pairs_are_forbidden_all_others_cost_something() -> None:
    team = random_csp(9, 5, 0.5, 0.36, 3, max_cost=4)
    for one in shared_constraints(team):
        prices = [relation_of(one).cost((a, b)) for a in range(1, 6) for b in range(1, 6)]
        assert prices.count(INFINITE) == 9
        assert {price for price in prices if price < INFINITE} <= {0, 1, 2, 3, 4}


def test_every_cost_is_as_likely_as_any_other() -> None:
    seen: Counter[float] = Counter()
    for seed in range(20):
        for one in shared_constraints(random_csp(10, 5, 0.5, 0, seed, max_cost=9)):
            seen.update(relation_of(one).cost((a, b)) for a in range(1, 6) for b in range(1, 6))
    expected = sum(seen.values()) / 10
    assert sorted(seen) == list(range(10))
    assert sum((count - expected) ** 2 / expected for count in seen.values()) < 28  # chi-square, 9 degrees


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    said = [
        (one.scope, relation_of(one).tuples, relation_of(one).costs)
        for one in shared_constraints(random_csp(10, 5, 0.4, 0.1, 42, max_cost=100))
    ]
    assert sha256(repr(said).encode()).hexdigest()[:16] == "73f3803ff545085f"
    assert sha256(repr(sorted(edges_of(coloring(20, 3, 4, 42)))).encode()).hexdigest()[:16] == "60db1280f43b4712"


def test_a_graph_to_be_coloured_has_the_degree_that_was_asked_for() -> None:
    team = coloring(15, 3, 4, 7)
    assert team.name == "coloring-15-3-4.0-7"
    assert len(edges_of(team)) == 30
    assert {one.cost for one in shared_constraints(team)} == {1}
    assert all(list(one.domain) == [1, 2, 3] for one in team.variables.values())
    assert all(constraint_graph(coloring(15, 3, 3, 7, connected=True)).values())


# Asymmetric costs


def test_each_side_has_costs_of_its_own_and_both_forbid_the_same() -> None:
    team = random_csp(6, 4, 0.6, 0.25, 3, max_cost=100, asymmetric=True)
    sides: dict[str, list[Relation]] = {}
    for constraint in team.constraints():
        assert constraint.model is ConstraintModel.PKC
        assert isinstance(constraint.definition, Relation)
        sides.setdefault(constraint.name, []).append(constraint.definition)
    assert len(sides) == 9
    for one, other in sides.values():
        assert one.costs != other.costs
        forbidden = [
            {pair for pair, cost in zip(side.tuples, side.costs, strict=True) if cost == INFINITE}
            for side in (one, other)
        ]
        assert forbidden[0] == forbidden[1]
        assert len(forbidden[0]) == 4
    assert team == random_csp(6, 4, 0.6, 0.25, 3, max_cost=100, asymmetric=True)


# On the command line


@pytest.mark.usefixtures("in_a_folder")
def test_generate_writes_costs_where_it_says(tmp_path: Path) -> None:
    words = ["generate", "random", "--agents", 6, "--domain", 3, "--density", 0.4, "--max-cost", 10, "--seed", 4]
    done = robochoc_within(*words)
    folder = Path("instances") / "random-6-3-0.4-0.0-cost10-4"
    assert done.stdout == f"{folder}: 6 robots, 6 constraints; next: robochoc solve {folder}\n"
    assert read_team(tmp_path / folder) == random_csp(6, 3, 0.4, 0, 4, max_cost=10)
    done = robochoc_within("generate", "coloring", "--agents", 6, "--degree", 3, "--connected")
    folder = Path("instances") / "coloring-6-3-3.0-0-connected"
    assert done.stdout == f"{folder}: 6 robots, 9 constraints; next: robochoc solve {folder}\n"
    assert read_team(tmp_path / folder) == coloring(6, 3, 3, connected=True)
