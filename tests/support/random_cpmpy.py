"""Random CPMpy expressions over every operator, global constraint and function, and their values by two judges."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import Any

from robochoc.model.problem import Team
from robochoc.solver.encoding import allows_function
from tests.support.lazy import LazyModule

cp = LazyModule("cpmpy")
Term = Any
"""CPMpy's expressions."""


class RandomExpressions:
    """Draws expressions over three integer variables, one of which may be negative, and a Boolean one.

    Attributes:
        variables: The variables.
    """

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self.x = [cp.intvar(-1, 2, name="x0"), cp.intvar(0, 2, name="x1"), cp.intvar(0, 3, name="x2")]
        self.b = cp.boolvar(name="b")
        self.variables = [*self.x, self.b]

    def number(self, depth: int) -> Term:
        """Return a random integer expression; every second of them may have no value somewhere."""
        chance = self._chance
        if depth == 0 or chance.random() < 0.25:
            return chance.choice([*self.x, *self.x, self.b + self.x[1], chance.choice(self.x) + chance.randint(-2, 3)])
        one, other, third = (self._integer(depth - 1) for _ in range(3))
        kinds: list[Callable[[], Term]] = [
            lambda: one + other,
            lambda: one - other,
            lambda: chance.randint(-2, 3) * one + other,
            lambda: one * other,
            lambda: -one,
            lambda: abs(one),
            lambda: cp.max([one, other, third]),
            lambda: cp.min([one, other]),
            lambda: one // other,
            lambda: one // other,
            lambda: one % other,
            lambda: 5 // one,
            lambda: one // chance.choice((-2, 2, 3)),
            lambda: cp.Element([3, 1, 2], one),
            lambda: cp.Element([one, 2, other], third),
            lambda: cp.cpm_array([[1, 2], [3, 0]])[one, other],
            lambda: cp.Count([one, other, 1], third),
            lambda: cp.Among([one, other, third], [0, 2]),
            lambda: cp.NValue([one, other, third]),
            lambda: cp.NValueExcept([one, other, third], 0),
            lambda: self.fact(depth - 1) + other,
            lambda: one**2,
        ]
        return chance.choice(kinds)()

    def _integer(self, depth: int) -> Term:
        """Return a random integer expression, as CPMpy wants an index to be: not one that has 0 and 1 alone."""
        found = self.number(depth)
        return found + self.x[1] if found.is_bool() else found

    def fact(self, depth: int) -> Term:
        """Return a random Boolean expression."""
        chance = self._chance
        if depth == 0 or chance.random() < 0.3:
            return self._comparison(depth)
        if chance.random() < 0.35:
            return self.constraint(depth)
        left, right, third = (self.fact(depth - 1) for _ in range(3))
        kinds: list[Callable[[], Term]] = [
            lambda: left & right,
            lambda: left | right | ~self.b,
            lambda: left.implies(right),
            lambda: ~left,
            lambda: ~left,
            lambda: ~(left | right),
            lambda: self.b.implies(~left),
            lambda: left == right,
            lambda: left != right,
            lambda: left == False,  # noqa: E712 - CPMpy's operator
            lambda: cp.Xor([left, right, third]),
            lambda: cp.IfThenElse(left, right, third),
            lambda: cp.sum([left, right, third]) >= 2,
            lambda: cp.any([left, right]),
            lambda: cp.all([left, right]),
        ]
        return chance.choice(kinds)()

    def _comparison(self, depth: int) -> Term:
        chance = self._chance
        one, other = self.number(min(depth + 1, 2)), self.number(min(depth, 1))
        if chance.random() < 0.2:
            one = cp.Element([chance.randint(-1, 3) for _ in range(3)], self.x[chance.randint(0, 2)])
        if chance.random() < 0.2:
            other = chance.randint(-1, 3)
        if chance.random() < 0.4:
            one, other = other + 0 * self.x[0], one
        signs: list[Callable[[], Term]] = [
            lambda: one == other,
            lambda: one != other,
            lambda: one < other,
            lambda: one <= other,
            lambda: one > other,
            lambda: one >= other,
        ]
        return chance.choice(signs)()

    def constraint(self, depth: int) -> Term:
        """Return a random global constraint, over expressions."""
        chance = self._chance
        below = max(depth - 1, 0)
        one, other, third = (self.number(below) if chance.random() < 0.4 else chance.choice(self.x) for _ in range(3))
        many = [one, other, third]
        rows = [[chance.randint(0, 2) for _ in range(3)] for _ in range(5)]
        lengths = [chance.randint(0, 2) for _ in range(3)]
        present = [self.b, True, self.x[0] > 0]
        kinds: list[Callable[[], Term]] = [
            lambda: cp.AllDifferent(many),
            lambda: cp.AllDifferentExceptN(many, [0, 1]),
            lambda: cp.AllDifferentExcept0(many),
            lambda: cp.AllEqual(many),
            lambda: cp.AllEqualExceptN(many, 1),
            lambda: cp.Circuit(many),
            lambda: cp.Inverse(many, [self.x[1], self.x[2], self.x[0]]),
            lambda: cp.Table(self.x, rows),
            lambda: cp.Table([self.x[1], self.x[0] + 1, self.x[2]], rows),
            lambda: cp.Table(many, rows),
            lambda: cp.ShortTable(many, [["*", 1, 2], [0, "*", 1]]),
            lambda: cp.NegativeTable(many, rows),
            lambda: cp.Regular(many, [("a", 0, "b"), ("b", 1, "b"), ("b", 2, "c"), ("c", 0, "a")], "a", ["b", "c"]),
            lambda: cp.InDomain(one, [0, 2]),
            lambda: cp.Cumulative(many, lengths, demand=[1, 2, 2], capacity=chance.randint(2, 4)),
            lambda: cp.Cumulative(self.x, [*self.x[1:], 1], demand=[1, 2, 2], capacity=3),
            lambda: cp.Cumulative(many, lengths, [other + 2, third + 1, one + 1], [1, 2, 1], 3),
            lambda: cp.CumulativeOptional(many, lengths, demand=[1, 2, 2], capacity=3, is_present=present),
            lambda: cp.NoOverlap(many, lengths),
            lambda: cp.NoOverlapOptional(many, lengths, is_present=present),
            lambda: cp.Precedence(many, [0, 1, 2]),
            lambda: cp.Reservoir(many, [1, -1, 1], 0, 1),
            lambda: cp.ReservoirOptional(many, [1, -1, 1], 0, 1, present),
            lambda: cp.MDD(self.x[:2], [("r", 0, "a"), ("r", 1, "b"), ("a", 2, "t"), ("b", 0, "t")]),
            lambda: cp.GlobalCardinalityCount(many, [0, 1], [1, chance.choice([0, 1, self.x[1]])]),
            lambda: cp.Increasing(many),
            lambda: cp.Decreasing(many),
            lambda: cp.IncreasingStrict(many),
            lambda: cp.DecreasingStrict(many),
            lambda: cp.LexLess([one, self.x[1]], [third, other]),
            lambda: cp.LexLessEq([one, self.x[1]], [third, other]),
            lambda: cp.LexChainLess([[one, self.x[1]], [third, other]]),
            lambda: cp.LexChainLessEq([[one, self.x[1]], [third, other]]),
        ]
        return chance.choice(kinds)()

    def assignments(self) -> Iterator[tuple[int, ...]]:
        """Yield all assignments, each of which the variables then have as their values."""
        for row in itertools.product(*(range(variable.lb, variable.ub + 1) for variable in self.variables)):
            for variable, value in zip(self.variables, row, strict=True):
                variable._value = bool(value) if variable.is_bool() else value  # noqa: SLF001 - as its solvers do
            yield row


class Judge:
    """Decides which assignments of the variables of a CPMpy model a team allows.

    Further variables of the team are searched.
    """

    def __init__(self, team: Team, given: Sequence[str]) -> None:
        further = [name for name in team.variables if name not in given]
        self._order = [*given, *further]
        self._domains = [tuple(team.variables[name].domain) for name in further]
        self._levels: list[list[Callable[[Sequence[int]], bool]]] = [[] for _ in range(len(further) + 1)]
        place = {name: max(0, number - len(given) + 1) for number, name in enumerate(self._order)}
        for constraint in team.constraints():
            level = max(place[name] for name in constraint.variables)
            known = self._order[: len(given) + level]
            self._levels[level].append(allows_function(constraint, known))

    def allows(self, values: Sequence[int]) -> bool:
        """Return whether the team allows these values of the given variables."""
        return all(test(values) for test in self._levels[0]) and self._extends(list(values), 0)

    def _extends(self, values: list[int], level: int) -> bool:
        if level == len(self._domains):
            return True
        for value in self._domains[level]:
            longer = [*values, value]
            if all(test(longer) for test in self._levels[level + 1]) and self._extends(longer, level + 1):
                return True
        return False
