"""Exact costs in the notation of other tools, and their conversion to relations with integer costs."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from fractions import Fraction

from robochoc.formats.definitions import MAX_TUPLES, PREDEFINED
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import BEYOND
from robochoc.model.constraint import INFINITE, Relation, Semantics
from robochoc.model.cost_units import MAX_PLACES
from robochoc.system.lazy_dataclass import dataclass

Amount = int | Fraction | float
"""An exact cost. The only float is `INFINITE`, the cost of a forbidden tuple."""


@dataclass(frozen=True)
class ExactCostTable:
    """The costs for the values of some variables.

    Attributes:
        name: The name of the table.
        rows: The costs of the listed tuples.
        default: The cost of all other tuples.
        size: The number of all tuples, whether listed or not.
    """

    name: str
    rows: Mapping[tuple[int, ...], Amount]
    default: Amount
    size: int

    def amounts(self) -> Iterable[Amount]:
        """Return the different costs in the table."""
        return {*self.rows.values()} | ({self.default} if len(self.rows) < self.size else set())

    @property
    def least(self) -> Amount:
        """The least cost."""
        return min(self.amounts(), default=INFINITE)


class Scale:
    """The decimal places needed for a team's costs, at most nine. Costs with more places are rounded."""

    def __init__(self, amounts: Iterable[Amount]) -> None:
        needed = [decimal_places(amount) for amount in amounts if isinstance(amount, Fraction)]
        self.rounds = any(places is None or places > MAX_PLACES for places in needed)
        self.places = MAX_PLACES if self.rounds else max((places or 0 for places in needed), default=0)

    def units(self, amount: Amount) -> float:
        """Return `amount` as an integer number of units. Raises `MistakeError` if the number is too large."""
        if amount == INFINITE:
            return INFINITE
        units: int = round(Fraction(amount) * 10**self.places)
        if not -BEYOND < units < BEYOND:
            what = f"the cost {shortened(str(int(amount)))} is too large with {self.places} decimal places"
            raise MistakeError(what, "use costs of at most 18 digits, decimal places included")
        return units


def decimal_places(number: Fraction) -> int | None:
    """Return the number of decimal places of `number`, or None if it has no finite decimal form."""
    rest, twos, fives = number.denominator, 0, 0
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    return max(twos, fives) if rest == 1 else None


def relation(table: ExactCostTable, arity: int, scale: Scale) -> Relation | int:
    """Return `table` as a relation with as few tuples as possible, or as an integer if it has one finite cost only.

    Raises:
        MistakeError: if a cost or the table is too large.
    """
    rows = {values: scale.units(cost) for values, cost in table.rows.items()}
    default = scale.units(table.default)
    if len(rows) == table.size and rows:
        default = Counter(rows.values()).most_common(1)[0][0]
    listed = {values: cost for values, cost in rows.items() if cost != default}
    if not listed and default != INFINITE:
        return int(default)
    if len(listed) > MAX_TUPLES:
        what = f"the table has {len(listed)} tuples, more than the limit of {MAX_TUPLES}"
        raise MistakeError(what, "make domains or scopes smaller")
    name = definition_name(table.name)
    if not listed:  # all tuples are forbidden, so a relation over the first variable is enough
        return Relation(name, min(1, arity), Semantics.SUPPORTS, ())
    if {*listed.values(), default} <= {0, INFINITE}:
        semantics = Semantics.CONFLICTS if default == 0 else Semantics.SUPPORTS
        return Relation(name, arity, semantics, tuple(listed))
    return Relation(name, arity, Semantics.SOFT, tuple(listed), tuple(listed.values()), default)


def xml_name(name: str) -> str:
    """Return `name` as a valid name of a constraint: without blanks and characters that XML does not allow."""
    return re.sub(r"[^!-~\u00a1-\ud7ff\ue000-\ufffd]", "_", name) or "_"


def definition_name(name: str) -> str:
    """Return `name` as a valid name of a relation, predicate or function."""
    plain = xml_name(name)
    return f"{plain}_" if plain in PREDEFINED or plain.startswith("global:") else plain


def apply_infinity(amount: Amount, infinity: int | None, *, maximize: bool) -> Amount:
    """Return `amount`, or `INFINITE` if it is the cost of a forbidden tuple.

    Args:
        amount: A cost. It may be an infinity of either sign.
        infinity: Costs of at least this are infinite; when maximising, costs of at most its negative. None: no finite
            cost is.
        maximize: True if costs are maximised.

    Raises:
        MistakeError: if `amount` is an infinity that would be the best possible cost.
    """
    bad = -amount if maximize else amount
    if bad == -math.inf:
        what = f"the cost {'infinity' if maximize else '-infinity'} would be better than all others"
        raise MistakeError(what, f"write a number; only {'-infinity' if maximize else 'infinity'} is allowed")
    return INFINITE if bad == math.inf or (infinity is not None and bad >= infinity) else amount
