"""Random problems with random variables: numbers of parts, and equal problems for equal seeds."""

from __future__ import annotations

from robochoc.formats import check_team
from robochoc.generators.stochastic import stochastic
from robochoc.model.uncertainty import declared_robots, random_variables
from tests.support.evaluation import digest
from tests.support.examples import drawn


def test_a_seed_is_one_problem_everywhere() -> None:
    """The digest never changes, since published figures name seeds."""
    team = stochastic(agents=5, domain=3, observed=0.5, seed=1)
    assert (team.name, digest(team)) == ("stochastic-5-3-0.4-2x2-2-0.5-10-1", "6d69a32c1d49992e")


def test_numbers() -> None:
    chance = drawn("stochastic numbers")
    for seed in range(20):
        agents, outcomes, reach = chance.randint(3, 8), chance.randint(1, 4), chance.randint(1, 3)
        numbers = {"agents": agents, "outcomes": outcomes, "reach": reach, "random": chance.randint(0, 4)}
        team = stochastic(domain=3, density=0.5, observed=chance.choice([0, 0.5]), seed=seed, **numbers)
        check_team(team)
        declared = [one for robot in declared_robots(team.robots) for one in robot.constraints()]
        shared = [one for one in declared if one.name.startswith("C")]
        assert len(shared) == round(0.5 * agents * (agents - 1) / 2)
        assert len(declared) - len(shared) == numbers["random"] * reach
        found = random_variables(team)
        assert len(found) == numbers["random"]
        assert all(len(one.outcomes) == outcomes and sum(one.weights) == 100 for one in found)


def test_all_robots_observe_or_none() -> None:
    for observed in (0, 1):
        team = stochastic(agents=4, domain=2, reach=3, observed=observed)
        assert all(len(one.seen_by) == 3 * observed for one in random_variables(team))
