"""Estimate the expected cost of a policy from samples that are independent of the search.

The confidence interval is an empirical Bernstein bound (Maurer and Pontil, "Empirical Bernstein bounds and
sample-variance penalization", COLT 2009, theorem 4, for both sides). It needs no assumption on the distribution of
costs, only their range.
"""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction

from robochoc.verification.policies import PolicyCosts, drawn_cases

METHOD = "empirical Bernstein"
MOST_FRESH, LEAST_FRESH = 10_000, 1_000
"""The limits on the number of samples."""
MOST_COSTS = 200_000
"""The number of costs that are computed, unless this requires fewer than `LEAST_FRESH` samples."""
_ERROR = 0.05
_DIGITS = Context(prec=60)


def estimate(costs: PolicyCosts) -> tuple[int, Decimal | None, Decimal | None]:
    """Return the number of samples, and the ends of a 95 % confidence interval of the expected cost of a policy.

    Constraints with few outcomes contribute their exact expected cost. The interval is None if the range of costs is
    unknown.
    """
    spread = sum(map(costs.spread, costs.large))
    number = min(MOST_FRESH, max(LEAST_FRESH, MOST_COSTS // len(costs.large)))
    if math.isinf(spread):
        return 0, None, None
    randoms = {one.name: one for large in costs.large for one in costs.outcomes.on_which(large.scope)}
    cases = drawn_cases(randoms.values(), replace(costs.samples, number=number), "fresh")
    found = [sum((costs.cost(one, case) for one in costs.large), Fraction(0)) for case in cases]
    mean = sum(found, Fraction(0)) / number
    width = _half_width(found, mean, spread)
    middle = costs.expected_without(costs.large) + mean
    places = max(2, 2 - math.floor(math.log10(width))) if width else 2
    return number, _rounded(middle - width, places, ROUND_FLOOR), _rounded(middle + width, places, ROUND_CEILING)


def _half_width(costs: list[Fraction], mean: Fraction, spread: float) -> Fraction:
    number = len(costs)
    variance = sum(float(cost - mean) ** 2 for cost in costs) / (number - 1)
    size = math.log(4 / _ERROR)  # each side has half of the error
    return Fraction(math.sqrt(2 * variance * size / number) + 7 * spread * size / (3 * (number - 1)))


def _rounded(cost: Fraction, places: int, rounding: str) -> Decimal:
    exact = _DIGITS.divide(Decimal(cost.numerator), Decimal(cost.denominator))
    return exact.quantize(Decimal(1).scaleb(-places), rounding, _DIGITS)
