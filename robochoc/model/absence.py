"""The meaning of a constraint when a robot is absent: it has withdrawn, was lost, or was removed by an event.

The definition, with examples, is in docs/reference/absence.md. An aggregate of similar terms that is compared with
numbers loses the terms of the absent robots and stays in force. Every other constraint over a variable of an absent
robot is dropped. The author of a constraint may choose another meaning (`WhenAbsent`). The searches, the checker, the
central solvers and the changes of a team all use `restated`.
"""

from __future__ import annotations

import itertools
import re
import zlib
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace

from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Function,
    GlobalPredicate,
    Predicate,
    Relation,
    WhenAbsent,
)
from robochoc.model.expression import Apply, Constant, Expression, Name, names, text
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

AGGREGATES = frozenset({"add", "min", "max", "and", "or"})
"""The operators whose arguments are terms of an aggregate."""
_COMPARING = AGGREGATES | {"eq", "ne", "lt", "le", "gt", "ge", "in", "not", "sub", "neg", "mul", "if"}
"""The operators that may compare an aggregate with numbers, or combine it with numbers before that."""
_CONNECTIVES = frozenset({"and", "or"})
"""The operators that join conditions."""
_NUMBERS = frozenset({"add", "min", "max"})
"""Aggregates of numbers. The numbers in their terms may differ between robots."""
_ALL_DIFFERENT, _CUMULATIVE = "global:allDifferent", "global:cumulative"
_GROUP = re.compile(r"\{[^}]*\}")
_FALSE = Predicate("absent", (), Apply("eq", (Constant(0), Constant(1))))
_NEVER = Predicate("absent", ("X",), Apply("ne", (Name("X"), Name("X"))))
_TWO = 2


@dataclass(frozen=True)
class DroppedConstraint:
    """A constraint that is not in force because one of its robots is absent.

    Attributes:
        name: The name of the constraint.
        robots: The robots in its scope, including absent ones, in priority order.
    """

    name: str
    robots: tuple[str, ...]


class NotAnAggregateError(RobochocError):
    """Raised if an expression is not an aggregate of similar terms that is compared with numbers."""


def restated(constraint: Constraint, absent: Collection[str]) -> Constraint | None:
    """Return `constraint`, restated for the remaining robots, or None if it is dropped.

    A constraint that has been restated before is restated from its original form, so the order in which robots leave
    does not matter.

    Args:
        constraint: The constraint.
        absent: All variables of the absent robots.
    """
    gone = tuple([name for name in constraint.variables if name in absent])
    if not gone:
        return constraint
    if constraint.when_absent == WhenAbsent.FAIL:
        stay = tuple([name for name in constraint.variables if name not in gone])
        return replace(broken(constraint, stay[:1]), original=constraint, absent=gone)
    original = constraint.original or constraint
    gone += constraint.absent
    try:
        found = _remaining(original, gone)
    except NotAnAggregateError:
        return None
    return found and replace(found, original=original, absent=gone)


def can_be_restated(constraint: Constraint) -> bool:
    """Return whether `constraint` can stay in force when one of its robots is absent.

    `x != y` is treated as all different over two variables: without one of them it is always satisfied.
    """
    if constraint.model == ConstraintModel.PKC or isinstance(constraint.definition, Relation):
        return False
    if _is_difference(constraint):
        return True
    try:
        for name in constraint.variables:
            _remaining(replace(constraint, when_absent=None), {name})
    except NotAnAggregateError:
        return False
    return True


def may_count_when_absent(constraint: Constraint) -> bool:
    """Return whether `constraint` may cost or forbid something when one of its robots is absent."""
    if constraint.when_absent == WhenAbsent.FAIL:
        return True
    if constraint.when_absent == WhenAbsent.DROP or _is_difference(constraint):
        return False
    return can_be_restated(constraint)


