"""Formulas over positions of variables as XCSP3 predicates over `x0`, `x1`, ..., for ACE and cosoco."""

from __future__ import annotations

from robochoc.solver.linear import Formula, Junction
from robochoc.solver.network_task import TaskComparison, TaskJunction


def in_xcsp3(formula: Formula | TaskComparison | TaskJunction) -> str:
    """Return `formula` as an XCSP3 predicate without negative numbers."""
    if isinstance(formula, Junction | TaskJunction):
        return f"{'and' if formula.every else 'or'}({','.join(map(in_xcsp3, formula.parts))})"
    left: list[str] = []
    right: list[str] = []
    for place, factor in formula.terms:
        term = f"x{place}" if abs(factor) == 1 else f"mul(x{place},{abs(factor)})"
        (left if factor > 0 else right).append(term)
    if formula.bound:
        (right if formula.bound > 0 else left).append(str(abs(formula.bound)))
    sides = (side[0] if len(side) == 1 else f"add({','.join(side)})" if side else "0" for side in (left, right))
    return f"{formula.sign}({','.join(sides)})"
