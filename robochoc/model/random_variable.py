"""Random variables: values drawn by chance, on which costs and constraints depend (docs/guides/uncertainty.md)."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING

from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from fractions import Fraction


@dataclass(frozen=True)
class RandomVariable:
    """A variable whose value is drawn by chance, independently of all other random variables.

    Attributes:
        name: Its name, which no decision variable of the team has.
        outcomes: The possible values, integers.
        weights: The probability of each outcome, in units of 10^-`places`: positive integers with the sum 10^`places`.
        places: The decimal places of the probabilities.
        seen_by: The decision variables whose values are chosen after the outcome was observed.
        line: The line in the file from which the random variable was read.
    """

    name: str
    outcomes: tuple[int, ...]
    weights: tuple[int, ...]
    places: int = 0
    seen_by: tuple[str, ...] = ()
    line: int = field(default=0, compare=False)

    @cached_property
    def probabilities(self) -> dict[int, Fraction]:
        """The probability of each outcome."""
        from fractions import Fraction  # noqa: PLC0415 - start-up: rarely needed

        unit: int = 10**self.places
        return {value: Fraction(weight, unit) for value, weight in zip(self.outcomes, self.weights, strict=True)}
