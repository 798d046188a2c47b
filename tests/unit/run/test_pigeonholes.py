"""Groups of robots that need different values of which there are too few."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from random import Random

import pytest

from robochoc.model.problem import Constraint, Predicate, Relation, Semantics, Team
from robochoc.run.pigeonholes import Crowd, find_crowd
from tests.support.brute_force import solutions
from tests.support.examples import count
from tests.support.problems import PREDICATES, team_of

DIFFERENT, EQUAL, LESS, NOT_NEXT = PREDICATES[:4]
LISTED = Relation("listed", 2, Semantics.CONFLICTS, tuple((value, value) for value in range(5)))
SOFT = Relation("soft", 2, Semantics.SOFT, tuple((value, value) for value in range(5)), (1,) * 5)


def linked(
    domains: Sequence[Sequence[int]], pairs: Sequence[tuple[int, int]], definition: Predicate | Relation = DIFFERENT
) -> Team:
    scopes = [(f"V{one}", f"V{other}") for one, other in pairs]
    constraints = [Constraint(f"C{one}.{other}", definition, (one, other), (one, other)) for one, other in scopes]
    return team_of({f"V{number}": domain for number, domain in enumerate(domains)}, constraints)


def all_pairs(robots: int) -> list[tuple[int, int]]:
    return list(combinations(range(robots), 2))


@pytest.mark.parametrize("definition", [DIFFERENT, LESS, LISTED])
def test_four_robots_with_three_values_are_a_crowd(definition: Predicate | Relation) -> None:
    assert find_crowd(linked([range(3)] * 4, all_pairs(4), definition)) == Crowd(4, 3)
    assert find_crowd(linked([range(4)] * 4, all_pairs(4), definition)) is None
    assert find_crowd(linked([range(3)] * 4, all_pairs(4)[1:], definition)) is None


def test_the_values_of_all_robots_count() -> None:
    domains = [(0, 1), (1, 2), (0, 2), (0, 1, 2)]
    assert find_crowd(linked(domains, all_pairs(4))) == Crowd(4, 3)
    assert find_crowd(linked([*domains[:3], (1, 3)], all_pairs(4))) is None


@pytest.mark.parametrize("definition", [EQUAL, NOT_NEXT, SOFT])
def test_robots_that_may_have_equal_values_are_no_crowd(definition: Predicate | Relation) -> None:
    assert find_crowd(linked([range(3)] * 4, all_pairs(4), definition)) is None


@count("many", 300, 5000)
def test_a_crowd_exists_and_few_crowds_are_missed(many: int) -> None:
    chance = Random("crowds")
    existing = found = 0
    for _ in range(many):
        robots = chance.randint(3, 7)
        domains = [sorted(chance.sample(range(4), chance.randint(1, 3))) for _ in range(robots)]
        pairs = [pair for pair in all_pairs(robots) if chance.random() < 0.7]
        team = linked(domains, pairs)
        groups = [group for size in range(2, robots + 1) for group in combinations(range(robots), size)]
        crowds = {
            Crowd(len(group), len(set().union(*(domains[one] for one in group))))
            for group in groups
            if set(combinations(group, 2)) <= set(pairs)
        }
        crowds = {crowd for crowd in crowds if crowd.robots > crowd.values}
        crowd = find_crowd(team)
        assert crowd is None or (crowd in crowds and not any(solutions(team)))
        existing += bool(crowds)
        found += crowd is not None
    assert existing > many / 4
    assert found > 0.9 * existing