def _remaining(constraint: Constraint, gone: Collection[str]) -> Constraint | None:
    """Return a constraint without the variables `gone`, or None if it is dropped. Raises `NotAnAggregateError`."""
    definition = constraint.definition
    if (
        constraint.when_absent == WhenAbsent.DROP
        or constraint.model == ConstraintModel.PKC
        or isinstance(definition, Relation)
        or (isinstance(definition, Function) and not _is_choice(definition.body))
    ):
        raise NotAnAggregateError
    formals = _formals(constraint)
    lost = frozenset(formal for formal, term in formals.items() if term in gone)
    left: Predicate | Function | None
    if isinstance(definition, GlobalPredicate):
        left = _remaining_global(definition, lost)
        terms = [formals[name] for name in left.parameters] if left else []
    else:
        body = without_terms(_with_constants(definition.body, formals), lost)
        remaining = names(body) if body else ()
        symbolic = tuple(name for name in definition.symbolic if name in remaining)
        if body is None:
            return None
        name = f"{definition.name}_{zlib.crc32(text(body).encode()):08x}"  # one definition may have several of them
        real = definition.real and definition.real.only(remaining)
        left = replace(definition, name=name, parameters=remaining, body=body, symbolic=symbolic, real=real)
        terms = [formals[name] for name in remaining]
    if left is None:
        return None
    scope = tuple(term for term in constraint.scope if term in terms)
    return replace(constraint, definition=left, scope=scope, parameters=tuple(terms))


def without_terms(expression: Expression, lost: Collection[str]) -> Expression | None:
    """Return an aggregate, compared with numbers, without the terms that contain the names `lost`.

    Returns:
        The remaining aggregate, or None if it has lost all terms.

    Raises:
        NotAnAggregateError: if `expression` has another form.
    """
    mentioned = names(expression)
    if not any(name in lost for name in mentioned):
        return expression
    if not isinstance(expression, Apply):
        return None
    terms = [one for one in _flat(expression) if names(one)]
    if len(terms) >= _TWO:
        if _is_about_one(expression, terms):
            left = [without_terms(one, lost) for one in _flat(expression)]
        elif _is_all_different(expression) or (
            expression.operator in AGGREGATES and _alike(expression.operator, terms)
        ):
            left = [_term(one, lost) for one in _flat(expression)]
        else:
            raise NotAnAggregateError
        others = [one for one in left if one is not None]
        if not any(names(one) for one in others):
            return None
        return others[0] if len(others) == 1 else Apply(expression.operator, tuple(others))
    if expression.operator not in _COMPARING:
        raise NotAnAggregateError
    (term,) = terms
    remaining = without_terms(term, lost)
    if remaining is None:
        return None
    return Apply(expression.operator, tuple(remaining if one is term else one for one in _flat(expression)))


def _is_all_different(expression: Apply) -> bool:
    """Return whether `expression` requires all of some terms and numbers to be pairwise different."""
    if expression.operator != "and" or any(
        not isinstance(one, Apply) or one.operator != "ne" for one in _flat(expression)
    ):
        return False
    pairs = {frozenset(one.arguments) for one in _flat(expression) if isinstance(one, Apply)}
    listed = dict.fromkeys(one for pair in pairs for one in pair)
    return all(frozenset(pair) in pairs or not any(map(names, pair)) for pair in itertools.combinations(listed, 2))


def _is_about_one(expression: Apply, terms: Iterable[Expression]) -> bool:
    """Return whether `expression` joins conditions on a single aggregate: it lies between numbers, or is in a set."""
    return expression.operator in _CONNECTIVES and len({_compared(one) for one in terms}) == 1


def _compared(expression: Expression) -> Expression:
    """Return the part of `expression` that is compared with numbers."""
    while isinstance(expression, Apply):
        terms = [one for one in _flat(expression) if names(one)]
        if len(terms) != 1 and not _is_about_one(expression, terms):
            break
        expression = terms[0]
    return expression


