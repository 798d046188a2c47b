"""Many episodes of one team at once, in NumPy arrays: for teams of robots with one variable each (`ArrayProblem`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robochoc.environments.team_env import Reward
from robochoc.modelling.array_problem import ArrayProblem
from robochoc.system.errors import OptionError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Observations(NamedTuple):
    """The observations of all robots in all episodes.

    Attributes:
        values: The value of each robot: episodes x robots. A robot may use those of its neighbours only.
        costs: The cost of each own value if the neighbours keep their values: episodes x robots x values.
        violations: The number of forbidden pairs for each own value, in the same form.
    """

    values: Integers
    costs: Floats
    violations: Integers


class ArrayEnv:
    """A team in many independent episodes, which are computed together. Rewards are as in `TeamEnv`.

    Args:
        problem: The team.
        episodes: The number of episodes.
        rounds: The number of rounds of an episode.
        reward: `own` or `team`.
        violation_cost: The cost of a forbidden pair in rewards. None: one more than the sum of the largest costs.

    Raises:
        OptionError: if an argument is not allowed.
    """

    def __init__(
        self,
        problem: ArrayProblem,
        episodes: int,
        *,
        rounds: int = 50,
        reward: str = Reward.TEAM,
        violation_cost: float | None = None,
    ) -> None:
        if episodes < 1 or rounds < 1:
            raise OptionError(f"episodes is {episodes} and rounds is {rounds}; both must be at least 1")
        if reward not in set(Reward):
            raise OptionError(f"reward is {reward!r}; use 'own' or 'team'")
        self.problem, self.episodes, self.rounds = problem, episodes, rounds
        self._reward = Reward(reward)
        tables = problem.tables
        charges = np.zeros((problem.robots, problem.values)) if problem.charges is None else problem.charges
        self._tables, self._broken = np.where(np.isinf(tables), 0, tables), np.isinf(tables)
        self._charges, self._excluded = np.where(np.isinf(charges), 0, charges), np.isinf(charges)
        if violation_cost is None:
            most = self._tables.max(axis=(1, 2), initial=0)[problem.which].sum() + self._charges.max(axis=1).sum()
            violation_cost = 1.0 + float(most)
        self.violation_cost = violation_cost
        self._values = np.zeros((episodes, problem.robots), np.int64)
        self._random = np.random.default_rng()
        self._round = 0
        ends = np.concatenate([problem.edges[:, 0], problem.edges[:, 1]])
        self._order = np.argsort(ends, kind="stable")
        self._robots, self._starts = np.unique(ends[self._order], return_index=True)

    def reset(self, seed: int | None = None, values: ArrayLike | None = None) -> Observations:
        """Start all episodes, with random values or with `values` (episodes x robots)."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        self._round = 0
        drawn = self._random.integers(self.problem.values, size=self._values.shape)
        self._values = drawn if values is None else self._checked(values)
        return self._observe()

    def step(self, values: ArrayLike) -> tuple[Observations, Floats, bool]:
        """Let all robots choose `values` (episodes x robots) at the same time.

        Returns:
            The observations, the rewards (episodes x robots), and whether the episodes are over.

        Raises:
            OptionError: if a value is missing or not allowed.
        """
        before = self._paid()
        self._values = self._checked(values)
        self._round += 1
        return self._observe(), before - self._paid(), self._round >= self.rounds

    @property
    def team_costs(self) -> Floats:
        """The cost of the team in each episode; infinite if a pair or a value is forbidden."""
        broken, paid = self._team()
        return np.where(broken > 0, np.inf, paid)

    def _checked(self, values: ArrayLike) -> Integers:
        found = np.asarray(values)
        wrong = found.shape != self._values.shape or not np.issubdtype(found.dtype, np.integer)
        if wrong or found.min(initial=0) < 0 or found.max(initial=0) >= self.problem.values:
            shape = " x ".join(map(str, self._values.shape))
            raise OptionError(f"expected {shape} integers from 0 to {self.problem.values - 1}")
        return found.astype(np.int64)

    def _observe(self) -> Observations:
        costs = self._per_value(self._tables) + self._charges
        violations = self._per_value(self._broken).astype(np.int64) + self._excluded
        return Observations(self._values.copy(), costs, violations)

    def _per_value(self, tables: NDArray[np.generic]) -> Floats:
        """Return the sum of entries of `tables` for each own value, given the values at the other ends of edges."""
        first, second = self.problem.edges.T
        which = self.problem.which
        rows = tables[which, :, self._values[:, second]]  # of the first robot
        columns = tables[which, self._values[:, first], :]
        entries = np.concatenate([rows, columns], axis=1).astype(np.float64)
        found = np.zeros((*self._values.shape, self.problem.values))
        if entries.shape[1]:
            found[:, self._robots] = np.add.reduceat(entries[:, self._order], self._starts, axis=1)
        return found

    def _team(self) -> tuple[Integers, Floats]:
        """Return the violations and the other costs of the team in each episode."""
        first, second = self.problem.edges.T
        places = self.problem.which, self._values[:, first], self._values[:, second]
        own = np.arange(self.problem.robots), self._values
        broken = self._broken[places].sum(axis=1) + self._excluded[own].sum(axis=1)
        return broken, self._tables[places].sum(axis=1) + self._charges[own].sum(axis=1)

    def _paid(self) -> Floats:
        """Return the present cost that counts for each reward."""
        if self._reward == Reward.TEAM:
            broken, paid = self._team()
            return np.repeat((broken * self.violation_cost + paid)[:, None], self.problem.robots, axis=1)
        seen = self._observe()
        weighed: Floats = seen.violations * self.violation_cost + seen.costs
        return np.take_along_axis(weighed, self._values[:, :, None], axis=2)[:, :, 0]
