"""Random models whose constraints meet absent robots, with the definition of docs/reference/absence.md beside each.

The definition is evaluated on plain Python functions; it shares nothing with `robochoc/model/absence.py`.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any

import robochoc
from robochoc.modelling.events import ModelEvent

Values = Mapping[str, int]
Price = Callable[[Values], float]
"""What a constraint costs for the values of the robots that are there; 0 where it is dropped."""

SIDES: dict[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


class AbsenceModel:
    """A random model of three or four robots, and what every subset of them may do."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self.has_costs = chance.random() < 0.5
        names = [f"r{number}" for number in range(chance.randint(3, 4))]
        self.weights = {name: chance.choice((1, 1, 1, 2, 3)) for name in names}
        self.domains = {name: sorted(chance.sample(range(4), chance.randint(2, 3))) for name in names}
        self.model = robochoc.Model("absence")
        self._of = {
            name: self.model.robot(name, weight=self.weights[name]).variable("x", self.domains[name]) for name in names
        }
        self._prices: list[Price] = []
        for _ in range(chance.randint(2, 4)):
            self._add()
        for name in names if self.has_costs else ():
            self._add_wish(name, chance.randint(0, 3))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._of)

    def price(self, values: Values) -> float:
        """Return what the robots with `values` pay when all others are absent."""
        return sum(price(values) for price in self._prices)

    def best(self, present: Sequence[str]) -> float:
        """Return the least cost when exactly the robots `present` are there; infinite: there is no solution."""
        rows = itertools.product(*(self.domains[name] for name in present))
        return min(self.price(dict(zip(present, row, strict=True))) for row in rows)

    def minimum(self) -> tuple[float, float]:
        """Return the least weight of robots that have to withdraw, and the least cost then."""
        found = (math.inf, math.inf)
        for many in range(len(self._of) + 1):
            for present in itertools.combinations(self._of, many):
                cost = self.best(present)
                if cost < math.inf:
                    found = min(found, (sum(self.weights[name] for name in self._of if name not in present), cost))
        return found

    def values_by_robot(self, values: Mapping[str, object]) -> dict[str, int]:
        """Return the values of an outcome by the robots' names."""
        return {name.split(".")[0]: int(str(value)) for name, value in values.items()}

    def without(self, gone: Sequence[str]) -> robochoc.Model:
        """Return the model, in which the robots `gone` leave by one event or by several."""
        model = self.model.__copy__()
        event: ModelEvent | None = None
        for name in gone:
            if event is None or self._chance.random() < 0.5:
                event = model.after_solution()
            event.remove_robot(name)
        return model

    def _add_wish(self, name: str, weight: int) -> None:
        self.model.minimize(weight * self._of[name])
        self._prices.append(lambda values: weight * values[name] if name in values else 0)

    def _add(self) -> None:
        chance = self._chance
        robots = chance.sample(self.names, chance.randint(2, len(self._of)))
        cost = chance.randint(1, 5) if self.has_costs and chance.random() < 0.5 else None
        when_absent = chance.choice((None,) * 6 + ("drop", "fail"))
        term, holds = self._aggregate(robots) if chance.random() < 0.7 else self._pair(robots[:2])
        scope = robots if holds.__name__ == "aggregate" else robots[:2]
        self.model.add(term, cost=cost, when_absent=when_absent)
        self._prices.append(_priced(scope, holds, math.inf if cost is None else cost, when_absent))

    def _aggregate(self, robots: Sequence[str]) -> tuple[object, Callable[[list[int], list[str]], bool]]:
        """Return an aggregate, and what it means for the values of the robots that are there."""
        chance, terms = self._chance, [self._of[name] for name in robots]
        side = SIDES[chance.choice(sorted(SIDES))]
        value, many, total = chance.randint(0, 3), chance.randint(0, len(robots)), chance.randint(0, 4 * len(robots))
        weights = {name: chance.randint(1, 3) for name in robots}
        meanings: list[tuple[object, Callable[[list[int], list[str]], bool]]] = [
            (side(sum(one == value for one in terms), many), lambda own, _: side(own.count(value), many)),
            (side(sum(terms), total), lambda own, _: side(sum(own), total)),
            (
                side(sum(weights[name] * self._of[name] for name in robots), total),
                lambda own, there: side(sum(weights[name] * one for name, one in zip(there, own, strict=True)), total),
            ),
            (robochoc.any_of(one == value for one in terms), lambda own, _: value in own),
            (~robochoc.any_of(one == value for one in terms), lambda own, _: value not in own),
            (side(robochoc.maximum(terms), value), lambda own, _: side(max(own), value)),
            (side(robochoc.minimum(terms), value), lambda own, _: side(min(own), value)),
            (robochoc.all_different(terms), lambda own, _: len({*own}) == len(own)),
        ]
        term, meaning = chance.choice(meanings)

        def aggregate(own: list[int], there: list[str]) -> bool:
            return bool(meaning(own, there))

        return term, aggregate

    def _pair(self, robots: Sequence[str]) -> tuple[object, Callable[[list[int], list[str]], bool]]:
        """Return a constraint that is dropped without one of two robots."""
        chance, (one, other) = self._chance, [self._of[name] for name in robots]
        rows = [row for row in itertools.product(*(self.domains[name] for name in robots)) if chance.random() < 0.6]
        rows = rows or [(self.domains[robots[0]][0], self.domains[robots[1]][0])]
        meanings: list[tuple[object, Callable[[int, int], bool]]] = [
            (one != other, lambda first, second: first != second),
            (one + 1 < other, lambda first, second: first + 1 < second),
            (abs(one - other) >= 2, lambda first, second: abs(first - second) >= 2),
            (robochoc.allowed([one, other], rows), lambda first, second: (first, second) in rows),
        ]
        term, meaning = chance.choice(meanings)

        def pair(own: list[int], there: list[str]) -> bool:
            return len(there) < 2 or bool(meaning(*own))

        return term, pair


def _priced(
    scope: Sequence[str], holds: Callable[[list[int], list[str]], bool], cost: float, when_absent: str | None
) -> Price:
    def price(values: Values) -> float:
        there = [name for name in scope if name in values]
        if len(there) < len(scope) and when_absent is not None:
            return math.inf if when_absent == "fail" else 0
        return 0 if not there or holds([values[name] for name in there], there) else cost

    return price
