"""Samples of random variables, which replace expectations over many joint outcomes (docs/guides/uncertainty.md).

All robots draw the same samples, because the draws of a random variable depend only on the seed and its name: the
average of a sum is then the sum of the averages. This is the sample average approximation of Kleywegt, Shapiro and
Homem-de-Mello, "The sample average approximation method for stochastic discrete optimization", SIAM J. Optim. 12, 2002.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from robochoc.model.constraint import INFINITE, Constraint, Function, Relation
from robochoc.model.cost_units import MAX_PLACES
from robochoc.model.expression import Apply, Constant, Expression
from robochoc.model.random_variable import RandomVariable
from robochoc.system.lazy_dataclass import dataclass

DEFAULT_NUMBER = 1000
"""The number of samples if the user has not chosen one."""
MOST_SAMPLES = 10_000
"""The maximum number of samples: time limits do not cover the seconds in which costs are computed for them."""
MAX_OUTCOMES = 4096
"""The maximum number of joint outcomes over which an expectation is exact if the user has not chosen samples."""


@dataclass(frozen=True)
class Samples:
    """The samples of a run.

    Attributes:
        number: The number of samples.
        seed: The seed of all draws.
        exact: The maximum number of joint outcomes over which expectations are exact.
    """

    number: int = DEFAULT_NUMBER
    seed: int = 0
    exact: int = MAX_OUTCOMES

    @property
    def places(self) -> int:
        """Return the number of decimal places of the weight of a sample, 1 / `number`."""
        return next(places for places in range(MAX_PLACES + 1) if 10**places % self.number == 0)

    def draws(self, random: RandomVariable, purpose: str = "") -> tuple[int, ...]:
        """Return the outcome of `random` in each sample. Draws for different purposes are independent."""
        return _draws(random, self.number, f"{self.seed} {random.name} {purpose}")


def sample_number(number: int) -> int:
    """Return `number` if it can be a number of samples. Raises `ValueError`."""
    if not 1 <= number <= MOST_SAMPLES:
        raise ValueError(f"{number:,} is not a number of samples: use 1 to {MOST_SAMPLES:,}")
    if 10**MAX_PLACES % number:
        larger = next(one for one in range(number, MOST_SAMPLES + 1) if 10**MAX_PLACES % one == 0)
        raise ValueError(f"an average of {number:,} samples is not an exact decimal: use {larger:,} samples")
    return number


@lru_cache(maxsize=512)
def _draws(random: RandomVariable, number: int, seed: str) -> tuple[int, ...]:
    from random import Random  # noqa: PLC0415 - as in `orders`

    chance = Random(seed)  # noqa: S311 - an estimate, not a secret
    ends = list(itertools.accumulate(random.weights))
    return tuple(random.outcomes[bisect_right(ends, int(chance.random() * ends[-1]))] for _ in range(number))


class Law(NamedTuple):
    """The joint outcomes over which the cost of a constraint is averaged.

    Attributes:
        observed: Random variables of which all joint outcomes count.
        drawn: Random variables of which samples count. Empty: the average is the exact expectation.
        counts: The weights of the joint outcomes of `drawn`.
        places: The decimal places of the weights.
    """

    observed: Sequence[RandomVariable]
    drawn: Sequence[RandomVariable]
    counts: Mapping[tuple[int, ...], int]
    places: int

    @property
    def number(self) -> int:
        """Return the number of different joint outcomes."""
        return math.prod(len(one.outcomes) for one in self.observed) * len(self.counts)

    @property
    def factor(self) -> int:
        """Return the greatest common divisor of all weights."""
        return math.gcd(*self.counts.values()) * math.prod(math.gcd(*one.weights) for one in self.observed)

    def cases(self) -> Iterator[tuple[int, dict[str, int]]]:
        """Yield the joint outcomes, each with its weight."""
        names = [one.name for one in self.drawn]
        for weight, scenario in joint_outcomes(self.observed):
            for values, count in self.counts.items():
                yield weight * count, scenario | dict(zip(names, values, strict=True))

    def undrawn(self) -> Iterator[tuple[int, dict[str, int]]]:
        """Yield the joint outcomes that are not in the samples, each with the weight 0."""
        for _, scenario in joint_outcomes([*self.observed, *self.drawn] if self.drawn else ()):
            if tuple(scenario[one.name] for one in self.drawn) not in self.counts:
                yield 0, scenario


def exact_law(randoms: Sequence[RandomVariable]) -> Law:
    """Return the law that contains all joint outcomes of `randoms`."""
    return Law(randoms, (), {(): 1}, sum(one.places for one in randoms))


def sampled_law(observed: Sequence[RandomVariable], drawn: Sequence[RandomVariable], samples: Samples) -> Law:
    """Return the law that contains all joint outcomes of `observed`, with the samples of `drawn` for each of them."""
    weight = 10**samples.places // samples.number
    counts = Counter(zip(*(samples.draws(one) for one in drawn), strict=True))
    places = samples.places + sum(one.places for one in observed)
    return Law(observed, drawn, {values: count * weight for values, count in counts.items()}, places)


def joint_outcomes(randoms: Sequence[RandomVariable]) -> Iterator[tuple[int, dict[str, int]]]:
    """Yield the joint outcomes of `randoms`, each with the product of the weights."""
    for chosen in itertools.product(*(zip(one.outcomes, one.weights, strict=True) for one in randoms)):
        weight = math.prod(weight for _, weight in chosen)
        yield weight, {one.name: outcome for one, (outcome, _) in zip(randoms, chosen, strict=True)}


def can_be_infinite(constraint: Constraint) -> bool:
    """Return whether some outcomes may violate a constraint with costs. Those must be checked, not sampled."""
    match constraint.definition:
        case Relation(costs=costs, default_cost=default):
            return INFINITE in {default, *costs}
        case Function(body=body):
            return _can_be_undefined(body)
        case _:
            return False


def _can_be_undefined(expression: Expression) -> bool:
    match expression:
        case Apply("div" | "mod", (operand, Constant(number))) if number:
            return _can_be_undefined(operand)
        case Apply("pow", (operand, Constant(number))) if number >= 0:
            return _can_be_undefined(operand)
        case Apply(operator, arguments):
            return operator in {"div", "mod", "pow"} or any(map(_can_be_undefined, arguments))
        case _:
            return False
