"""The table of XCSP 2.1 operators, and the evaluation of expressions."""

from __future__ import annotations

import operator as arithmetic
from collections.abc import Callable, Mapping
from functools import reduce
from typing import NamedTuple

from robochoc.model.expression.tree import (
    BOUND,
    Apply,
    Constant,
    ExcessiveValueError,
    Expression,
    Name,
    Type,
    UndefinedValueError,
)


def _bounded(value: int) -> int:
    if -BOUND <= value <= BOUND:
        return value
    raise ExcessiveValueError


def _quotient(dividend: int, divisor: int) -> int:
    """Return the quotient, truncated towards zero."""
    if divisor == 0:
        raise UndefinedValueError
    size = abs(dividend) // abs(divisor)
    return size if (dividend < 0) == (divisor < 0) else -size


def _remainder(dividend: int, divisor: int) -> int:
    """Return the remainder, with the sign of the dividend."""
    return dividend - divisor * _quotient(dividend, divisor)


def _power(base: int, exponent: int) -> int:
    """Return the power. Its size is checked first, because large powers would exhaust the memory."""
    if exponent < 0:
        raise UndefinedValueError
    if abs(base) > 1 and exponent >= BOUND.bit_length():
        raise ExcessiveValueError
    return int(base**exponent)


def _all_equal(first: int, *others: int) -> bool:
    return all(other == first for other in others)


class Operator(NamedTuple):
    """A row of the table: the types of the arguments and the result, and the `meaning`, which `evaluate` computes."""

    takes: tuple[Type, ...]
    gives: Type
    meaning: Callable[..., int]
    variadic: bool = False
    """True if the operator has two or more arguments. `meaning` folds them from the left, unless `takes_all` is set."""
    infix: str = ""
    """A sign. If the only argument is an infix term with this sign, its operands are the arguments: `minus(i-j)`."""
    takes_all: bool = False
    """True if `meaning` receives all arguments at once."""


_I, _B = Type.INTEGER, Type.BOOLEAN

OPERATORS: dict[str, Operator] = {
    "neg": Operator((_I,), _I, arithmetic.neg),
    "abs": Operator((_I,), _I, abs),
    "sqr": Operator((_I,), _I, lambda x: x * x),
    "add": Operator((_I, _I), _I, arithmetic.add, variadic=True, infix="+"),
    "sub": Operator((_I, _I), _I, arithmetic.sub, infix="-"),
    "mul": Operator((_I, _I), _I, arithmetic.mul, variadic=True, infix="*"),
    "div": Operator((_I, _I), _I, _quotient),
    "mod": Operator((_I, _I), _I, _remainder),
    "pow": Operator((_I, _I), _I, _power),
    "min": Operator((_I, _I), _I, min, variadic=True),
    "max": Operator((_I, _I), _I, max, variadic=True),
    "dist": Operator((_I, _I), _I, lambda x, y: abs(x - y), infix="-"),
    "eq": Operator((_I, _I), _B, _all_equal, variadic=True, takes_all=True),
    "ne": Operator((_I, _I), _B, arithmetic.ne),
    "lt": Operator((_I, _I), _B, arithmetic.lt),
    "le": Operator((_I, _I), _B, arithmetic.le),
    "gt": Operator((_I, _I), _B, arithmetic.gt),
    "ge": Operator((_I, _I), _B, arithmetic.ge),
    "in": Operator((_I, _I), _B, lambda x, *members: x in members, variadic=True, takes_all=True),
    "not": Operator((_B,), _B, arithmetic.not_),
    "and": Operator((_B, _B), _B, arithmetic.and_, variadic=True),
    "or": Operator((_B, _B), _B, arithmetic.or_, variadic=True),
    "xor": Operator((_B, _B), _B, arithmetic.xor, variadic=True),
    "iff": Operator((_B, _B), _B, _all_equal, variadic=True, takes_all=True),
    "imp": Operator((_B, _B), _B, lambda condition, consequence: not condition or consequence),
    "if": Operator((_B, _I, _I), _I, lambda condition, then, otherwise: then if condition else otherwise),
}
ALIASES = {"neq": "ne", "minus": "sub", "plus": "add"}
"""The names of some operators in the paper."""


def evaluate(expression: Expression, environment: Mapping[str, int]) -> int:
    """Return the value of `expression`. Booleans are 0 and 1.

    Args:
        expression: The expression.
        environment: The values of the names in the expression.

    Raises:
        UndefinedValueError: for a division by zero, a negative exponent, or a result beyond +-2**63.
    """
    match expression:
        case Constant(value):
            return value
        case Name(name):
            return environment[name]
        case Apply("if", (condition, then, otherwise)):
            return evaluate(then if evaluate(condition, environment) else otherwise, environment)
        case Apply(operator, arguments):
            values = [evaluate(argument, environment) for argument in arguments]
            meaning = OPERATORS[operator].meaning
            if len(values) == 1 or OPERATORS[operator].takes_all:
                return _bounded(int(meaning(*values)))
            return reduce(lambda left, right: _bounded(int(meaning(left, right))), values)
