"""Real numbers in domains and definitions. They are stored as integers: numbers of steps of the precision.

With the precision 0.001 (three decimal places), 1500 steps are 1.5. A real domain is an interval, and its present grid:
the values that robots can choose. `run/refinement.py` replaces grids by finer ones around the best assignment.
"""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

from robochoc.model.expression import Expression
from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from fractions import Fraction

DEFAULT_PLACES = 3
"""The decimal places of real numbers, unless a file specifies its precision."""
MOST_PLACES = 6
"""The maximum number of decimal places of real numbers."""
DEFAULT_POINTS = 9
"""The number of points on the grid of a real domain."""
MOST_POINTS = 1000
"""The maximum number of points on the grid of a real domain, unless they are listed."""


@dataclass(frozen=True)
class RealInterval:
    """The interval of a real domain.

    Attributes:
        low: The lower end, in steps.
        high: The upper end, in steps.
        places: The decimal places of the precision: a step is 10**-`places`.
        any_step: True if robots may choose any step, and not only the values on the grid.
    """

    low: int
    high: int
    places: int = DEFAULT_PLACES
    any_step: bool = False

    def number(self, steps: int) -> float:
        """Return a number of steps in the user's unit."""
        scale: int = 10**self.places
        return steps / scale

    def steps(self, number: float | Fraction) -> int | None:
        """Return a finite number in steps. None: it is outside the interval, or not a multiple of the precision."""
        from fractions import Fraction  # noqa: PLC0415 - start-up: rarely needed

        exact = Fraction(str(number)) * 10**self.places
        return int(exact) if exact.denominator == 1 and self.low <= exact <= self.high else None


@dataclass(frozen=True)
class RealParameters:
    """The parameters of a predicate or function that are real numbers.

    Attributes:
        names: The parameters. The body is an expression over their steps.
        places: The decimal places of the precision.
        source: The expression over real numbers from which the body was made (`model/expression/fixed_point.py`). None:
            the body was written or changed directly.
    """

    names: tuple[str, ...]
    places: int = DEFAULT_PLACES
    source: Expression | None = field(default=None, compare=False)

    def only(self, names: tuple[str, ...]) -> RealParameters | None:
        """Return the real parameters that are in `names`, for a changed body; None if there are none."""
        left = tuple(name for name in self.names if name in names)
        return RealParameters(left, self.places) if left else None


def grid(low: int, high: int, points: int) -> tuple[range, ...]:
    """Return evenly spaced numbers of steps from `low` to `high`, both included, as ranges of a domain."""
    spread = high - low
    values = {low + (2 * spread * place + points - 1) // (2 * (points - 1)) for place in range(points)}
    return tuple(range(value, value + 1) for value in sorted(values))
