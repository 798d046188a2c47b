"""Functional expressions: what a predicate says, as a tree (docs/reference/format.md; Figure 2).

The vocabulary is XCSP 2.1's. A text is parsed by hand and type-checked, never handed to `eval`; what is computed
stays within 64 bits, so that no expression can use up the machine's memory; `model/magnitudes.py` refuses teams whose
expressions may exceed that. `evaluate` walks the tree and `compile_expression` builds closures: two independent
implementations of the same meaning, which the tests compare with each other.

All arguments of an operator are evaluated, whatever the others are; only `if` chooses. Booleans are 0 and 1.
"""

from robochoc.model.expression.closures import compile_expression
from robochoc.model.expression.operators import ALIASES, OPERATORS, evaluate
from robochoc.model.expression.parser import ExpressionError, SymbolNames, parse
from robochoc.model.expression.tree import (
    Apply,
    Constant,
    ExcessiveValueError,
    Expression,
    Name,
    Type,
    UndefinedValueError,
    names,
    text,
    total,
)

__all__ = [
    "ALIASES",
    "OPERATORS",
    "Apply",
    "Constant",
    "ExcessiveValueError",
    "Expression",
    "ExpressionError",
    "Name",
    "SymbolNames",
    "Type",
    "UndefinedValueError",
    "compile_expression",
    "evaluate",
    "names",
    "parse",
    "text",
    "total",
]
