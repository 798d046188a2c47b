"""Encodes constraints as tables over codes, the input of the solvers.

Solvers may compute wrong results from values (ACE does, from negative ones; FINDINGS). So they compute with codes only:
values become codes 0, 1, ... in ascending order, every constraint becomes a list of its allowed or forbidden code
tuples, and unary constraints are applied to the domains first. Problems that differ only in names and in a shift of
values become equal, so that one solution can be reused for all of them.
"""

from __future__ import annotations

import itertools
import math
import weakref
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from operator import itemgetter

from robochoc.model.expression import UndefinedValueError
from robochoc.model.expression.bounds import ANY_INTEGER, bounds
from robochoc.model.expression.closures import Closure, compile_expression
from robochoc.model.problem import INFINITE, Constraint, Function, Predicate, Relation, Semantics, Variable
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.linear import FALSE, Formula, Operand, is_small, linear, operands, renamed
from robochoc.solver.splitting import MAX_TRIED, split
from robochoc.system.lazy_dataclass import dataclass

Cost = int | float
"""Integers stay integers: mypyc would convert them to a declared `float`, and 3.0 takes nine bytes in a message."""

MAX_TUPLES = 4_000_000
"""The maximum number of tuples of values for which a constraint is evaluated."""

MAX_ALLOWED_ROWS = 100_000
"""The maximum number of combinations of values for which a constraint is always a table of allowed tuples."""

Codes = tuple[int, ...]
Costs = tuple[tuple[int, int], ...]
"""The positions of variables whose codes are costs, each with the unit of its codes."""


@dataclass(frozen=True)
class CodeTable:
    """A constraint on the variables at positions `scope`: `rows` are the allowed, or the forbidden, code tuples."""

    scope: Codes
    allowed: bool
    rows: tuple[Codes, ...]


@dataclass(frozen=True)
class Network:
    """A constraint network over codes: an ascending domain for each variable, and tables.

    `different` lists scopes in which all values differ; it may repeat tables, but adds no constraint. `formulas` are
    constraints over positions of variables without tables.
    """

    domains: tuple[Codes, ...]
    tables: tuple[CodeTable, ...] = ()
    different: tuple[Codes, ...] = ()
    formulas: tuple[Formula, ...] = ()

    @property
    def impossible(self) -> bool:
        """Return whether the network obviously has no solution, without a search."""
        return (
            not all(self.domains) or FALSE in self.formulas or any(one.allowed and not one.rows for one in self.tables)
        )

    @property
    def constrained(self) -> set[int]:
        """Return the positions of all variables with constraints."""
        places = {place for table in self.tables for place in table.scope}.union(*self.different)
        return places.union(int(place) for formula in self.formulas for place in operands(formula))


@dataclass(frozen=True)
class Component:
    """A connected component of variables as a network; `values[code]` is the value of a code.

    `names` are the variables in their given order, followed by the additional variables of split constraints. If the
    network has formulas, `values` are ranges, so that codes can be added up.
    """

    names: tuple[str, ...]
    values: Sequence[int]
    network: Network

    def decoded(self, codes: Sequence[int]) -> tuple[int, ...]:
        """Return the values of a solution of the network."""
        return tuple([self.values[code] for code in codes])


