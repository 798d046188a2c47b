"""The unit of a team's costs: users write decimals, may maximise, and add a constant; inside, costs are integers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal

MAX_PLACES = 9
"""The maximum number of decimal places of a cost."""

Cost = int | Decimal
"""A cost as it is told to the user: exact, and an integer where the team's costs have no decimal places."""


@dataclass(frozen=True)
class CostUnits:
    """The unit of costs, and what is done with their sum.

    Attributes:
        maximize: Whether the sum is maximised. Otherwise it is minimised.
        places: The decimal places of the costs: with 3, an integer cost of 1 is 0.001 to the user.
        constant: An integer that is added to the sum, in the same unit.
    """

    maximize: bool = False
    places: int = 0
    constant: int = 0

    def in_user_units(self, total: float) -> Cost:
        """Return `total`, an integer number of these units without the constant, in the user's numbers."""
        whole = int(total) + self.constant
        return Decimal(whole).scaleb(-self.places) if self.places else whole


def cost_shown(cost: Cost | float) -> str:
    """Return a cost for people: all its digits, never `1.5E-8`, nor `2.0`; thousands have commas between them."""
    if isinstance(cost, float) and cost.is_integer():
        return f"{int(cost):,}"
    return f"{cost:,f}" if isinstance(cost, Decimal) else f"{cost:,}"


PLAIN_COSTS = CostUnits()
"""Integers that are minimised."""


def common_units(units: Iterable[CostUnits]) -> CostUnits:
    """Return the units of a team whose robots have these `units`: the finest, with the sum of all constants."""
    known = list(units)
    places = max((unit.places for unit in known), default=0)
    constant = sum(unit.constant * 10 ** (places - unit.places) for unit in known)
    return CostUnits(any(unit.maximize for unit in known), places, constant)
