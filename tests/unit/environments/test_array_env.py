"""Many episodes at once: costs as `ArrayProblem` computes them, rewards, errors."""

from __future__ import annotations

import numpy as np
import pytest

from robochoc.environments import ArrayEnv
from robochoc.modelling.array_problem import ArrayProblem
from robochoc.system.errors import OptionError
from tests.support.examples import drawn


def random_problem(seed: int) -> ArrayProblem:
    """Return a random problem with charges, forbidden pairs, double edges, and a robot without edges."""
    draw = np.random.default_rng(seed)
    edges = [(a, b) for a, b in draw.integers(0, 6, (9, 2)) if a != b]
    tables = draw.integers(0, 9, (len(edges), 3, 3)).astype(float)
    tables[draw.random(tables.shape) < 0.1] = np.inf
    charges = draw.integers(0, 5, (7, 3)).astype(float)
    return ArrayProblem(7, 3, np.array(edges, dtype=int).reshape(-1, 2), tables, charges=charges)


def test_costs_and_rewards_agree_with_the_problem() -> None:
    seed = drawn("array environments").randrange(1 << 30)
    problem = random_problem(seed)
    draw = np.random.default_rng(seed)
    for reward in ("own", "team"):
        many = ArrayEnv(problem, 4, rounds=2, reward=reward)
        seen = many.reset(seed=1)
        before = many.team_costs
        for episode, values in enumerate(seen.values):
            assert before[episode] == problem.cost(values)
            for robot in range(7):
                for value in range(3):
                    changed = values.copy()
                    changed[robot] = value
                    weighed = seen.costs[episode, robot] + many.violation_cost * seen.violations[episode, robot]
                    if np.isfinite(problem.cost(values)) and np.isfinite(problem.cost(changed)):
                        saved = weighed[values[robot]] - weighed[value]
                        assert saved == problem.cost(values) - problem.cost(changed)
        after, rewards, over = many.step(draw.integers(0, 3, (4, 7)))
        assert not over
        finite = np.isfinite(before) & np.isfinite(many.team_costs)
        if reward == "team":
            assert np.array_equal(rewards[finite, 0], before[finite] - many.team_costs[finite])
        assert many.step(after.values)[1].any() is np.False_
        assert many.step(after.values)[2]


def test_episodes_can_begin_with_given_values() -> None:
    many = ArrayEnv(random_problem(1), 2)
    given = np.ones((2, 7), dtype=int)
    assert np.array_equal(many.reset(values=given).values, given)


def test_wrong_arguments_are_refused() -> None:
    problem = random_problem(1)
    for options, words in (({"episodes": 0}, "at least 1"), ({"episodes": 1, "reward": "all"}, "'own' or 'team'")):
        with pytest.raises(OptionError, match=words):
            ArrayEnv(problem, **options)
    many = ArrayEnv(problem, 2)
    many.reset(seed=1)
    for values in (np.zeros((2, 6), int), np.full((2, 7), 3), np.full((2, 7), 0.5), [[-1] * 7] * 2):
        with pytest.raises(OptionError, match="2 x 7 integers from 0 to 2"):
            many.step(values)
