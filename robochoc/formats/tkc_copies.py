"""Check copies of TKC constraints: the original platform's files list them with both the child and the parent.

For each set of variables, all constraints on the set are compared together: first by their definitions, and if these
differ, by trying every tuple.
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
from robochoc.model.expression import UndefinedValueError, compile_expression
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Domain, Function, Relation, Robot

MAX_COMPARED = 1_000_000
"""The maximum number of tuples that are compared."""


def differing_copies(members: TeamMembers, misplaced: Collection[str]) -> Iterator[Diagnostic]:
    """Yield copies that differ from the child's constraints. Children with files in `misplaced` are not checked."""
    domains = {variable.name: variable.domain for robot in members.robots for variable in robot.variables}
    for file in members.files.values():
        for name, copies in file.copies.items():
            if members.is_parent(file.robot.name, name) and members.files[name].robot.file not in misplaced:
                yield from _differing(file.robot.file, copies, members.files[name].robot, domains)


def _differing(
    file: str, copies: Iterable[Constraint], child: Robot, domains: Mapping[str, Domain]
) -> Iterator[Diagnostic]:
    child_groups = _by_variables(constraint for constraint in child.shared if constraint.model == ConstraintModel.TKC)
    for variables, group in _by_variables(copies).items():
        what = f"the copy of '{shortened(group[0].name)}' over {shortened(' '.join(variables))}"
        originals = child_groups.get(variables)
        if originals is None:
            message = f"{what}: '{child.name}' has no such constraint"
            yield Diagnostic(file, group[0].line, message, f"delete the copy, or add the constraint to {child.file}")
        elif _content(group) != _content(originals):
            difference = _difference(variables, group, originals, domains, child.costs)
            if difference:
                hint = f"leave the copy out, or make it equal to {child.file}:{originals[0].line}"
                yield Diagnostic(file, group[0].line, f"{what} {difference}", hint)


def _by_variables(constraints: Iterable[Constraint]) -> dict[tuple[str, ...], list[Constraint]]:
    groups: dict[tuple[str, ...], list[Constraint]] = {}
    for constraint in constraints:
        groups.setdefault(tuple(sorted(constraint.variables)), []).append(constraint)
    return groups


def _content(group: Iterable[Constraint]) -> Counter[Hashable]:
    """Return the contents of the constraints without the names of constraints and definitions."""
    contents: Counter[Hashable] = Counter()
    for constraint in group:
        definition = constraint.definition
        if isinstance(definition, Relation):
            tuples = frozenset(zip(definition.tuples, definition.costs or definition.tuples, strict=True))
            key = definition.semantics, definition.default_cost, constraint.parameters, tuples
            contents[*key, constraint.objective] += 1
        else:
            contents[type(definition), constraint.applied, constraint.cost, constraint.objective] += 1
    return contents


def _difference(
    variables: tuple[str, ...],
    copies: Sequence[Constraint],
    originals: Sequence[Constraint],
    domains: Mapping[str, Domain],
    units: CostUnits,
) -> str:
    """Return the first difference between the two groups in words; empty if they are equal. Costs are in `units`."""
    if any(variable not in domains for variable in variables):
        return ""  # variables of a robot whose file is invalid
    if {one.objective for one in copies} != {one.objective for one in originals}:
        return "belongs to another objective than the child's constraint"
    if math.prod(len(domains[variable]) for variable in variables) > MAX_COMPARED:
        return (
            "has another definition than the child's constraint, and has too many tuples to compare"
            f" (more than {MAX_COMPARED})"
        )
    copy_costs = [_cost_function(constraint, variables, units) for constraint in copies]
    child_costs = [_cost_function(constraint, variables, units) for constraint in originals]
    for values in product(*(domains[variable] for variable in variables)):
        here, there = sum(cost(values) for cost in copy_costs), sum(cost(values) for cost in child_costs)
        if here != there:
            shown = shortened(" ".join(map(str, values)))
            own, other = _in_words(here, units), _in_words(there, units)
            return f"differs: '{shown}' is {own} here, and {other} in the child's file"
    return ""


def _in_words(cost: float, units: CostUnits) -> str:
    if cost in {0, INFINITE}:
        return "forbidden" if cost else "allowed"
    return f"at a cost of {cost_text(cost, units)}"


def _cost_function(
    constraint: Constraint, variables: tuple[str, ...], units: CostUnits
) -> Callable[[tuple[int, ...]], float]:
    """Return the cost of `constraint` as a function of the values of `variables`, faster than `Constraint.price`."""
    definition = constraint.definition
    if isinstance(definition, Relation):
        slots = [(variables.index(term), 0) if isinstance(term, str) else (-1, term) for term in constraint.parameters]
        return lambda values: definition.cost([values[slot] if slot >= 0 else constant for slot, constant in slots])
    value = compile_expression(constraint.applied, variables)
    one: int = 10 ** (units.places - definition.places) if isinstance(definition, Function) else 1

    def price(values: tuple[int, ...]) -> float:
        try:
            if isinstance(definition, Function):
                return value(values) * one
            return 0 if value(values) else constraint.cost
        except UndefinedValueError:
            return constraint.cost

    return price
