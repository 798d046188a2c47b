"""Constraints on the wire, for protocols in which every robot in a scope knows the constraint, not only the lowest one.

Constraints are sent as data, with predicates as functional expressions, and are parsed and type-checked like files.
"""

from __future__ import annotations

import msgspec

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.global_constraints import read_form
from robochoc.formats.names import is_name
from robochoc.model.expression import Expression, ExpressionError, Type, parse, text
from robochoc.model.expression.bounds import ANY_INTEGER, bounds
from robochoc.model.expression.tree import BOUND
from robochoc.model.problem import (
    Constraint,
    ConstraintModel,
    Definition,
    Function,
    GlobalPredicate,
    Predicate,
    Relation,
    Semantics,
    Term,
    WhenAbsent,
)
from robochoc.solver.encoding import Cost
from robochoc.solver.explanation import KeyedConstraint
from robochoc.system.errors import RobochocError

MOST_TERMS = 1000
"""The maximum number of terms in a scope or a parameter list."""


class SharedConstraintError(RobochocError, ValueError):
    """Raised if a constraint from another robot is invalid."""


class RelationRecord(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """A relation; see `Relation`."""

    name: str
    arity: int
    semantics: Semantics
    tuples: tuple[tuple[int, ...], ...]
    costs: tuple[Cost, ...]
    default_cost: Cost


class PredicateRecord(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """A predicate; `body` is a functional expression. A global constraint has a `form` instead."""

    name: str
    parameters: tuple[str, ...]
    body: str
    form: str = ""


class FunctionRecord(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """A function; `body` is a functional expression whose value is the cost."""

    name: str
    parameters: tuple[str, ...]
    body: str


Record = RelationRecord | PredicateRecord | FunctionRecord


class SharedRecord(msgspec.Struct, frozen=True, array_like=True):
    """A shared constraint with its `key` (`solver/explanation.py`)."""

    key: str
    name: str
    definition: Record
    scope: tuple[Term, ...]
    parameters: tuple[Term, ...]
    model: ConstraintModel | None
    cost: Cost
    when_absent: WhenAbsent | None = None


def record_of(known: KeyedConstraint) -> SharedRecord:
    """Return the record for sending `known`."""
    one = known.constraint
    defined = _defined(one.definition)
    return SharedRecord(known.key, one.name, defined, one.scope, one.parameters, one.model, one.cost, one.when_absent)


def known_of(record: SharedRecord) -> KeyedConstraint:
    """Return the constraint described by `record`. Raises `SharedConstraintError`."""
    if max(len(record.scope), len(record.parameters)) > MOST_TERMS:
        raise SharedConstraintError(f"{shortened(record.name)!r} has more than {MOST_TERMS} terms")
    variables = [term for term in record.scope if isinstance(term, str)]
    if not variables or not all(map(is_name, variables)) or not set(record.parameters) <= set(record.scope):
        raise SharedConstraintError(f"the scope of {shortened(record.name)!r} is invalid")
    definition = _definition(record.definition)
    arity = definition.arity if isinstance(definition, Relation) else len(definition.parameters)
    if not record.cost >= 0:
        raise SharedConstraintError(f"the cost {record.cost!r} of {shortened(record.name)!r} must be 0 or more")
    if arity != len(record.parameters):
        raise SharedConstraintError(
            f"{shortened(record.name)!r} has {len(record.parameters)} arguments, but requires {arity}"
        )
    return KeyedConstraint(
        record.key,
        Constraint(
            record.name,
            definition,
            record.scope,
            record.parameters,
            record.model,
            record.cost,
            when_absent=record.when_absent,
        ),
    )


def _defined(definition: Definition) -> Record:
    if isinstance(definition, GlobalPredicate):
        return PredicateRecord(definition.name, definition.parameters, "", definition.form)
    if isinstance(definition, Predicate):
        return PredicateRecord(definition.name, definition.parameters, text(definition.body))
    if isinstance(definition, Function):
        return FunctionRecord(definition.name, definition.parameters, text(definition.body))
    return RelationRecord(
        definition.name,
        definition.arity,
        definition.semantics,
        definition.tuples,
        definition.costs,
        definition.default_cost,
    )


def _definition(record: Record) -> Definition:
    if not isinstance(record, RelationRecord):
        return _in_intension(record)
    if any(len(values) != record.arity for values in record.tuples):
        raise SharedConstraintError(f"a tuple of {shortened(record.name)!r} does not have {record.arity} values")
    if len(set(record.tuples)) < len(record.tuples):
        raise SharedConstraintError(f"duplicate tuple in {shortened(record.name)!r}")
    costs = len(record.tuples) if record.semantics == Semantics.SOFT else 0
    if len(record.costs) != costs or not all(cost >= 0 for cost in (*record.costs, record.default_cost)):
        raise SharedConstraintError(f"the costs of {shortened(record.name)!r} are invalid")
    return Relation(record.name, record.arity, record.semantics, record.tuples, record.costs, record.default_cost)


def _global(record: PredicateRecord) -> GlobalPredicate:
    try:
        made = read_form(record.name, record.form)
    except MistakeError as bad:
        raise SharedConstraintError(f"{shortened(record.name)!r}: {bad.message}") from None
    if made.parameters != record.parameters:
        raise SharedConstraintError(f"the parameters of {shortened(record.name)!r} are invalid")
    return made


def _in_intension(record: PredicateRecord | FunctionRecord) -> Predicate | Function:
    names = record.parameters
    if len(names) > MOST_TERMS or len(set(names)) < len(names):
        raise SharedConstraintError(f"the parameters of {shortened(record.name)!r} are invalid")
    if isinstance(record, PredicateRecord) and record.form:
        return _global(record)
    if isinstance(record, PredicateRecord):
        return Predicate(record.name, names, _body(record, Type.BOOLEAN))
    function = Function(record.name, names, _body(record, Type.INTEGER))
    low, high = bounds(function.body, dict.fromkeys(names, ANY_INTEGER))
    if low < 0 or high > BOUND:
        raise SharedConstraintError(f"the costs of {shortened(record.name)!r} are invalid")
    return function


def _body(record: PredicateRecord | FunctionRecord, wanted: Type) -> Expression:
    try:
        return parse(record.body, record.parameters, wanted)
    except ExpressionError as error:
        raise SharedConstraintError(f"the definition {shortened(record.name)!r}: {error}") from None
