"""The unit of a team's costs. Users see decimals, maximised or with a constant; internally all costs are integers."""

from __future__ import annotations

from collections.abc import Iterable
from decimal import Decimal

from robochoc.system.lazy_dataclass import dataclass

MAX_PLACES = 9
"""The maximum number of decimal places of a cost."""

Cost = int | Decimal
"""A cost in the user's units: exact, and an integer if the team's costs have no decimal places."""


@dataclass(frozen=True)
class CostUnits:
    """The unit of costs, and the objective.

    Attributes:
        maximize: True if the sum is maximised. Otherwise it is minimised.
        places: The decimal places of the costs: with 3, an integer cost of 1 is 0.001 for the user.
        constant: An integer that is added to the sum, in the same unit.
    """

    maximize: bool = False
    places: int = 0
    constant: int = 0

    def in_user_units(self, total: float) -> Cost:
        """Return `total`, a number of these units without the constant, in the user's units with the constant."""
        cost = int(total) + self.constant
        return Decimal(cost).scaleb(-self.places) if self.places else cost


def cost_shown(cost: Cost | float) -> str:
    """Return a cost as text for people: all its digits, with commas for thousands, never `1.5E-8` nor `2.0`."""
    if isinstance(cost, float) and cost.is_integer():
        return f"{int(cost):,}"
    return f"{cost:,f}" if isinstance(cost, Decimal) else f"{cost:,}"


def in_unit(text: str, places: int) -> str:
    """Return `text`, an expression of a cost in units of 10^-`places`, as an expression in the user's unit."""
    return f"{Decimal(1).scaleb(-places):f} · ({text})" if places else text


PLAIN_COSTS = CostUnits()
"""Integers that are minimised."""


def common_units(units: Iterable[CostUnits]) -> CostUnits:
    """Return the units of a team whose robots have these `units`: the finest, with the sum of all constants."""
    known = list(units)
    places = max((unit.places for unit in known), default=0)
    constant = sum(unit.constant * 10 ** (places - unit.places) for unit in known)
    return CostUnits(any(unit.maximize for unit in known), places, constant)
