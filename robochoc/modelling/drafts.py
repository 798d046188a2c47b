"""Drafts: a model's constraints and cost functions before the unit of the team's costs is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.definitions import PREDEFINED
from robochoc.model.absence import can_be_restated
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    Definition,
    Function,
    Predicate,
    Relation,
    Semantics,
    WhenAbsent,
)
from robochoc.model.constraint import Term as Actual
from robochoc.model.expression import Apply, Constant, Expression, ExpressionError, Name, Type
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.magnitudes import MAX_COST
from robochoc.model.real import RealParameters
from robochoc.modelling.errors import ModelError, SourceLine
from robochoc.modelling.numbers import Exact, exact, is_infinite, places_of, rounded, shown
from robochoc.modelling.real_terms import RealTranslator
from robochoc.modelling.tables import Price, Row, commonest, in_short, listed_rows, prices, truths
from robochoc.modelling.terms import Linear, ModelVariable, Operation, TableTerm, Term
from robochoc.modelling.translation import Scaled, Translator, UntranslatableError, may_be_undefined
from robochoc.system.lazy_dataclass import dataclass

_FALSE: Expression = Apply("ne", (Constant(0), Constant(0)))


@dataclass(frozen=True)
class Draft:
    """A constraint whose costs have no unit yet.

    Attributes:
        name: The constraint's name.
        scope: The constraint's variables. Empty: its truth or cost is constant (`model/assembly.py`).
        place: The line that created it.
        body: The expression for a condition or a cost, in which `X0`, `X1`, ... are the variables. Over real variables,
            it has decimals (`modelling/real_terms.py`).
        rows: The rows, if the constraint is a table.
        semantics: The meaning of the rows. None: `body` is a condition or a cost.
        is_cost: True if the value of `body` is a cost.
        cost: The cost of violating a condition. None: the condition is hard.
        default: The cost of rows that are not listed in a soft table.
        is_penalty: True if the costs in a soft table are costs of violating a condition. If a sum is maximised, they
            are subtracted from it.
        when_absent: The constraint's meaning when a robot is absent. None: the default for its form.
        objective: The objective to which the costs belong.
    """

    name: str
    scope: tuple[ModelVariable, ...]
    place: SourceLine
    body: Expression | None = None
    rows: Mapping[Row, Price] = field(default_factory=dict)
    semantics: Semantics | None = None
    is_cost: bool = False
    cost: Exact | None = None
    default: Price = 0
    is_penalty: bool = False
    when_absent: WhenAbsent | None = None
    objective: str = ""

    def with_when_absent(self, when_absent: WhenAbsent | None) -> Draft:
        """Return this draft with `when_absent` set. Raises `ModelError` if the constraint cannot be restated."""
        if when_absent == WhenAbsent.RESTATE:
            names = tuple(variable.name for variable in self.scope)
            definition = None if self.body is None else _definition(self, self.body)
            if definition is None or not can_be_restated(Constraint(self.name, definition, names, names)):
                hint = (
                    "use a sum, count, all_of, any_of, minimum or maximum of terms of one form, compared with a number"
                )
                raise ModelError(f"{self.name} cannot be restated for fewer robots", hint, self.place)
        return replace(self, when_absent=when_absent) if when_absent else self

    @property
    def soft(self) -> bool:
        """True if the draft has costs."""
        return self.is_cost or self.cost is not None or self.semantics == Semantics.SOFT

    @property
    def places(self) -> int:
        """The number of decimal places of the costs. Raises `ModelError` if there are too many."""
        if self.is_cost and any(variable.codes.real for variable in self.scope):
            return VALUE_PLACES
        found = [one for one in {*self.rows.values(), self.default, self.cost or 0} if not isinstance(one, float)]
        return max(places_of(one, self.place) for one in found) if self.soft else 0


def conditions(term: Term, name: str, place: SourceLine, *, in_pairs: bool = True) -> Iterator[Draft]:
    """Yield the drafts of a hard constraint: one for each part of a conjunction, and for each pair in `all_different`.

    If `in_pairs` is false, `all_different` stays one constraint.
    """
    if isinstance(term, Operation) and term.operator == "and":
        for part in term.arguments:
            yield from conditions(part, name, place, in_pairs=in_pairs)
    elif isinstance(term, Operation) and term.operator == "different" and in_pairs:
        for number, one in enumerate(term.arguments):
            for other in term.arguments[:number]:
                yield from conditions(Operation("ne", other, one), name, place)
    elif not term.variables:
        if not truths(term, place)[0]:
            yield Draft(name, (), place, _FALSE)
    elif draft := _condition(term, name, place):
        yield draft


def soft_condition(term: Term, cost: Exact, name: str, place: SourceLine) -> Draft:
    """Return the draft of a soft constraint, which costs `cost` if `term` does not hold."""
    body = _body(term)
    if body is not None and (cost >= 0 or not may_be_undefined(body)):  # where `body` is undefined, it is violated too
        return Draft(name, term.variables, place, body, cost=cost)
    holds, fails = truths(term, place)
    few = 0 < len(fails) <= len(holds) or not holds
    rows = dict.fromkeys(fails, cost) if few else dict.fromkeys(holds, 0)
    default = 0 if few else cost
    return Draft(name, term.variables, place, rows=rows, semantics=Semantics.SOFT, default=default, is_penalty=True)


class ObjectiveTerm(NamedTuple):
    """A term in a sum that is minimised or maximised.

    Attributes:
        factor: The factor of the term.
        term: The term.
        place: The line that added the term.
        places: The number of decimal places to which costs are rounded. None: costs are exact.
        objective: The objective to which the term belongs. Empty: the model has a single cost.
    """

    factor: Exact
    term: Term
    place: SourceLine
    places: int | None = None
    objective: str = ""


def costs_of(parts: Iterable[ObjectiveTerm], name: str) -> list[Draft]:
    """Return the cost functions for a sum: one draft for all terms with the same variables, rounding and objective."""
    groups: dict[tuple[frozenset[str], int | None, str], list[ObjectiveTerm]] = {}
    for part in parts:
        key = frozenset(one.name for one in part.term.variables), part.places, part.objective
        groups.setdefault(key, []).append(part)
    return [
        replace(_sum(group, f"{name}{number}"), objective=objective)
        for number, ((_, _, objective), group) in enumerate(groups.items(), 1)
    ]


def split(
    term: Term, place: SourceLine, places: int | None = None, objective: str = ""
) -> tuple[list[ObjectiveTerm], Exact]:
    """Return the terms of a sum with their factors, and the constant of the sum."""
    if isinstance(term, Linear):
        parts = [ObjectiveTerm(factor, one, place, places, objective) for factor, one in term.parts]
        return parts, rounded(term.constant, places)
    return [ObjectiveTerm(1, term, place, places, objective)], 0


def _sum(group: Sequence[ObjectiveTerm], name: str) -> Draft:
    place, places = group[0].place, group[0].places
    whole = Linear(tuple((part.factor, part.term) for part in group))
    parts, scope = whole.parts, whole.variables
    if len(parts) == 1:
        factor, table = parts[0]
        if isinstance(table, TableTerm) and (rows := listed_rows(table)) is not None:
            priced = {row: _scaled(value, factor, places) for row, value in rows.items()}
            return _table(name, scope, place, priced, _scaled(table.default, factor, places))
    scaled = _number(whole, scope)
    if scaled is not None and scaled.divisor == 1:
        return Draft(name, scope, place, scaled.expression, is_cost=True)
    by_form = sorted(parts, key=lambda part: _number(part[1], scope) is not None)  # errors show the first term
    found = {row: _scaled(price, 1, places) for row, price in prices(by_form, scope, place).items()}
    _check_digits(found, whole, place)
    return _table(name, scope, place, found, commonest(found))


def _check_digits(found: Mapping[Row, Price], term: Term, place: SourceLine) -> None:
    """Raise `ModelError` if a cost has more digits than files allow."""
    for price in found.values():
        if price != math.inf and not -MAX_COST <= price <= MAX_COST:
            message = f"the cost {in_short(term)} can be {shown(exact(price))}"
            raise ModelError(message, "costs have at most 18 digits: use smaller values or coefficients", place)


def _table(
    name: str, scope: tuple[ModelVariable, ...], place: SourceLine, rows: Mapping[Row, Price], default: Price
) -> Draft:
    listed = {row: price for row, price in rows.items() if price != default}
    listed = listed or {_first_row(scope): default}  # readers infer from the rows which columns contain symbols
    return Draft(name, scope, place, rows=listed, semantics=Semantics.SOFT, default=default)


def _scaled(value: object, factor: Exact, places: int | None) -> Price:
    return math.inf if is_infinite(value) else rounded(exact(exact(value) * factor), places)


def _condition(term: Term, name: str, place: SourceLine) -> Draft | None:
    """Return the draft of a hard constraint, or None if the constraint always holds."""
    if isinstance(term, TableTerm) and (listed := listed_rows(term)) is not None:
        return _listed(term, listed, name, place)
    body = _body(term)
    if body is not None:
        return Draft(name, term.variables, place, body)
    holds, fails = truths(term, place)
    if not fails:
        return None
    if not holds:
        return _never(name, term.variables[0], place)
    few = len(fails) <= len(holds)
    semantics = Semantics.CONFLICTS if few else Semantics.SUPPORTS
    return Draft(name, term.variables, place, rows=dict.fromkeys(fails if few else holds, 0), semantics=semantics)


def _listed(term: TableTerm, listed: Mapping[Row, object], name: str, place: SourceLine) -> Draft | None:
    """Return the draft of a table of allowed or forbidden rows, or None if the table forbids nothing."""
    rows = dict.fromkeys((row for row, value in listed.items() if value is not term.default), 0)
    if not rows:
        return None if term.default else _never(name, term.variables[0], place)
    semantics = Semantics.CONFLICTS if term.default else Semantics.SUPPORTS
    return Draft(name, term.variables, place, rows=rows, semantics=semantics)


def _never(name: str, variable: ModelVariable, place: SourceLine) -> Draft:
    """Return a constraint that no value of `variable` satisfies."""
    rows: dict[Row, Price] = dict.fromkeys([(code,) for code in variable.codes.ever], 0)
    return Draft(name, (variable,), place, rows=rows, semantics=Semantics.CONFLICTS)


def _first_row(scope: Sequence[ModelVariable]) -> Row:
    return tuple(variable.codes.ever[0] for variable in scope)


def _body(term: Term) -> Expression | None:
    try:
        return _translator(term.variables).whole_condition(term)
    except UntranslatableError:
        return None


def _number(term: Term, scope: Sequence[ModelVariable]) -> Scaled | None:
    try:
        return _translator(scope).whole_number(term)
    except UntranslatableError:
        return None


def _translator(scope: Sequence[ModelVariable]) -> Translator:
    formals = {variable: f"X{number}" for number, variable in enumerate(scope)}
    return RealTranslator(formals) if any(variable.codes.real for variable in scope) else Translator(formals)


def _definition(draft: Draft, body: Expression) -> Predicate | Function:
    """Return the definition of a condition or cost with this body. Raises `ModelError`."""
    formals = tuple(f"X{number}" for number in range(len(draft.scope)))
    real, places = _real_parameters(draft, formals, body), 0
    if real:
        places = VALUE_PLACES if draft.is_cost else 0
        wanted = Type.INTEGER if draft.is_cost else Type.BOOLEAN
        try:
            body = fixed_point(body, real.names, real.places, wanted, places)
        except ExpressionError as error:
            raise ModelError(f"{draft.name}: {error.message}", error.hint, draft.place) from None
    if draft.is_cost:
        return Function("", formals, body, real=real, places=places)
    return Predicate("", formals, body, real=real)


def _real_parameters(draft: Draft, formals: Sequence[str], source: Expression) -> RealParameters | None:
    real = {name: one.codes.real for name, one in zip(formals, draft.scope, strict=True) if one.codes.real}
    precisions = {one.places for one in real.values()}
    if len(precisions) > 1:
        message = f"{draft.name} is over real variables of different precisions"
        raise ModelError(message, "use the same precision for all real variables", draft.place)
    return RealParameters(tuple(real), precisions.pop(), source) if real else None


class Definitions:
    """Names for definitions: equal definitions share a name, and no name is in `taken`."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = set(taken)
        self._known: dict[Definition, Definition] = {}
        self._numbers = {"P": 0, "F": 0, "R": 0}

    def constraint(self, draft: Draft, places: int, sign: int) -> Constraint:
        """Return the constraint of a draft, with its objective and its meaning when a robot is absent."""
        made = self._constraint(draft, places, sign)
        return replace(made, when_absent=draft.when_absent, objective=draft.objective)

    def _constraint(self, draft: Draft, places: int, sign: int) -> Constraint:
        """Return the constraint of a draft, with costs in units of `places` decimal places.

        Args:
            draft: The draft.
            places: The number of decimal places of the team's costs.
            sign: -1 if the sum is maximised: the costs of violations are then subtracted.
        """
        unit = 10**places
        names = tuple(variable.name for variable in draft.scope)
        if draft.body is None:
            relation = self._named("R", _relation(draft, unit, sign))
            return Constraint(draft.name, relation, names, names)
        definition = _definition(draft, draft.body)
        if draft.is_cost:
            return Constraint(draft.name, self._named("F", definition), names, names)
        cost = INFINITE if draft.cost is None else int(draft.cost * unit) * sign
        actual = _predefined(draft.body, dict(zip(definition.parameters, names, strict=True)))
        kinds = {(variable.codes.symbolic, variable.codes.real is not None) for variable in draft.scope}
        if actual and (kinds == {(False, False)} or (len(kinds) == 1 and len(names) > 1)):
            predicate, terms = actual  # the terms of a scope cannot be symbols or real numbers
            return Constraint(draft.name, predicate, terms, terms, cost=cost)
        own = self._named("P", definition)
        return Constraint(draft.name, own, names, names, cost=cost)

    def _named(self, letter: str, definition: Definition) -> Definition:
        if definition not in self._known:
            while (name := f"{letter}{self._numbers[letter] + 1}") in self._taken:
                self._numbers[letter] += 1
            self._numbers[letter] += 1
            self._known[definition] = _called(definition, name)
        return self._known[definition]


