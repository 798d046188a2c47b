"""Translate simple functions in pyDCOP's files to predicates and functions, which are cheaper than tables."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.dialects.exact_costs import Amount
from robochoc.formats.dialects.pydcop.python_values import NoValueError, Value, literal
from robochoc.model.constraint import Domain
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.expression.parser import MAX_DEPTH
from robochoc.system.lazy_dataclass import dataclass

_LARGEST = 2**62
"""The limit on all intermediate results. Unlike in Python, values in robochoc are undefined from 2**63 on."""
_MAX_PARTS = 1000
_NEGATION = {"eq": "ne", "ne": "eq", "lt": "ge", "ge": "lt", "gt": "le", "le": "gt"}
_ARITHMETIC = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
_COMPARISONS = {ast.Eq: "eq", ast.NotEq: "ne", ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}
_CALLS = {"abs": (1, 1), "min": (2, 99), "max": (2, 99)}


@dataclass(frozen=True)
class VariableInfo:
    """A variable's domain in the team, and the type of its values in the file.

    Attributes:
        domain: Its domain.
        kind: The common type of all its values, or None if they have several types.
    """

    domain: Domain
    kind: type | None


class ViolationCost(NamedTuple):
    """A predicate, and the cost of its violation."""

    body: Expression
    cost: Amount


class _NotTranslatableError(Exception):
    """Raised if a function has no counterpart in robochoc's expressions."""


def translate(
    body: Sequence[ast.stmt], scope: Sequence[str], variables: Mapping[str, VariableInfo], fixed: Mapping[str, Value]
) -> ViolationCost | Expression | None:
    """Translate the statements of a function, with formal parameters X0, X1, ... in the order of `scope`.

    Returns:
        A predicate and its cost, an expression whose value is the cost, or None if the function requires a table.
    """
    try:
        return _Translator(scope, variables, fixed).cost(_as_expression(body))
    except (_NotTranslatableError, NoValueError):
        return None


def _as_expression(body: Sequence[ast.stmt]) -> ast.expr:
    """Return one expression for statements that only select the value to return."""
    match body:
        case [ast.Expr(value=value)] | [ast.Return(value=ast.expr() as value), *_]:
            return value
        case [ast.If(test=test, body=then, orelse=otherwise), *rest]:
            return ast.IfExp(test, _as_expression(then), _as_expression([*otherwise, *rest]))
        case _:
            raise _NotTranslatableError


