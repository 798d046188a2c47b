"""Random problems as models, each with a second meaning of its own: plain Python over fractions.

A `Said` is a term of a model and the function that computes it from the values of variables. What terms say of
themselves is not asked: an error in their meaning shows as a different optimum.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from enum import Enum
from fractions import Fraction
from random import Random
from typing import Any

import robochoc
from robochoc.modelling.terms import ModelVariable, Term

Values = Mapping[str, Any]


class Color(Enum):
    RED = "r"
    GREEN = "g"
    BLUE = "b"


@dataclass
class Said:
    term: Any
    means: Callable[[Values], Any]


@dataclass
class RandomProblem:
    """A model, and what it means: conditions, and terms of the sum."""

    model: robochoc.Model
    domains: dict[str, list[Any]]
    hard: list[Callable[[Values], Any]] = field(default_factory=list)
    costs: list[Callable[[Values], Any]] = field(default_factory=list)
    maximized: bool = False

    def total(self, values: Values) -> Fraction | None:
        """Return the sum for `values`; None: they break something, or a sum has no value."""
        try:
            if not all(condition(values) for condition in self.hard):
                return None
            prices = [cost(values) for cost in self.costs]
        except ZeroDivisionError:
            return None
        return None if math.inf in prices else sum(map(exactly, prices), Fraction(0))

    def best(self) -> Fraction | None:
        """Return the best sum of all assignments; None: there is no solution."""
        choose = max if self.maximized else min
        assignments = (dict(zip(self.domains, row, strict=True)) for row in itertools.product(*self.domains.values()))
        return choose((total for one in assignments if (total := self.total(one)) is not None), default=None)


Number = int | float | Decimal | Fraction


def exactly(value: Number) -> Fraction:
    return Fraction(repr(value)) if isinstance(value, float) else Fraction(value)


def random_problem(chance: Random) -> RandomProblem:
    """Return a problem that has a team. A few have costs of too many decimal places, and are drawn again."""
    while True:
        problem = _drawn(chance, _integers)
        try:
            _ = problem.model.team
        except robochoc.ModelError as refused:
            if not any(word in str(refused) for word in ("decimal", "division by zero", "False")):
                raise
        else:
            return problem


def large_problem(chance: Random) -> RandomProblem | None:
    """Return a problem with numbers of up to 18 digits; None: the model refuses it, and says what is too large."""
    problem = _drawn(chance, _large_integers)
    try:
        _ = problem.model.team
    except robochoc.ModelError as refused:
        if not any(word in str(refused) for word in ("decimal", "division by zero", "False", "digits", "2^63")):
            raise
        return None
    return problem


def _large_integers(chance: Random) -> list[int]:
    size = 10 ** chance.choice((1, 2, 5, 9, 10, 16, 18))
    return sorted({chance.choice((-1, 1, 1)) * chance.randrange(size // 2, size) for _ in range(chance.randint(1, 3))})


def _drawn(chance: Random, integers: Callable[[Random], list[int]]) -> RandomProblem:
    """Return a problem of 2 to 4 robots with 2 to 6 variables, private and shared constraints, and costs or none."""
    model = robochoc.Model("random")
    problem = RandomProblem(model, {})
    numbers: list[ModelVariable] = []
    colors: list[ModelVariable] = []
    switches: list[ModelVariable] = []
    for number in range(chance.randint(2, 4)):
        robot = model.robot(f"r{number}", priority=chance.choice((0, 0, 1)))
        for own in range(chance.choice((1, 1, 2))):
            name = f"v{own}"
            kinds: list[tuple[list[Any], list[ModelVariable]]] = [(integers(chance), numbers)] * 4
            kinds += [(_decimals(chance), numbers), (list(Color)[: chance.randint(2, 3)], colors)]
            domain, group = chance.choice([*kinds, ([False, True], switches)])
            group.append(robot.variable(name, domain))
            problem.domains[group[-1].name] = list(domain)
    sayer = _Sayer(chance, numbers, colors, switches)
    for _ in range(chance.randint(0, 2)):
        said = sayer.condition(2)
        if isinstance(said.term, Term):
            model.add(said.term)
            problem.hard.append(said.means)
    if len(numbers) > 2 and chance.random() < 0.3:
        model.add(robochoc.all_different(numbers))
        problem.hard.append(lambda values: len({exactly(values[one.name]) for one in numbers}) == len(numbers))
    if chance.random() < 0.85:
        _add_costs(problem, sayer, chance)
    return problem


def _add_costs(problem: RandomProblem, sayer: _Sayer, chance: Random) -> None:
    problem.maximized = chance.random() < 0.4
    parts: list[tuple[Number, Said]] = []
    for _ in range(chance.randint(1, 5)):
        said, factor = sayer.number(2), chance.choice((1, 1, -1, 2, 0, Decimal("0.25"), 0.1, Fraction(-3, 2), -7))
        parts.append((factor, said))
    whole = sum(factor * said.term for factor, said in parts if isinstance(said.term, Term))
    if isinstance(whole, Term):
        (problem.model.maximize if problem.maximized else problem.model.minimize)(whole + 3)
        problem.costs += [_product(factor, said) for factor, said in parts if isinstance(said.term, Term)]
        problem.costs.append(lambda _: 3)
    if chance.random() < 0.5:
        said, cost = sayer.condition(2), chance.choice((1, Decimal("2.5"), -1, 4))
        if isinstance(said.term, Term):
            problem.model.add(said.term, cost=cost)
            sign = -1 if problem.maximized and isinstance(whole, Term) else 1
            problem.maximized = problem.maximized and isinstance(whole, Term)
            problem.costs.append(lambda values: 0 if _holds(said, values) else exactly(cost) * sign)
    elif sayer.numbers and chance.random() < 0.6:
        _add_table(problem, sayer.numbers, chance)
    problem.maximized = bool(problem.model.maximized)


def _product(factor: Number, said: Said) -> Callable[[Values], Fraction]:
    return lambda values: exactly(factor) * exactly(said.means(values))


def _add_table(problem: RandomProblem, numbers: list[ModelVariable], chance: Random) -> None:
    """Add a table of costs, some of which forbid."""
    one, other = chance.choice(numbers), chance.choice(numbers)
    if one is other:
        return
    prices = [0, 1, -2, Decimal("0.5"), math.inf]
    table = {row: chance.choice(prices) for row in itertools.product(one.domain, other.domain) if chance.random() < 0.6}
    default = chance.choice((0, 1))
    term = robochoc.costs([one, other], table, default)
    (problem.model.maximize if problem.model.maximized else problem.model.minimize)(term)
    problem.costs.append(lambda values: table.get((values[one.name], values[other.name]), default))


def _holds(said: Said, values: Values) -> bool:
    try:
        return bool(said.means(values))
    except ZeroDivisionError:
        return False


def _integers(chance: Random) -> list[int]:
    return sorted(chance.sample(range(-3, 7), chance.randint(2, 4)))


def _decimals(chance: Random) -> list[Decimal]:
    return [Decimal(one) / 4 for one in sorted(chance.sample(range(-4, 9), chance.randint(2, 3)))]


class _Sayer:
    """Says random things of variables."""

    def __init__(
        self, chance: Random, numbers: list[ModelVariable], colors: list[ModelVariable], switches: list[ModelVariable]
    ) -> None:
        self._chance = chance
        self.numbers, self._colors, self._switches = numbers, colors, switches

    def _leaf(self) -> Said:
        chance = self._chance
        numbers = self.numbers if chance.random() < 0.8 else self._switches
        if numbers:
            name = (variable := chance.choice(numbers)).name
            return Said(variable, lambda values: exactly(values[name]))
        given = chance.choice((0, 1, 2, 3, -2, Decimal("1.5")))
        return Said(given, lambda _: exactly(given))

    def number(self, depth: int) -> Said:
        chance = self._chance
        if depth == 0 or not self.numbers or chance.random() < 0.2:
            return self._leaf()
        one, other = self.number(depth - 1), self.number(depth - 1)
        if not isinstance(one.term, Term) and not isinstance(other.term, Term):
            return one
        kind = chance.choice([*_NUMBERS, "if", "count", "power"])
        if kind in _NUMBERS:
            return _applied(_NUMBERS[kind], one, other)
        a, b = one.means, other.means
        if kind == "power":
            power = chance.choice((0, 1, 2))
            return Said(abs(one.term) ** power + other.term, lambda v: abs(a(v)) ** power + b(v))
        test = self.condition(0 if kind == "if" else 1)
        if kind == "if":
            term = robochoc.if_then_else(test.term, one.term, other.term)
            return Said(term, lambda v: a(v) if test.means(v) else b(v))
        return Said(one.term + test.term, lambda v: a(v) + int(bool(test.means(v))))

    def condition(self, depth: int) -> Said:
        chance = self._chance
        if self._colors and chance.random() < 0.3:
            return self._of_colors()
        if depth == 0 or chance.random() < 0.4:
            return self._comparison(self.number(1), self.number(1))
        one, other = self.condition(depth - 1), self.condition(depth - 1)
        if not isinstance(one.term, Term):
            return other
        if chance.random() < 0.2:
            return Said(~one.term, lambda v: not one.means(v))
        return _applied(_CONDITIONS[chance.choice([*_CONDITIONS])], one, other)

    def _of_colors(self) -> Said:
        one, other = self._chance.choice(self._colors), self._chance.choice([*self._colors, *Color])
        name = one.name
        if isinstance(other, Color):
            return Said(one == other, lambda values: values[name] is other)
        theirs = other.name
        return Said(one != other, lambda values: values[name] is not values[theirs])

    def _comparison(self, one: Said, other: Said) -> Said:
        if not isinstance(one.term, Term) and not isinstance(other.term, Term):
            return Said(term=True, means=lambda _: True)
        if isinstance(one.term, Term) and self._chance.random() < 0.15:
            some = [1, 2, Decimal("0.5")]
            return Said(one.term.is_in(some), lambda v: one.means(v) in some)
        return _applied(_COMPARISONS[self._chance.choice([*_COMPARISONS])], one, other)


def _squared(first: Number, second: Number) -> Fraction:
    return exactly(first) ** 2 - exactly(second)


_Two = Callable[[Any, Any], Any]
_NUMBERS: dict[str, tuple[_Two, _Two]] = {
    "+": (operator.add, operator.add),
    "-": (operator.sub, operator.sub),
    "*": (operator.mul, operator.mul),
    "dist": (lambda x, y: abs(x - y), lambda a, b: abs(a - b)),
    "//": (operator.floordiv, lambda a, b: a // b),
    "%": (operator.mod, lambda a, b: a % b),
    "min": (robochoc.minimum, min),
    "max": (robochoc.maximum, max),
    "function": (lambda x, y: robochoc.function(_squared, x, y), lambda a, b: a**2 - b),
}
_COMPARISONS: dict[str, tuple[_Two, _Two]] = {
    name: (getattr(operator, name), getattr(operator, name)) for name in ("eq", "ne", "lt", "le", "gt", "ge")
}
_CONDITIONS: dict[str, tuple[_Two, _Two]] = {
    "&": (operator.and_, lambda p, q: bool(p) and bool(q)),
    "|": (operator.or_, lambda p, q: bool(p) or bool(q)),
    "^": (operator.xor, lambda p, q: bool(p) != bool(q)),
    "implies": (lambda p, q: p.implies(q), lambda p, q: bool(q) or not p),
}
"""Operators by name: on terms, and on values."""


def _applied(operators: tuple[_Two, _Two], one: Said, other: Said) -> Said:
    """Return an operator's term and meaning. Both sides are computed: what is undefined in one is so in all."""
    term, means = operators
    return Said(term(one.term, other.term), lambda values: means(one.means(values), other.means(values)))