def components(
    variables: Iterable[Variable],
    constraints: Iterable[Constraint],
    together: Iterable[Sequence[str]] = (),
    *,
    may_split: bool = False,
    may_add: bool = False,
) -> list[Component]:
    """Return the connected components of `variables` under the hard part of `constraints`.

    Components are in the order of their first variables, and the variables of each component in their given order. All
    scopes contain only `variables`. The variables of each scope in `together` are put into one component. With
    `may_split`, predicates too wide for a table are split, with additional variables (`solver/splitting.py`). With
    `may_add`, such predicates become formulas if they compare sums (`solver/linear.py`).

    Raises:
        UnsupportedError: if a constraint has too many tuples for a table.
    """
    variables, constraints = list(variables), list(constraints)
    domains = {variable.name: sorted(variable.domain) for variable in variables}
    unary: list[Constraint] = []
    wider: list[Constraint] = []
    for constraint in constraints:
        if _forbids_something(constraint):
            (unary if len(constraint.variables) <= 1 else wider).append(constraint)
    for constraint in unary:
        _fold(constraint, domains)
    formulas = list(_formulas(wider, domains)) if may_add else []
    added = {number for number, _ in formulas}
    left = [constraint for number, constraint in enumerate(wider) if number not in added]
    relevant = _tables(left, domains, may_split=may_split)
    scopes = [tuple(map(str, operands(formula))) for _, formula in formulas]
    groups = _connected(domains, [*(rows.scope for rows in relevant), *scopes, *together])
    held: dict[str, tuple[list[_Rows], list[Formula]]] = {names[0]: ([], []) for names in groups}
    first = {name: names[0] for names in groups for name in names}
    for rows in relevant:
        held[first[rows.scope[0]]][0].append(rows)
    for scope, (_, formula) in zip(scopes, formulas, strict=True):
        held[first[scope[0]] if scope else groups[0][0]][1].append(formula)
    found = [_component(names, domains, *held[names[0]]) for names in groups]
    if all(map(_is_small, found)):
        return found
    return components(variables, constraints, together, may_split=may_split)


def _is_small(part: Component) -> bool:
    """Return whether the codes of `part` are small enough for the solvers; always true without formulas."""
    return all(is_small(formula, len(part.values)) for formula in part.network.formulas)


def allows_function(constraint: Constraint, names: Sequence[str]) -> Callable[[Sequence[int]], bool]:
    """Return `constraint` as a test on the values of the variables `names`; soft violations are allowed."""
    definition = constraint.definition
    if not isinstance(definition, Predicate):
        price = cost_function(constraint, names)
        return lambda values: price(values) < INFINITE
    if constraint.cost < INFINITE:
        return lambda values: True  # noqa: ARG005 - a soft predicate forbids nothing
    return _truth_on(constraint, definition, names)


def cost_function(constraint: Constraint, names: Sequence[str]) -> Callable[[Sequence[int]], Cost]:
    """Return the cost of `constraint` as a function of the values of `names`.

    The function returns 0 if the constraint holds, and `INFINITE` if a hard constraint is violated.
    """
    definition = constraint.definition
    if isinstance(definition, Predicate):
        holds = _truth_on(constraint, definition, names)
        cost = constraint.cost
        return lambda values: 0 if holds(values) else cost
    if isinstance(definition, Function):
        return _cost_on(constraint, definition, names)
    arguments = _arguments(constraint, names)
    listed, other = definition.prices
    return lambda values: listed.get(arguments(values), other)


def max_cost(constraint: Constraint) -> Cost:
    """Return the maximum finite cost of `constraint`; for a function, the bound on its expression."""
    match constraint.definition:
        case Relation() as relation:
            return relation.finite_costs[1]
        case Predicate():
            most: Cost = constraint.cost
        case Function() as function:
            most = bounds(function.body, defaultdict(lambda: ANY_INTEGER)).high
    return most if most < INFINITE else 0


def is_soft(constraint: Constraint) -> bool:
    """Return whether `constraint` may have finite costs."""
    return constraint.has_costs


def _truth_on(constraint: Constraint, predicate: Predicate, names: Sequence[str]) -> Callable[[Sequence[int]], bool]:
    """Return a test of the predicate of `constraint` on values of `names`; an undefined result counts as false."""
    arguments = _arguments(constraint, names)
    body = _body(predicate)

    def holds(values: Sequence[int]) -> bool:
        try:
            return bool(body(arguments(values)))
        except UndefinedValueError:
            return False

    return holds


def _cost_on(constraint: Constraint, function: Function, names: Sequence[str]) -> Callable[[Sequence[int]], Cost]:
    """Return the cost as a function of values of `names`; an undefined result counts as `INFINITE`."""
    arguments = _arguments(constraint, names)
    body = _body(function)

    def cost(values: Sequence[int]) -> Cost:
        try:
            return body(arguments(values))
        except UndefinedValueError:
            return INFINITE

    return cost


_bodies: dict[int, tuple[weakref.ref[Predicate | Function], Closure]] = {}
"""Compiled bodies, by the `id` of their definition: hashing an expression would take as long as visiting it."""


