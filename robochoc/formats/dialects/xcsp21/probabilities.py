"""Random variables of FRODO: their probabilities, rounded to decimals that keep expected costs exact.

FRODO's format, in its XCSPschema.xsd: a `variable` with `type="random"` and no agent, and a `probability` whose tuples
have the probabilities as costs. A constraint over the random variable refers to the probability.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from decimal import Decimal, InvalidOperation
from fractions import Fraction

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.exact_costs import decimal_places
from robochoc.formats.dialects.xcsp21.numbers import integer, split_tuples
from robochoc.formats.element_view import ElementView
from robochoc.model.cost_units import MAX_PLACES
from robochoc.model.random_variable import RandomVariable

MOST_PLACES = 6
"""The maximum number of decimal places of imported probabilities."""
_MAX_LENGTH = 40
_TOLERANCE = Fraction(1, 10**6)
"""The maximum difference between 1 and a sum of floating-point probabilities."""

Law = Mapping[int, Fraction]
"""The probability of each outcome."""


class ProbabilityTable:
    """A `probability` element: the probabilities of the listed outcomes, and that of each other value."""

    def __init__(self, element: ElementView) -> None:
        element.ignore_attributes("nbTuples", "semantics", "arity")
        default = element.attribute("defaultProb")
        self._default = _probability(default) if default else Fraction(0)
        self._listed: dict[int, Fraction] = {}
        now = ""
        for probability, values in split_tuples(element.text()):
            now = probability or now
            words = values.split()
            if len(words) != 1 or not now:
                raise MistakeError(f"'{shortened(values.strip())}' is not an outcome", "write probability: value")
            outcome = integer(words[0])
            if outcome in self._listed:
                raise MistakeError(f"the outcome {outcome} occurs twice", "add up its probabilities")
            self._listed[outcome] = _probability(now)

    def law(self, domain: Iterable[int], variable: str) -> Law:
        """Return the probabilities of the values in `domain` that are possible. Raises `MistakeError`."""
        values = dict.fromkeys(domain)
        if outside := [value for value in self._listed if value not in values]:
            message = f"the outcome {outside[0]} is not in the domain of '{shortened(variable)}'"
            raise MistakeError(message, "add it to the domain, or delete it")
        found = {value: self._listed.get(value, self._default) for value in values}
        if abs(sum(found.values(), Fraction(0)) - 1) > _TOLERANCE:
            total = f"{float(sum(found.values())):.9g}"
            raise MistakeError(f"the probabilities of '{shortened(variable)}' have the sum {total}", "use the sum 1")
        return {value: one for value, one in found.items() if one}


def random_variables(laws: Mapping[str, Law], most: int) -> tuple[list[RandomVariable], bool]:
    """Return random variables with the probabilities `laws`, by name, and whether a probability was rounded.

    Args:
        laws: The laws, each with at most 10^`most` outcomes.
        most: The maximum number of decimal places of probabilities, at least 1.
    """
    exact = [decimal_places(one) for law in laws.values() for one in law.values()]
    is_exact = all(places is not None and places <= most for places in exact)
    sums = all(sum(law.values()) == 1 for law in laws.values())
    places = max((places or 0 for places in exact), default=0) if is_exact and sums else most
    return [_rounded(name, law, places) for name, law in laws.items()], not (is_exact and sums)


def places_left(cost_places: int, together: int) -> int:
    """Return the decimal places that remain for probabilities.

    Args:
        cost_places: The decimal places of the costs.
        together: The maximum number of random variables in a constraint.
    """
    return min(MOST_PLACES, (MAX_PLACES - cost_places) // max(1, together))


def _rounded(name: str, law: Law, places: int) -> RandomVariable:
    """Return a random variable whose probabilities are rounded: the sum is 1, and none is 0."""
    unit = 10**places
    weights = {value: max(1, math.floor(one * unit)) for value, one in law.items()}
    missing = unit - sum(weights.values())
    by_rest = sorted(law, key=lambda value: math.floor(law[value] * unit) - law[value] * unit)
    for number in range(missing):
        weights[by_rest[number % len(by_rest)]] += 1
    for value in sorted(weights, key=weights.__getitem__, reverse=True):
        taken = max(0, min(-missing, weights[value] - 1))
        weights[value] -= taken
        missing += taken
    return RandomVariable(name, tuple(weights), tuple(weights.values()), places)


def _probability(word: str) -> Fraction:
    try:
        found = Decimal(word.strip()) if len(word) <= _MAX_LENGTH else Decimal("nan")
    except InvalidOperation:
        found = Decimal("nan")
    if not found.is_finite() or not 0 <= found <= 1 or (found and found.adjusted() < -_MAX_LENGTH):
        raise MistakeError(f"'{shortened(word.strip())}' is not a probability", "write a decimal from 0 to 1")
    return Fraction(found)