def _term(term: Expression, lost: Collection[str]) -> Expression | None:
    """Return a term of an aggregate without the names `lost`, or None if the term is lost.

    A term over several robots is restated if it is an aggregate itself and contains two remaining robots, or if each of
    its parts contains the last remaining robot (the load at the start of a task).
    """
    if not any(name in lost for name in names(term)):
        return term
    try:
        left = without_terms(term, lost)
    except NotAnAggregateError:
        return None
    if left is None or len(names(left)) >= _TWO:
        return left
    whole = _compared(term)
    parts = [one for one in _flat(whole) if names(one)] if isinstance(whole, Apply) else []
    return left if all({*names(left)} <= {*names(one)} for one in parts) else None


def _flat(expression: Apply) -> Sequence[Expression]:
    """Return the arguments of an aggregate, including the arguments of nested aggregates of the same kind."""
    if expression.operator not in AGGREGATES:
        return expression.arguments
    found: list[Expression] = []
    for one in expression.arguments:
        same = isinstance(one, Apply) and one.operator == expression.operator
        found += _flat(one) if same and isinstance(one, Apply) else [one]
    return found


def _alike(operator: str, terms: Iterable[Expression]) -> bool:
    """Return whether the terms are equal except for names, and in an aggregate of numbers, also except for numbers."""
    return len({_shape(term, loose=operator in _NUMBERS) for term in terms}) == 1


def _shape(expression: Expression, *, loose: bool) -> Hashable:
    """Return the form of a term without names. With `loose`, numbers are removed too, except the signs of factors."""
    if loose and not names(expression):
        return "number"
    sign, part = _without_numbers(expression) if loose else (1, expression)
    if sign < 0:
        return "minus", _shape(part, loose=True)
    match part:
        case Name():
            return "name"
        case Constant(value):
            return value
        case Apply("if", (test, Constant(then), Constant(otherwise))) if loose:
            return "if", _shape(test, loose=True), _sign(then), _sign(otherwise)
        case Apply(operator, _):
            parts = [_shape(one, loose=loose) for one in _flat(part)]
            return parts[0] if operator in {"and", "or"} and len({*parts}) == 1 else (operator, *parts)


def _without_numbers(expression: Expression) -> tuple[int, Expression]:
    """Return the sign of a term's factor, and the term without the numbers added to it or multiplied by it."""
    sign = 1
    while isinstance(expression, Apply) and expression.operator in {"neg", "add", "sub", "mul"}:
        terms = [one for one in _flat(expression) if names(one)]
        if expression.operator == "mul":
            factors = [one.value for one in expression.arguments if isinstance(one, Constant)]
            sign *= (-1) ** sum(factor < 0 for factor in factors)
            if factors and len(terms) > 1:
                return sign, Apply("mul", tuple(terms))
        if len(terms) > 1:
            break
        if expression.operator == "neg" or (expression.operator == "sub" and expression.arguments[1] is terms[0]):
            sign = -sign
        (expression,) = terms
    return sign, expression


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)


def _formals(constraint: Constraint) -> dict[str, str | int]:
    """Return the actual parameter for each formal parameter."""
    definition = constraint.definition
    parameters = () if isinstance(definition, Relation) else definition.parameters
    return dict(zip(parameters, constraint.parameters, strict=True))


def _with_constants(expression: Expression, formals: Mapping[str, str | int]) -> Expression:
    """Return `expression` with numbers substituted for the formal parameters whose actual parameters are numbers."""
    match expression:
        case Name(name):
            actual = formals[name]
            return Constant(actual) if isinstance(actual, int) else expression
        case Apply(operator, arguments) if any(isinstance(formals[name], int) for name in names(expression)):
            return Apply(operator, tuple(_with_constants(one, formals) for one in arguments))
        case _:
            return expression


def _is_difference(constraint: Constraint) -> bool:
    """Return whether `constraint` requires two variables to differ. `all_different` consists of such pairs."""
    definition = constraint.definition
    if not isinstance(definition, Predicate) or not isinstance(definition.body, Apply):
        return False
    operator, arguments = definition.body.operator, definition.body.arguments
    return operator == "ne" and all(isinstance(one, Name) for one in arguments)