def _body(definition: Predicate | Function) -> Closure:
    """Return the body of `definition` as a function, shared by all constraints and robots with this definition."""
    key = id(definition)
    if key not in _bodies:
        body = compile_expression(definition.body, definition.parameters)
        forget = partial(_bodies.pop, key)  # not a closure over the module, which is gone when the program ends
        _bodies[key] = weakref.ref(definition, forget), body
    return _bodies[key][1]


def _arguments(constraint: Constraint, names: Sequence[str]) -> Callable[[Sequence[int]], tuple[int, ...]]:
    """Return a function that selects the arguments of the definition of `constraint` from values of `names`."""
    place = {name: index for index, name in enumerate(names)}
    return _selector(
        tuple([(place[term], 0) if isinstance(term, str) else (None, term) for term in constraint.parameters])
    )


@lru_cache(maxsize=1024)
def _selector(terms: tuple[tuple[int | None, int], ...]) -> Callable[[Sequence[int]], tuple[int, ...]]:
    """Return a function that selects values by index, and adds constants where the index is None."""
    places = [index for index, _ in terms if index is not None]
    if len(places) == len(terms) > 1:
        return itemgetter(*places)
    return lambda values: tuple([constant if index is None else values[index] for index, constant in terms])


def _forbids_something(constraint: Constraint) -> bool:
    return not isinstance(constraint.definition, Predicate) or constraint.cost == INFINITE


def _fold(constraint: Constraint, domains: dict[str, list[int]]) -> None:
    """Remove the values forbidden by a unary constraint; a false constraint on constants empties all domains."""
    test = allows_function(constraint, constraint.variables)
    if constraint.variables:
        (name,) = constraint.variables
        domains[name] = [value for value in domains[name] if test((value,))]
    elif not test(()):
        domains.update({name: [] for name in domains})


def _connected(names: Iterable[str], scopes: Iterable[Sequence[str]]) -> list[list[str]]:
    """Return the connected components of the graph with the edges `scopes`, in the order of `names`."""
    root = {name: name for name in names}

    def find(name: str) -> str:
        while root[name] != name:
            root[name] = name = root[root[name]]
        return name

    for scope in scopes:
        for other in scope[1:]:
            root[find(other)] = find(scope[0])
    groups: dict[str, list[str]] = {}
    for name in root:
        groups.setdefault(find(name), []).append(name)
    return list(groups.values())


@dataclass(frozen=True)
class _Rows:
    """A table over values, the counterpart of `CodeTable` over codes."""

    scope: tuple[str, ...]
    allowed: bool
    rows: tuple[tuple[int, ...], ...]


def _component(
    names: Sequence[str], domains: Mapping[str, list[int]], held: Iterable[_Rows], formulas: Sequence[Formula]
) -> Component:
    occurring = {value for name in names for value in domains[name]}
    values: Sequence[int] = tuple(sorted(occurring))
    if formulas and values:
        values = range(values[0], values[-1] + 1)
    code = {value: value - values[0] for value in occurring} if formulas else dict(zip(values, itertools.count()))
    place: dict[str, int] = {name: index for index, name in enumerate(names)}
    coded = tuple(tuple([code[value] for value in domains[name]]) for name in names)
    coder = _Coder(place, code)
    tables = {coder.table(rows) for rows in held}
    ordered = sorted(tables, key=lambda table: (table.scope, table.allowed, table.rows))
    at: dict[Operand, Operand] = dict(place.items())
    over_codes = tuple([renamed(formula, at, {}, shift=values[0] if values else 0) for formula in formulas])
    return Component(tuple(names), values, Network(coded, tuple(ordered), formulas=over_codes))


class _Coder:
    """Converts tables over values into tables over codes; equal rows become one object."""

    def __init__(self, place: Mapping[str, int], code: Mapping[int, int]) -> None:
        self._place = place
        self._code = code
        self._rows: dict[Hashable, tuple[Codes, ...]] = {}

    def table(self, held: _Rows) -> CodeTable:
        scope = [self._place[name] for name in held.scope]
        order = sorted(range(len(scope)), key=scope.__getitem__)
        alike = id(held.rows), tuple(order)
        if alike not in self._rows:
            code = self._code
            self._rows[alike] = tuple(sorted(tuple([code[row[index]] for index in order]) for row in held.rows))
        return CodeTable(tuple(sorted(scope)), held.allowed, self._rows[alike])


