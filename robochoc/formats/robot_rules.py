"""Rules for a robot's constraints and neighbours (docs/reference/format.md, "One robot").

`names`, `definitions`, `symbols` and this module contain all rules for one robot. Readers of files apply the rules to
each element, `robot_validation` applies them to the objects of a robot built in Python. Rules on several robots are in
`team_consistency`; rules on files only (XML, schema, counts, references) are in the readers.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from robochoc.formats.definitions import terms_text
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.names import check_cost, check_integer, is_name
from robochoc.model.absence import can_be_restated
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.expression import Apply, Expression
from robochoc.model.problem import (
    INFINITE,
    Child,
    Constraint,
    ConstraintModel,
    Definition,
    Function,
    GlobalPredicate,
    Parent,
    Predicate,
    ProblemKind,
    Relation,
    Term,
    WhenAbsent,
)

NEIGHBOURS_ONCE = "list every neighbour once, as parent or as child"
"""The hint for `repeated_neighbours`."""
NO_ROBOTS_LEFT = ("all robots have left after this event", "keep one, or add another")
"""The message and the hint for a scenario event after which the team is empty."""


def check_terms(terms: Sequence[Term]) -> None:
    """Raise `MistakeError` unless each of the `terms` in a scope is a valid variable name or an integer."""
    for term in terms:
        if isinstance(term, int):
            check_integer(term)
        elif not is_name(term):
            hint = "separate names and integers by blanks"
            raise MistakeError(f"'{shortened(term)}' is neither a variable's name nor an integer", hint)


def check_constraint(constraint: Constraint, kind: ProblemKind, units: CostUnits = PLAIN_COSTS) -> None:
    """Raise `MistakeError` unless the definition fits the terms, and the cost is valid for a robot of that `kind`."""
    if not constraint.variables:
        raise MistakeError("the scope of the constraint has no variables", 'write scope="V1.1 V2.1"')
    _check_application(constraint.definition, constraint.scope, constraint.parameters)
    if constraint.when_absent == WhenAbsent.RESTATE and not can_be_restated(constraint):
        message = "the constraint cannot be restated for fewer robots (when_absent)"
        raise MistakeError(
            message, "use a sum, count, and, or, min or max of terms of one form, compared with a number"
        )
    if constraint.cost == INFINITE:
        return
    if kind != ProblemKind.DISWCSP:
        raise MistakeError("a DisCSP cannot have costs", 'write type="DisWCSP" in the presentation, or delete the cost')
    if isinstance(constraint.definition, Relation):
        raise MistakeError("a relation cannot have a cost", 'write the costs of its tuples, with semantics="soft"')
    if isinstance(constraint.definition, Function):
        raise MistakeError(
            "a function cannot have a cost", "delete it: the function's value is the cost; or use a predicate"
        )
    check_cost(constraint.cost)
    if constraint.cost * (-1 if units.maximize else 1) < 0:
        _refuse_undefined(constraint.definition)


_PARTIAL = ("div", "mod", "pow")
"""Operators that are undefined for some arguments, even small ones."""


def _refuse_undefined(predicate: Predicate) -> None:
    """Raise `MistakeError` for a predicate that may be undefined if a violation of it is rewarded."""
    waiting: list[Expression] = [predicate.body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Apply):
            if node.operator in _PARTIAL:
                message = f"violating {shortened(predicate.name)} is rewarded, but '{node.operator}' may be undefined"
                raise MistakeError(message, "write a function, whose value is the cost: if(..., 0, -5)")
            waiting += node.arguments


def refuse_private_part(model: ConstraintModel | None) -> None:
    """Raise `MistakeError` for a private constraint with the model PKC, since a neighbour would have to know a part."""
    if model == ConstraintModel.PKC:
        raise MistakeError("a private constraint with model PKC", "delete the model: only shared constraints have one")


def check_private(constraint: Constraint, own: Collection[str]) -> None:
    """Raise `MistakeError` unless a private constraint is over `own` variables only."""
    for name in constraint.variables:
        if name not in own:
            hint = suggestion(name, own, "variables")
            hint += "; list shared constraints under agents_parent, and declare random variables"
            message = f"a private constraint over '{shortened(name)}', which is not a variable of this robot"
            raise MistakeError(message, hint)


def refuse_no_model(model: ConstraintModel | str | None) -> None:
    """Raise `MistakeError` for a shared constraint without a model (TKC or PKC)."""
    if not model:
        raise MistakeError("a shared constraint lacks its model", 'write model="TKC" or model="PKC"')


def check_shared(constraint: Constraint, own: Collection[str]) -> None:
    """Raise `MistakeError` unless a shared constraint is over `own` variables and variables of others."""
    mine = [name for name in constraint.variables if name in own]
    if not mine:
        hint = suggestion(constraint.variables[0], own, "variables of this robot")
        raise MistakeError(f"the scope '{terms_text(constraint.scope)}' has no variable of this robot", hint)
    if len(mine) == len(constraint.variables):
        hint = "add one, or move the constraint to the <constraints> of the instance: it is private"
        raise MistakeError(f"the scope '{terms_text(constraint.scope)}' has no variable of the neighbour", hint)


def _check_application(definition: Definition, scope: tuple[Term, ...], parameters: tuple[Term, ...]) -> None:
    """Raise `MistakeError` if the number of parameters is wrong, or scope and parameters differ in their terms."""
    if isinstance(definition, Relation) and parameters != scope:
        raise MistakeError(
            f"parameters '{terms_text(parameters)}' differ from the scope '{terms_text(scope)}'",
            "a relation's tuples follow the scope: leave the parameters out",
        )
    if isinstance(definition, GlobalPredicate) and not all(isinstance(term, str) for term in parameters):
        raise MistakeError(
            f"{definition.name} has an integer as a parameter", "write the integer into the form of the constraint"
        )
    arity = definition.arity if isinstance(definition, Relation) else len(definition.parameters)
    if len(parameters) != arity:
        raise MistakeError(
            f"{shortened(definition.name)} requires {arity} terms, but there are {len(parameters)}:"
            f" '{terms_text(parameters)}'",
            f"write {arity} terms",
        )
    if parameters == scope:
        return
    in_scope, passed = set(scope), set(parameters)
    for term in parameters:
        if isinstance(term, str) and term not in in_scope:
            raise MistakeError(f"the parameter '{shortened(term)}' is not in the scope", "add it to the scope")
    for term in scope:
        if term not in passed:
            raise MistakeError(
                f"'{shortened(str(term))}' is in the scope but not among the parameters",
                "delete it from the scope, or add it to the parameters",
            )


def refuse_no_variables(variables: Collection[object]) -> None:
    """Raise `MistakeError` for a robot without variables."""
    if not variables:
        raise MistakeError("the robot has no variables", 'add <variable name="V1.1" domain="D1"/>')


def check_shown_variables(shown: Sequence[str], own: Collection[str]) -> None:
    """Raise `MistakeError` unless the variables `shown` to a child are `own` variables, without duplicates."""
    seen: set[str] = set()
    for variable in shown:
        if variable not in own:
            hint = suggestion(variable, own, "variables of this robot")
            message = f"the child must know '{shortened(variable)}', which is not a variable of this robot"
            raise MistakeError(message, hint)
        if variable in seen:
            raise MistakeError(f"the variables of the child list '{shortened(variable)}' twice", "list it once")
        seen.add(variable)


def repeated_neighbours(
    name: str, parents: Sequence[Parent], children: Sequence[Child]
) -> Iterator[tuple[Parent | Child, str]]:
    """Yield neighbours of the robot `name` that are listed twice, or equal to the robot, each with a message."""
    seen = {name: "the robot itself"}
    for role, neighbours in (("parent", parents), ("child", children)):
        for neighbour in neighbours:
            if neighbour.name in seen:
                yield neighbour, f"the {role} '{shortened(neighbour.name)}' is {seen[neighbour.name]}"
            seen.setdefault(neighbour.name, f"listed as {role} already")


def check_added_constraint(constraint: Constraint) -> None:
    """Raise `MistakeError` for a partially known constraint that a scenario adds to two robots."""
    if constraint.model == ConstraintModel.PKC:
        message = "a partially known constraint (PKC) in a scenario"
        raise MistakeError(message, 'a scenario cannot add the parts of both robots: write model="TKC"')


def check_constraint_of_added_robot(constraint: Constraint) -> None:
    """Raise `MistakeError` for a partially known constraint of a robot that a scenario adds."""
    if constraint.model == ConstraintModel.PKC:
        message = "a partially known constraint (PKC) of a robot that a scenario adds"
        raise MistakeError(message, 'a scenario cannot add the part of the parent: write model="TKC"')
