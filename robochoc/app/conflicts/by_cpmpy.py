"""Finds conflicts with CPMpy (https://cpmpy.readthedocs.io): a minimal unsatisfiable subset, one assumption per rule.

Only the process that searches for conflicts imports this module, since CPMpy and its solver need much time and memory.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

from robochoc.app.conflicts.rules import minimal, rule_of, with_only
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.model.constraint import Constraint, Function, Relation
from robochoc.model.expression import Apply, Expression
from robochoc.model.expression import Constant as Integer
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.problem import INFINITE, Team
from robochoc.system.errors import RobochocError


def limits_of(team: Team) -> dict[str, Interval]:
    """Return the minimum and maximum value of each variable with values."""
    domains = {name: one.domain.ranges for name, one in team.variables.items()}
    return {name: Interval(ranges[0][0], ranges[-1][-1]) for name, ranges in domains.items() if ranges}


def can_be_undefined(constraint: Constraint, limits: Mapping[str, Interval]) -> bool:
    """Return whether a constraint may be undefined for some values. The result may be a false positive.

    Args:
        constraint: The constraint.
        limits: The result of `limits_of` for the team. A constraint on a variable without values is always defined.
    """
    definition = constraint.definition
    if isinstance(definition, Relation) or not limits.keys() >= {*constraint.variables}:
        return False
    given = [limits[one] if isinstance(one, str) else Interval(one, one) for one in constraint.parameters]
    return _can_be(definition.body, dict(zip(definition.parameters, given, strict=True)))


def _can_be(expression: Expression, limits: Mapping[str, Interval]) -> bool:
    if not isinstance(expression, Apply):
        return False
    operator, arguments = expression.operator, expression.arguments
    if operator == "pow" or any(_can_be(one, limits) for one in arguments):
        return True
    if operator in {"div", "mod"}:
        divisor = bounds(arguments[1], limits)
        return divisor.low <= 0 <= divisor.high
    return False  # results beyond 64 bits are rejected when a team is read (`model/magnitudes.py`)


MOST_ROWS = 2_000_000
"""The maximum number of rows in a table."""


FEW = 8
"""With up to this number of rules, each subset is a new model, since a solver simplifies more without assumptions. With
more rules, all are assumptions in one model, and the solver reports which of them it used."""


class UntranslatedError(RobochocError, ValueError):
    """The rule cannot be translated to CPMpy."""


def minimal_by_cpmpy(sketch: Sketch, rules: Sequence[str]) -> tuple[str, ...] | None:
    """Return a minimal set of rules that cannot be satisfied together, or None if all rules can.

    Raises:
        ImportError: if CPMpy or its solver OR-Tools is not installed.
        UntranslatedError: if a rule cannot be translated to CPMpy.
    """
    team = model_of(with_only(sketch, rules)).team
    problem = _Problem(team)
    translated = {rule: parts for rule in rules if (parts := _global_constraint(sketch, rule, problem.variables))}
    done = frozenset(translated)
    for constraint in team.constraints():
        rule = rule_of(constraint.name, rules)
        if rule is None:
            raise UntranslatedError(constraint.name)
        if rule not in done:
            translated.setdefault(rule, []).append(problem.translated(constraint))
    return problem.minimal({rule: translated[rule] for rule in rules if rule in translated})


def minimal_of_team(team: Team, constraints: Mapping[str, Constraint]) -> tuple[str, ...] | None:
    """Return a minimal set of a team's constraints that cannot be satisfied together, by their names in `constraints`.

    Raises the exceptions of `minimal_by_cpmpy`.
    """
    problem = _Problem(team)
    return problem.minimal({name: [problem.translated(constraint)] for name, constraint in constraints.items()})


class _Problem:
    """A team's variables in CPMpy, with their domains."""

    def __init__(self, team: Team) -> None:
        import cpmpy  # noqa: PLC0415 - an extra

        if any(len(one.domain) > MOST_ROWS for one in team.variables.values()):
            raise UntranslatedError("a domain is too large")
        self._domains = {name: sorted(one.domain) for name, one in team.variables.items()}
        self._limits = limits_of(team)
        self.variables = {
            name: cpmpy.intvar(values[0], values[-1], name=name) for name, values in self._domains.items()
        }
        self._hard = [cpmpy.InDomain(self.variables[name], values) for name, values in self._domains.items()]

    def translated(self, constraint: Constraint) -> Any:  # noqa: ANN401 - CPMpy's
        """Return a constraint as a CPMpy constraint. Raises `UntranslatedError`."""
        if can_be_undefined(constraint, self._limits):  # robochoc forbids undefined values, but CPMpy does not
            return _table(constraint, self.variables, self._domains)
        return _translated_constraint(constraint, self.variables, self._domains)

    def minimal(self, rules: Mapping[str, list[Any]]) -> tuple[str, ...] | None:
        """Return a minimal subset of rules that cannot be satisfied together, or None if all rules can."""
        import cpmpy  # noqa: PLC0415 - an extra
        from cpmpy.tools.explain import mus  # noqa: PLC0415 - the same

        hard = [*self._hard]
        softs = {rule: cpmpy.all(parts) for rule, parts in rules.items()}
        if len(softs) <= FEW:
            return minimal(
                [*softs], lambda some: cpmpy.Model(hard, *(softs[one] for one in some)).solve(solver="ortools")
            )
        if cpmpy.Model(hard, *softs.values()).solve(solver="ortools"):
            return None
        # Each rule is a single Boolean, so that it is used as a whole.
        marks = {rule: cpmpy.boolvar(name=f"rule {rule}") for rule in softs}
        hard += [mark.implies(softs[rule]) for rule, mark in marks.items()]
        found = {str(one) for one in mus([*marks.values()], hard=hard, solver="ortools")}
        return tuple(rule for rule, mark in marks.items() if str(mark) in found)


