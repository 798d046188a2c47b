"""Functional expressions, the bodies of predicates and functions, as trees (docs/reference/format.md; Figure 2).

The operators are those of XCSP 2.1. A text is parsed and type-checked, and never passed to `eval`. Results stay within
64 bits, so that no expression can exhaust the memory; `model/magnitudes.py` rejects teams whose expressions may exceed
this. `evaluate` walks the tree, while `compile_expression` builds closures. These two implementations are independent,
and tests compare them.

All arguments of an operator are evaluated, except those of `if`. Booleans are 0 and 1.
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
    with_arguments,
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
    "with_arguments",
]
