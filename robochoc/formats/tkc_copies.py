"""The original platform's files repeat TKC constraints with the parent: both copies must allow the same tuples.

Compared is, for each set of variables, what all constraints on it say together: as they are written, and where that
differs by trying every tuple.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import product

from robochoc.formats.costs import cost_text
from robochoc.formats.diagnostics import Diagnostic, shortened
from robochoc.formats.team_members import TeamMembers
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Constant, Expression, Name, UndefinedValueError, compile_expression
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Domain, Function, Relation, Robot

MAX_COMPARED = 1_000_000
"""The maximum number of tuples that are compared."""


def differing_copies(members: TeamMembers, misplaced: Collection[str]) -> Iterator[Diagnostic]:
    """Yield copies that differ from the child's constraints. Children whose files are in `misplaced` are left out."""
    domains = {variable.name: variable.domain for robot in members.robots for variable in robot.variables}
    for file in members.files.values():
        for name, copies in file.copies.items():
            if members.is_parent(file.robot.name, name) and members.files[name].robot.file not in misplaced:
                yield from _differing(file.robot.file, copies, members.files[name].robot, domains)


def _differing(
    file: str, copies: Iterable[Constraint], child: Robot, domains: Mapping[str, Domain]
) -> Iterator[Diagnostic]:
    held = _grouped(constraint for constraint in child.shared if constraint.model == ConstraintModel.TKC)
    for variables, group in _grouped(copies).items():
        what = f"the copy of '{shortened(group[0].name)}' over {shortened(' '.join(variables))}"
        originals = held.get(variables)
        if originals is None:
            message = f"{what}: '{child.name}' has no such constraint"
            yield Diagnostic(file, group[0].line, message, f"delete the copy, or add the constraint to {child.file}")
        elif _written(group) != _written(originals):
            difference = _difference(variables, group, originals, domains, child.costs)
            if difference:
                hint = f"leave the copy out, or make it equal to {child.file}:{originals[0].line}"
                yield Diagnostic(file, group[0].line, f"{what} {difference}", hint)


def _grouped(constraints: Iterable[Constraint]) -> dict[tuple[str, ...], list[Constraint]]:
    """Return constraints by the set of their variables."""
    groups: dict[tuple[str, ...], list[Constraint]] = {}
    for constraint in constraints:
        groups.setdefault(tuple(sorted(constraint.variables)), []).append(constraint)
    return groups


def _written(group: Iterable[Constraint]) -> Counter[Hashable]:
    """Return the content of the constraints, independent of their names and their definitions' names."""
    written: Counter[Hashable] = Counter()
    for constraint in group:
        definition = constraint.definition
        if isinstance(definition, Relation):
            tuples = frozenset(zip(definition.tuples, definition.costs or definition.tuples, strict=True))
            written[definition.semantics, definition.default_cost, constraint.parameters, tuples] += 1
        else:
            written[type(definition), _applied(constraint), constraint.cost] += 1
    return written


def _applied(constraint: Constraint) -> Expression:
    """Return the body of a predicate or function, about the variables and constants it is applied to."""
    if isinstance(constraint.definition, Relation):
        raise TypeError("a relation has no body")
    terms: dict[str, Expression] = {
        formal: Name(term) if isinstance(term, str) else Constant(term)
        for formal, term in zip(constraint.definition.parameters, constraint.parameters, strict=True)
    }

    def replaced(expression: Expression) -> Expression:
        match expression:
            case Name(name):
                return terms[name]
            case Apply(operator, arguments):
                return Apply(operator, tuple(map(replaced, arguments)))
            case Constant():
                return expression

    return replaced(constraint.definition.body)


def _difference(
    variables: tuple[str, ...],
    copies: Sequence[Constraint],
    originals: Sequence[Constraint],
    domains: Mapping[str, Domain],
    units: CostUnits,
) -> str:
    """Return where the two say different things; empty where they nowhere do. Costs count in `units`."""
    if any(variable not in domains for variable in variables):
        return ""  # of a robot whose file is broken
    if math.prod(len(domains[variable]) for variable in variables) > MAX_COMPARED:
        return f"is written differently from the child's, and more than {MAX_COMPARED} tuples are not compared"
    left = [_price(constraint, variables, units) for constraint in copies]
    right = [_price(constraint, variables, units) for constraint in originals]
    for values in product(*(domains[variable] for variable in variables)):
        here, there = sum(price(values) for price in left), sum(price(values) for price in right)
        if here != there:
            shown = shortened(" ".join(map(str, values)))
            return f"has the tuple '{shown}' {_said(here, units)}, and the child has it {_said(there, units)}"
    return ""


def _said(cost: float, units: CostUnits) -> str:
    if cost in {0, INFINITE}:
        return "forbidden" if cost else "allowed"
    return f"at a cost of {cost_text(cost, units)}"


def _price(constraint: Constraint, variables: tuple[str, ...], units: CostUnits) -> Callable[[tuple[int, ...]], float]:
    """Return what values of `variables` pay: `Constraint.price`, made for a million calls."""
    definition = constraint.definition
    if isinstance(definition, Relation):
        slots = [(variables.index(term), 0) if isinstance(term, str) else (-1, term) for term in constraint.parameters]
        return lambda values: definition.cost([values[slot] if slot >= 0 else constant for slot, constant in slots])
    value = compile_expression(_applied(constraint), variables)
    one: int = 10**units.places

    def price(values: tuple[int, ...]) -> float:
        try:
            if isinstance(definition, Function):
                return value(values) * one
            return 0 if value(values) else constraint.cost
        except UndefinedValueError:
            return constraint.cost

    return price