def _called(definition: Definition, name: str) -> Definition:
    match definition:
        case Relation(arity=arity, semantics=semantics, tuples=tuples, costs=costs, default_cost=default):
            return Relation(name, arity, semantics, tuples, costs, default)
        case Predicate() | Function():
            return replace(definition, name=name)


def _relation(draft: Draft, unit: int, sign: int) -> Relation:
    semantics = draft.semantics or Semantics.SUPPORTS
    rows = tuple(sorted(draft.rows))
    if semantics != Semantics.SOFT:
        return Relation("", len(draft.scope), semantics, rows)
    penalty = sign if draft.is_penalty else 1
    costs = tuple(_units(draft.rows[row], unit * penalty) for row in rows)
    return Relation("", len(draft.scope), semantics, rows, costs, _units(draft.default, unit * penalty))


def _units(price: Price, factor: int) -> float:
    return INFINITE if isinstance(price, float) else int(Fraction(price) * factor)


def _predefined(body: Expression, names: Mapping[str, str]) -> tuple[Predicate, tuple[Actual, ...]] | None:
    """Return the predefined predicate that compares two terms, and the two terms, or None if there is none."""
    if not isinstance(body, Apply) or body.operator not in PREDEFINED:
        return None
    terms: list[Actual] = []
    for one in body.arguments:
        match one:
            case Name(name):
                terms.append(names[name])
            case Constant(value):
                terms.append(value)
            case _:
                return None
    return (PREDEFINED[body.operator], tuple(terms)) if len({*terms}) == len(terms) else None