def _formulas(constraints: Iterable[Constraint], domains: Mapping[str, list[int]]) -> Iterator[tuple[int, Formula]]:
    """Yield the formulas, with their numbers, of `constraints` that compare sums and are too wide for a table."""
    for number, constraint in enumerate(constraints):
        if math.prod(len(domains[name]) for name in constraint.variables) > MAX_ALLOWED_ROWS:
            formula = linear(constraint, domains)
            if formula is not None:
                yield number, formula


def _tables(constraints: Iterable[Constraint], domains: dict[str, list[int]], *, may_split: bool) -> list[_Rows]:
    """Return `constraints` as tables. With `may_split`, wide predicates are split; this adds variables to `domains`."""
    tables = _Tables(domains)
    found: list[_Rows] = []
    budget = MAX_TRIED
    for number, constraint in enumerate(constraints):
        parts = None
        scope = constraint.variables
        if may_split and len(scope) > 2 and math.prod(len(domains[name]) for name in scope) > MAX_ALLOWED_ROWS:  # noqa: PLR2004
            parts = split(constraint, domains, f"#{number}.", budget)
        if parts is None:
            rows = tables.of(constraint)
            found += [rows] if rows is not None else []
            continue
        budget = parts.budget
        domains.update({name: [*values] for name, values in parts.domains.items() if name not in domains})
        found += [_Rows(scope, allowed=True, rows=rows) for scope, rows in parts.tables]
    return found


class _Tables:
    """Converts constraints to tables; equal constraints over equal domains are evaluated once."""

    def __init__(self, domains: Mapping[str, list[int]]) -> None:
        self._domains = domains
        self._made: dict[Hashable, _Rows | None] = {}

    def of(self, constraint: Constraint) -> _Rows | None:
        """Return the allowed tuples of `constraint`, or (if it is large) the forbidden ones. None: all are allowed."""
        scope = constraint.variables
        terms = tuple([scope.index(term) if isinstance(term, str) else (term,) for term in constraint.parameters])
        alike = id(constraint.definition), terms, tuple([tuple(self._domains[name]) for name in scope])
        if alike not in self._made:
            self._made[alike] = _rows(constraint, self._domains)
        made = self._made[alike]
        return made and replace(made, scope=scope)


def _rows(constraint: Constraint, domains: Mapping[str, list[int]]) -> _Rows | None:
    scope = constraint.variables
    size = math.prod(len(domains[name]) for name in scope)
    definition = constraint.definition
    if size > MAX_TUPLES and isinstance(definition, Relation) and definition.semantics != Semantics.SOFT:
        listed = tuple(set(_listed(constraint, definition, domains)))
        allows = definition.semantics == Semantics.SUPPORTS
        return _Rows(scope, allows, listed) if allows or listed else None
    if size > MAX_TUPLES:
        raise UnsupportedError(
            f"constraint {constraint.name} has {size:,} combinations of values, more than {MAX_TUPLES:,};"
            " write it as a table (`allowed`, `forbidden` in Python; a relation in files), or split it"
        )
    test = allows_function(constraint, scope)
    sorted_out: tuple[list[tuple[int, ...]], list[tuple[int, ...]]] = ([], [])
    for row in itertools.product(*(domains[name] for name in scope)):
        sorted_out[test(row)].append(row)
    forbidden, allowed = sorted_out
    if not forbidden:
        return None
    if size > MAX_ALLOWED_ROWS and len(forbidden) < len(allowed):
        return _Rows(scope, allowed=False, rows=tuple(forbidden))
    return _Rows(scope, allowed=True, rows=tuple(allowed))


def _listed(constraint: Constraint, relation: Relation, domains: Mapping[str, list[int]]) -> Iterable[tuple[int, ...]]:
    """Yield the tuples of `relation` that match its constants, repetitions and domains, as values of the scope."""
    scope = constraint.variables
    known = {name: set(domains[name]) for name in scope}
    for row in relation.tuples:
        bound: dict[str, int] = {}
        if all(
            value == term if isinstance(term, int) else bound.setdefault(term, value) == value
            for term, value in zip(constraint.parameters, row, strict=True)
        ) and all(bound[name] in known[name] for name in scope):
            yield tuple([bound[name] for name in scope])