def _is_choice(body: Expression) -> bool:
    """Return whether `body` selects one of two numbers by a condition that contains all of its names.

    Then the two numbers bound the cost, no matter how many terms the condition has lost.
    """
    while isinstance(body, Apply):
        open_arguments = [one for one in body.arguments if names(one)]
        if len(open_arguments) != 1:
            return False
        if body.operator == "if":
            return body.arguments[0] is open_arguments[0]
        (body,) = open_arguments
    return False


def broken(constraint: Constraint, scope: tuple[str, ...]) -> Constraint:
    """Return a hard constraint with the same name over `scope` (at most one variable) that is never satisfied."""
    never = _NEVER if scope else _FALSE
    return replace(constraint, definition=never, scope=scope, parameters=scope, model=None, cost=INFINITE)


def _remaining_global(definition: GlobalPredicate, lost: Collection[str]) -> GlobalPredicate | None:
    """Return a global constraint without the formal parameters `lost`. Raises `NotAnAggregateError`."""
    body: Expression | None
    match definition.name:
        case "global:allDifferent":
            words = [word for word in definition.form.split() if word not in lost]
            if len(words) < len(("[", "one", "other", "]")):
                return None
            body, form = _conjunction(definition.body, lost), " ".join(words)
        case "global:weightedSum":
            body, form = without_terms(definition.body, lost), _without_groups(definition.form, lost)
        case "global:cumulative":
            tasks = [not lost.isdisjoint(group.split()) for group in _GROUP.findall(definition.form)]  # type: ignore[attr-defined]
            body, form = _cumulative(definition.body, lost, tasks), _without_groups(definition.form, lost)
        case _:
            raise NotAnAggregateError
    if body is None:
        return None
    words = form.split()
    parameters = tuple(dict.fromkeys(word for word in words if word in definition.parameters))
    symbolic = tuple(name for name in definition.symbolic if name in parameters)
    return GlobalPredicate(definition.name, parameters, body, symbolic, form=form)


def _without_groups(form: str, lost: Collection[str]) -> str:
    """Return the form of a global constraint without the groups in braces that contain one of the names `lost`."""
    left = _GROUP.sub(lambda group: "" if any(word in lost for word in group[0].split()) else group[0], form)
    return " ".join(left.split())


def _conjunction(body: Expression, lost: Collection[str]) -> Expression | None:
    """Return the conjuncts in `body` that contain none of the names `lost`."""
    parts = body.arguments if isinstance(body, Apply) and body.operator == "and" else (body,)
    remaining = tuple(one for one in parts if not any(name in lost for name in names(one)))
    return Apply("and", remaining) if len(remaining) > 1 else remaining[0] if remaining else None


def _cumulative(body: Expression, lost: Collection[str], tasks: Sequence[bool]) -> Expression | None:
    """Return a cumulative constraint's body without the lost `tasks`. Its last conjuncts are one peak per task."""
    if all(tasks):
        return None
    if not isinstance(body, Apply) or body.operator != "and":
        raise NotAnAggregateError
    conditions, peaks = body.arguments[: -len(tasks)], body.arguments[-len(tasks) :]
    remaining = [one for one in conditions if not any(name in lost for name in names(one))]
    for is_lost, peak in zip(tasks, peaks, strict=True):
        if not is_lost:
            load, limit = peak.arguments if isinstance(peak, Apply) else ()
            loads = load.arguments if isinstance(load, Apply) and load.operator == "add" else (load,)
            others = tuple(one for one in loads if not any(name in lost for name in names(one)))
            remaining.append(Apply("le", (Apply("add", others) if len(others) > 1 else others[0], limit)))
    if any(name in lost for one in remaining for name in names(one)):
        raise NotAnAggregateError
    return Apply("and", tuple(remaining)) if len(remaining) > 1 else remaining[0]