def _global_constraint(sketch: Sketch, name: str, variables: dict[str, Any]) -> list[Any]:
    """Return the AllDifferent constraint of a rule; empty for other rules."""
    import cpmpy  # noqa: PLC0415 - an extra

    rule = sketch.rule(name)
    if rule is None or rule.kind != "different":
        return []
    return [cpmpy.AllDifferent([variables[f"{robot}.{rule.decision}"] for robot in sketch.bound(rule)])]


def _table(constraint: Constraint, variables: dict[str, Any], domains: dict[str, list[int]]) -> Any:  # noqa: ANN401 - CPMpy's
    """Return a constraint as a table of the allowed values, found by enumeration."""
    import cpmpy  # noqa: PLC0415 - an extra

    rows = []
    for number, row in enumerate(itertools.product(*(domains[name] for name in constraint.variables))):
        if number >= MOST_ROWS:
            raise UntranslatedError(constraint.name)
        if constraint.price(dict(zip(constraint.variables, row, strict=True))) < INFINITE:
            rows.append(row)
    return cpmpy.Table([variables[name] for name in constraint.variables], rows) if rows else cpmpy.BoolVal(False)


def _translated_constraint(constraint: Constraint, variables: dict[str, Any], domains: dict[str, list[int]]) -> Any:  # noqa: ANN401 - CPMpy's
    import cpmpy  # noqa: PLC0415 - an extra

    definition = constraint.definition
    if isinstance(definition, Relation):
        return _table(constraint, variables, domains)
    if isinstance(definition, Function):  # a soft constraint
        return cpmpy.BoolVal(True)
    actual = [variables[one] if isinstance(one, str) else one for one in constraint.parameters]
    return _translated(definition.body, dict(zip(definition.parameters, actual, strict=True)))


def _translated(expression: Expression, given: dict[str, Any]) -> Any:  # noqa: ANN401 - CPMpy's expressions
    if isinstance(expression, Integer):
        return expression.value
    if not isinstance(expression, Apply):
        return given[expression.name]
    operator = _OPERATORS.get(expression.operator)
    if operator is None:
        raise UntranslatedError(expression.operator)
    return operator(*(_translated(one, given) for one in expression.arguments))


def _in(value: Any, *members: Any) -> Any:  # noqa: ANN401 - CPMpy's expressions
    import cpmpy  # noqa: PLC0415 - an extra

    return cpmpy.any([value == member for member in members])


def _if(condition: Any, then: Any, otherwise: Any) -> Any:  # noqa: ANN401 - CPMpy's expressions
    if isinstance(condition, bool):
        return then if condition else otherwise
    return condition * then + (~condition) * otherwise


def _equal(first: Any, *others: Any) -> Any:  # noqa: ANN401 - CPMpy's expressions
    return reduce(lambda one, other: one & other, [first == other for other in others])


def _not(one: Any) -> Any:  # noqa: ANN401 - CPMpy's expressions
    return (not one) if isinstance(one, bool) else ~one


_OPERATORS: dict[str, Callable[..., Any]] = {
    "neg": lambda one: -one,
    "abs": abs,
    "sqr": lambda one: one * one,
    "add": lambda *given: reduce(lambda one, other: one + other, given),
    "sub": lambda one, other: one - other,
    "mul": lambda *given: reduce(lambda one, other: one * other, given),
    "div": lambda one, other: one // other,
    "mod": lambda one, other: one % other,
    "dist": lambda one, other: abs(one - other),
    "eq": _equal,
    "ne": lambda one, other: one != other,
    "lt": lambda one, other: one < other,
    "le": lambda one, other: one <= other,
    "gt": lambda one, other: one > other,
    "ge": lambda one, other: one >= other,
    "in": _in,
    "if": _if,
    "not": _not,
    "and": lambda *given: reduce(lambda one, other: one & other, given),
    "or": lambda *given: reduce(lambda one, other: one | other, given),
}
