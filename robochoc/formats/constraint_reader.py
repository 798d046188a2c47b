"""Read `constraint` elements: definitions applied to scopes (docs/reference/format.md, "One robot")."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from lxml import etree

from robochoc.formats.costs import read_cost
from robochoc.formats.definition_reader import read_integer
from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.global_constraints import is_global, read_global, variables_of
from robochoc.formats.names import is_name
from robochoc.formats.objectives import check_objective
from robochoc.formats.random_variables import check_uncertain
from robochoc.formats.robot_rules import (
    check_constraint,
    check_private,
    check_shared,
    refuse_private_part,
)
from robochoc.formats.symbols import SYMBOL, check_argument_types
from robochoc.formats.xml import attribute, line
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    ConstraintModel,
    CostUnits,
    Definition,
    ProblemKind,
    RandomVariable,
    Term,
    WhenAbsent,
)
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class ConstraintContext:
    """The names to which the constraints in a file can refer.

    Invalid elements are included (`definitions` maps their names to None), so that references to them are not reported
    as unknown.
    """

    kind: ProblemKind
    units: CostUnits
    model: ConstraintModel
    """The default in the file for constraints that do not specify a model."""
    own: Collection[str]
    """The robot's own variables."""
    definitions: Mapping[str, Definition | None]
    kinds: Mapping[str, str]
    """For each variable of the robot, the kind of its values (`formats/symbols.py`)."""
    objectives: tuple[str, ...] = ()
    random: tuple[RandomVariable, ...] = ()
    """The random variables in the file."""

    def decisions(self, constraint: Constraint) -> Constraint:
        """Return `constraint` without random variables, for the checks of its scope."""
        chance = {one.name for one in self.random}
        return replace(constraint, scope=tuple(term for term in constraint.scope if term not in chance))


def read_private(element: etree._Element, context: ConstraintContext) -> Constraint | None:
    """Return a private constraint, over this robot's variables only. For None and errors see `_read`."""
    model = attribute(element, "model")
    refuse_private_part(ConstraintModel(model) if model else None)
    constraint = _read(element, context, ConstraintModel(model) if model else None)
    checked = context.decisions(constraint or _scope_only(element))
    if checked.variables:
        check_private(checked, context.own)
    return constraint


def read_shared(element: etree._Element, context: ConstraintContext) -> Constraint | None:
    """Return a constraint over variables of this robot and its neighbours. For None and errors see `_read`."""
    model = attribute(element, "model")
    constraint = _read(element, context, ConstraintModel(model) if model else context.model)
    checked = context.decisions(constraint or _scope_only(element))
    if checked.variables:
        check_shared(checked, context.own)
    return constraint


def _scope_only(element: etree._Element) -> Constraint:
    """Return a constraint for the checks of its scope, if its definition is invalid."""
    scope = _terms(element.get("scope") or "")
    return Constraint(attribute(element, "name"), PREDEFINED["eq"], scope, scope)


def _read(element: etree._Element, context: ConstraintContext, model: ConstraintModel | None) -> Constraint | None:
    """Return the constraint, or None if its definition is invalid. Raises `MistakeError`."""
    scope = _terms(element.get("scope") or "")
    given = next(element.iterchildren("parameters"), None)
    reference = attribute(element, "reference")
    definition: Definition | None
    if is_global(reference):
        definition, parameters = read_global(reference, given, scope), variables_of(given, scope)
        if any(context.kinds.get(str(term)) == SYMBOL for term in parameters) and reference == "global:allDifferent":
            definition = replace(definition, symbolic=definition.parameters)
    else:
        _refuse_elements(given)
        parameters = scope if given is None or given.text == element.get("scope") else _terms(given.text or "")
        definition = _definition(reference, context)
    if not definition:
        return None
    cost = attribute(element, "cost")
    violation_cost = read_cost(cost, context.units) if cost else INFINITE
    when_absent = attribute(element, "when_absent")
    constraint = Constraint(
        attribute(element, "name"),
        definition,
        scope,
        parameters,
        model,
        violation_cost,
        line(element),
        when_absent=WhenAbsent(when_absent) if when_absent else None,
        objective=attribute(element, "objective"),
    )
    check_constraint(constraint, context.kind, context.units)
    check_objective(constraint, context.objectives)
    check_argument_types(constraint, context.kinds)
    check_uncertain(constraint, context.random)
    _check_arity(attribute(element, "arity"), constraint)
    return constraint


def _refuse_elements(parameters: etree._Element | None) -> None:
    for child in () if parameters is None else parameters:
        message = f"<{child.tag}/> is not allowed in these parameters: only global constraints have elements there"
        raise MistakeError(message, "write variables and integers")


def _terms(text: str) -> tuple[Term, ...]:
    return tuple([word if is_name(word) else _constant(word) for word in text.split()])


def _constant(word: str) -> int:
    try:
        return read_integer(word)
    except MistakeError:
        hint = "separate names and integers by blanks"
        raise MistakeError(f"'{shortened(word)}' is neither a variable's name nor an integer", hint) from None


def _definition(reference: str, context: ConstraintContext) -> Definition | None:
    if reference in context.definitions:
        return context.definitions[reference]
    if reference in PREDEFINED:
        return PREDEFINED[reference]
    hint = suggestion(reference, [*context.definitions, *PREDEFINED], "definitions")
    raise MistakeError(f"unknown reference '{shortened(reference)}'", hint)


def _check_arity(given: str, constraint: Constraint) -> None:
    """Raise `MistakeError` unless `given` is the number of variables in the scope, or of all terms."""
    if given and int(given) not in {len(constraint.variables), len(constraint.scope)}:
        raise MistakeError(
            f"arity is {given}, but the scope has {len(constraint.variables)} variables",
            f'write arity="{len(constraint.variables)}" or leave it out',
        )
