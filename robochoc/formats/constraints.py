"""One `constraint` element: a definition applied to a scope (FORMAT.md, "One robot")."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.extension import integer
from robochoc.formats.intension import PREDEFINED
from robochoc.formats.xml import attribute, line
from robochoc.problem import INFINITE, Constraint, Kind, Model, Predicate, Relation, Term

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.]*")


@dataclass(frozen=True)
class Context:
    """What a file's constraints can refer to.

    `definitions` holds None, and `own` the name nevertheless, for what is defined but has a mistake of its own:
    whoever refers to it is not to blame.
    """

    kind: Kind
    model: Model | None
    """The file's default for constraints that do not name theirs."""
    own: Collection[str]
    """The robot's own variables."""
    definitions: Mapping[str, Relation | Predicate | None]


def is_name(word: str) -> bool:
    """Whether `word` can be a robot's or a variable's name."""
    return _NAME.fullmatch(word) is not None


def read_private(element: etree._Element, context: Context) -> Constraint | None:
    """An intra-agent constraint: over own variables only, and without a model. See `_read` for the rest."""
    if attribute(element, "model") == Model.PKC:
        raise MistakeError("a private constraint with model PKC", "a private constraint is its robot's alone: no model")
    constraint = _read(element, context, None)
    for name in constraint.variables if constraint else ():
        if name not in context.own:
            hint = suggestion(name, context.own, "variables") + "; shared constraints stand under agents_parent"
            raise MistakeError(f"a private constraint over '{shortened(name)}', which is not the robot's own", hint)
    return constraint


def read_shared(element: etree._Element, context: Context) -> Constraint | None:
    """A constraint with a neighbour: over own variables and others'. See `_read` for the rest."""
    model = attribute(element, "model") or context.model
    if not model:
        raise MistakeError("a shared constraint lacks its model", 'write model="TKC" or model="PKC"')
    constraint = _read(element, context, Model(model))
    if constraint:
        own = [name for name in constraint.variables if name in context.own]
        if not own:
            hint = suggestion(constraint.variables[0], context.own, "own variables")
            raise MistakeError(f"the scope '{_shown(constraint.scope)}' has no variable of this robot", hint)
        if len(own) == len(constraint.variables):
            hint = "name one, or put the constraint into the <constraints> of the instance: it is private"
            raise MistakeError(f"the scope '{_shown(constraint.scope)}' has no variable of the neighbour", hint)
    return constraint


def _read(element: etree._Element, context: Context, model: Model | None) -> Constraint | None:
    """The constraint, or None where its definition has a mistake of its own. Raises `MistakeError`."""
    scope = _terms(element.get("scope") or "")
    if not any(isinstance(term, str) for term in scope):
        raise MistakeError("a constraint without variables in its scope", 'write scope="V1.1 V2.1"')
    given = element.find("parameters")
    parameters = scope if given is None else _terms(given.text or "")
    definition = _definition(attribute(element, "reference"), context)
    constraint = None
    if definition:
        _check_application(definition, scope, parameters)
        cost = _cost(attribute(element, "cost"), definition, context.kind)
        constraint = Constraint(attribute(element, "name"), definition, scope, parameters, model, cost, line(element))
        _check_arity(attribute(element, "arity"), constraint)
    return constraint


def _terms(text: str) -> tuple[Term, ...]:
    return tuple([word if is_name(word) else _constant(word) for word in text.split()])


def _constant(word: str) -> int:
    try:
        return integer(word)
    except MistakeError:
        hint = "separate names and integers by blanks"
        raise MistakeError(f"'{shortened(word)}' is neither a variable's name nor an integer", hint) from None


def _definition(reference: str, context: Context) -> Relation | Predicate | None:
    if reference in context.definitions:
        return context.definitions[reference]
    if reference in PREDEFINED:
        return PREDEFINED[reference]
    hint = suggestion(reference, [*context.definitions, *PREDEFINED], "definitions")
    raise MistakeError(f"unknown reference '{shortened(reference)}'", hint)


def _check_application(definition: Relation | Predicate, scope: tuple[Term, ...], parameters: tuple[Term, ...]) -> None:
    """Raise `MistakeError` unless the definition takes so many terms, and scope and parameters are about the same."""
    if isinstance(definition, Relation) and parameters != scope:
        raise MistakeError(
            f"parameters '{_shown(parameters)}' differ from the scope '{_shown(scope)}'",
            "a relation's tuples follow the scope: leave the parameters out",
        )
    takes = definition.arity if isinstance(definition, Relation) else len(definition.parameters)
    if len(parameters) != takes:
        raise MistakeError(
            f"{shortened(definition.name)} takes {takes} terms, but '{_shown(parameters)}' has {len(parameters)}",
            "give it as many as it takes",
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
                "delete it there, or add it to the parameters",
            )


def _check_arity(given: str, constraint: Constraint) -> None:
    """The original platform counts a scope's variables; who counts its constants too is right as well."""
    if given and int(given) not in {len(constraint.variables), len(constraint.scope)}:
        raise MistakeError(
            f"arity is {given}, but the scope has {len(constraint.variables)} variables",
            f'write arity="{len(constraint.variables)}" or leave it out',
        )


def _cost(given: str, definition: Relation | Predicate, kind: Kind) -> float:
    if not given:
        return INFINITE
    if kind is not Kind.DISWCSP:
        raise MistakeError("a cost in a DisCSP", 'write type="DisWCSP" in the presentation, or delete the cost')
    if isinstance(definition, Relation):
        raise MistakeError("a cost on a relation", 'a soft relation names the costs of its tuples: semantics="soft"')
    return int(given)


def _shown(terms: tuple[Term, ...]) -> str:
    return shortened(" ".join(map(str, terms)))