class _Translator:
    def __init__(self, scope: Sequence[str], variables: Mapping[str, VariableInfo], fixed: Mapping[str, Value]) -> None:
        self._fixed = fixed
        self._variables = variables
        self._formal = {name: f"X{place}" for place, name in enumerate(scope)}
        self._limits: dict[str, Interval] = {}
        for name, formal in self._formal.items():
            ranges = variables[name].domain.ranges
            self._limits[formal] = Interval(ranges[0][0], ranges[-1][-1])
        self._parts = 0

    def cost(self, node: ast.expr) -> ViolationCost | Expression:
        """Return a predicate with its cost if one of two costs is 0, otherwise an integer expression."""
        match node:
            case ast.IfExp(test=test, body=then, orelse=otherwise):
                first, second = _amount(then), _amount(otherwise)
                if first == 0 and second is not None:
                    return ViolationCost(self.boolean(test), second)
                if second == 0 and first is not None:
                    return ViolationCost(_negate(self.boolean(test)), first)
            case _:
                pass
        return self.integer(node)

    def integer(self, node: ast.expr) -> Expression:  # noqa: C901, PLR0911, PLR0912 - one case for each kind of node
        """Return an integer expression. Booleans are 0 and 1, as in Python."""
        match node:
            case ast.Constant(value=bool(value)):
                return Constant(int(value))
            case ast.Constant(value=int(value)):
                return self._checked(Constant(value))
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int(value))):
                return self._checked(Constant(-value))
            case ast.Name(id=name) if type(fixed := self._fixed.get(name)) is int:
                return self._checked(Constant(int(fixed)))
            case ast.Name(id=name) if self._kind(name) is int:
                return self._checked(Name(self._formal[name]))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._apply("neg", [operand])
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.integer(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return self._apply(_ARITHMETIC[type(op)], [left, right])
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _CALLS:
                least, most = _CALLS[name]
                if least <= len(arguments) <= most:
                    return self._apply(name, arguments)
            case ast.IfExp(test=test, body=then, orelse=otherwise):
                return self._conditional(self.boolean(test), self.integer(then), self.integer(otherwise))
            case ast.Compare() | ast.UnaryOp(op=ast.Not()):
                return self._conditional(self.boolean(node), Constant(1), Constant(0))
            case _:
                pass
        raise _NotTranslatableError

    def boolean(self, node: ast.expr) -> Expression:
        """Return a Boolean expression."""
        match node:
            case ast.Compare(left=left, ops=ops, comparators=others):
                terms = [left, *others]
                parts = [self._comparison_of(*three) for three in zip(ops, terms, others, strict=False)]
                return parts[0] if len(parts) == 1 else self._checked(Apply("and", tuple(parts)))
            case ast.BoolOp(op=op, values=values):
                name = "and" if isinstance(op, ast.And) else "or"
                return self._checked(Apply(name, tuple([self.boolean(one) for one in values])))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return _negate(self.boolean(operand))
            case _:
                raise _NotTranslatableError

    def _comparison_of(self, op: ast.cmpop, left: ast.expr, right: ast.expr) -> Expression:
        name = _COMPARISONS.get(type(op))
        if name is None:
            raise _NotTranslatableError
        match left, right:
            case ast.Name(id=one), ast.Name(id=other) if name in ("eq", "ne") and self._have_equal_codes(one, other):
                return self._checked(Apply(name, (Name(self._formal[one]), Name(self._formal[other]))))
            case _:
                return self._checked(Apply(name, (self.integer(left), self.integer(right))))

    def _have_equal_codes(self, one: str, other: str) -> bool:
        """Return whether two variables' values are equal in the file whenever their integers in the team are equal."""
        kind = self._kind(one)
        return kind is not None and kind is self._kind(other)

    def _kind(self, name: str) -> type | None:
        return self._variables[name].kind if name in self._formal else None

    def _apply(self, operator: str, arguments: Sequence[ast.expr]) -> Expression:
        made = [self.integer(one) for one in arguments]
        if operator in ("add", "mul") and isinstance(made[0], Apply) and made[0].operator == operator:
            made = [*made[0].arguments, *made[1:]]  # keep a long sum flat
        return self._checked(Apply(operator, tuple(made)))

    def _conditional(self, condition: Expression, then: Expression, otherwise: Expression) -> Expression:
        return self._checked(Apply("if", (condition, then, otherwise)))

    def _checked(self, expression: Expression) -> Expression:
        """Return `expression`. Raises `_NotTranslatableError` if it is too long or its value too large."""
        self._parts += 1
        low, high = bounds(expression, self._limits)
        if self._parts > _MAX_PARTS or low < -_LARGEST or high > _LARGEST or _depth(expression) > MAX_DEPTH // 2:
            raise _NotTranslatableError
        return expression


def _depth(expression: Expression) -> int:
    return 1 + max(map(_depth, expression.arguments), default=0) if isinstance(expression, Apply) else 1


def _amount(node: ast.expr) -> Amount | None:
    """Return the value of `node`, or None if it is not a number."""
    match node:
        case ast.Constant(value=value):
            amount: Value = literal(value)
            return amount if isinstance(amount, (int, Fraction)) else None
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            amount = _amount(operand)
            return None if amount is None else -amount
        case ast.Call(func=ast.Name(id="float"), args=[ast.Constant(value="inf")], keywords=[]):
            return float("inf")
        case _:
            return None


def _negate(expression: Expression) -> Expression:
    match expression:
        case Apply("not", (inner,)):
            return inner
        case Apply(operator, arguments) if operator in _NEGATION:
            return Apply(_NEGATION[operator], arguments)
    return Apply("not", (expression,))
