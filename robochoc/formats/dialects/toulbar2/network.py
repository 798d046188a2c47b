"""Cost function networks, for `.cfn` and `.wcsp`: conversion from a network to a team, and from a team to its costs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.definitions import check_domain
from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.dialect import (
    ConversionNote,
    ImportOptions,
    ImportResult,
    NameMap,
    notes_on_names,
    owners_by,
)
from robochoc.formats.dialects.exact_costs import Amount, ExactCostTable, Scale, apply_infinity, relation, xml_name
from robochoc.formats.dialects.tabulation import TabulatedConstraint, amounts, decimal, finite_cost_bound, tabulate
from robochoc.model.assembly import assemble
from robochoc.model.constraint import INFINITE, Constraint, ConstraintModel, Domain, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass

LIMIT = 2**53
"""The limit on costs, in units of their last decimal place, because toulbar2 1.1 reads the costs in a cfn as floats."""


@dataclass(frozen=True)
class CostFunction:
    """A cost function over variables given by their indices, with the costs of tuples of value indices."""

    scope: tuple[int, ...]
    table: ExactCostTable
    line: int


@dataclass(frozen=True)
class CostFunctionNetwork:
    """A cost function network.

    Attributes:
        name: Its name.
        variables: Its variables by name: the number of their values, or the names of the values.
        functions: Its cost functions. A scope may be empty.
        bound: A bound on the total cost of a solution: an exclusive upper bound, or lower bound if costs are maximised.
        maximize: True if costs are maximised.
        notes: The changes made when reading the file.
    """

    name: str
    variables: Mapping[str, int | tuple[str, ...]]
    functions: Sequence[CostFunction]
    bound: Amount
    maximize: bool = False
    notes: tuple[ConversionNote, ...] = ()


def to_team(network: CostFunctionNetwork, options: ImportOptions, dialect: str) -> ImportResult:
    """Return `network` as a team. Raises `MistakeError`."""
    names, robots, symbols = NameMap(), NameMap(), NameMap()
    codes, domains = _domains(network, symbols)
    owners = owners_by(options.owner, network.variables) if options.owner is not None else {}
    variables: dict[str, list[Variable]] = {}
    for name in network.variables:
        variables.setdefault(robots.allowed(owners.get(name, name)), []).append(
            Variable(names.allowed(name), domains[name])
        )
    functions = list(_with_hard_tuples(network, options.infinity))
    scale = Scale(amount for one in functions for amount in one.table.amounts())
    places, constant, constraints = list(network.variables), 0, []
    for one in functions:
        relation_or_constant = _relation(one, scale, [codes[places[place]] for place in one.scope])
        if isinstance(relation_or_constant, int):
            constant += relation_or_constant
        else:
            scope = tuple(names.allowed(places[place]) for place in one.scope[: relation_or_constant.arity])
            name = xml_name(one.table.name)
            constraints.append(Constraint(name, relation_or_constant, scope, scope, ConstraintModel.TKC, line=one.line))
    reaches = _reaches_the_bound(network, functions)
    notes = [*network.notes, *_notes(network, scale, reaches=reaches)]
    notes += notes_on_names([*names.originals.items(), *symbols.originals.items()])
    if options.owner is None:
        notes.append(ConversionNote("owner", "the format has no owners: each variable gets its own robot"))
    title = options.name or network.name
    if constant or any(_is_soft(one) for one in constraints):
        units = CostUnits(network.maximize, scale.places, constant)
        team = assemble(title, variables, constraints, kind=ProblemKind.DISWCSP, costs=units)
    else:
        team = assemble(title, variables, constraints)
    bound = Fraction(network.bound) if reaches else None
    return ImportResult(team, dialect, {**names.originals, **robots.originals}, tuple(notes), bound)


def _is_soft(constraint: Constraint) -> bool:
    return isinstance(constraint.definition, Relation) and constraint.definition.semantics == Semantics.SOFT


def _domains(network: CostFunctionNetwork, symbols: NameMap) -> tuple[dict[str, Sequence[int]], dict[str, Domain]]:
    """Return the integers for each variable's values, in the order of the file, and the variable's domain."""
    named = {
        symbols.allowed(one): None
        for values in network.variables.values()
        if not isinstance(values, int)
        for one in values
    }
    places = {name: place for place, name in enumerate(named)}
    codes: dict[str, Sequence[int]] = {}
    domains = {}
    for name, values in network.variables.items():
        title = f"D_{xml_name(name)}"
        if isinstance(values, int):
            codes[name] = range(values)
            domains[name] = Domain(title, (range(values),))
        else:
            codes[name] = [places[symbols.allowed(one)] for one in values]
            domains[name] = Domain(title, tuple(range(one, one + 1) for one in sorted(codes[name])), tuple(places))
        check_domain(domains[name])
    return codes, domains


def _relation(function: CostFunction, scale: Scale, codes: Sequence[Sequence[int]]) -> Relation | int:
    rows = {
        tuple([known[place] for known, place in zip(codes, values, strict=True)]): cost
        for values, cost in function.table.rows.items()
    }
    try:
        relation_or_constant = relation(replace(function.table, rows=rows), len(function.scope), scale)
    except MistakeError as mistake:
        raise MistakeError(mistake.message, mistake.hint, function.line) from None
    if not isinstance(relation_or_constant, int) and not function.scope:
        what = "the constant forbids all assignments"
        raise MistakeError(what, "delete it, or write a finite cost", function.line)
    return relation_or_constant


def _with_hard_tuples(network: CostFunctionNetwork, infinity: int | None) -> Iterator[CostFunction]:
    """Yield the functions, after forbidding the tuples that no solution below the bound contains.

    A tuple is forbidden if its cost plus the least costs of all other functions reaches the bound.
    """
    sign = -1 if network.maximize else 1

    def converted(amount: Amount) -> Amount:
        return apply_infinity(amount, infinity, maximize=network.maximize) if abs(amount) != INFINITE else INFINITE

    functions = [_with_costs(one, converted) for one in network.functions]
    least = [min((_signed(cost, sign) for cost in one.table.amounts()), default=0) for one in functions]
    if INFINITE in least:
        yield from functions
        return
    if abs(network.bound) == INFINITE:
        yield from functions
        return
    room = sign * Fraction(network.bound) - sum(Fraction(low) for low in least)
    for one, low in zip(functions, least, strict=True):
        limit = room + Fraction(low)

        def cut(amount: Amount, limit: Fraction = limit) -> Amount:
            return INFINITE if _signed(amount, sign) >= limit else amount

        yield one if not one.scope else _with_costs(one, cut)


def _signed(amount: Amount, sign: int) -> Amount:
    return amount if amount == INFINITE else sign * amount


def _with_costs(function: CostFunction, change: object) -> CostFunction:
    if not callable(change):
        raise TypeError
    known = {amount: change(amount) for amount in {*function.table.rows.values(), function.table.default}}
    rows = {values: known[cost] for values, cost in function.table.rows.items()}
    return replace(function, table=replace(function.table, rows=rows, default=known[function.table.default]))


def _reaches_the_bound(network: CostFunctionNetwork, functions: Iterable[CostFunction]) -> bool:
    """Return whether the sum of the greatest finite costs of all functions reaches the bound."""
    sign = -1 if network.maximize else 1
    most: Amount = 0
    for one in functions:
        finite = [sign * amount for amount in one.table.amounts() if amount != INFINITE]
        most += max(finite, default=0)
    return abs(network.bound) != INFINITE and most >= sign * network.bound


def _notes(network: CostFunctionNetwork, scale: Scale, *, reaches: bool) -> Iterator[ConversionNote]:
    if scale.rounds:
        yield ConversionNote(
            "rounded", f"some costs have more than {scale.places} decimal places, and were rounded to that many"
        )
    if reaches:
        side = "above" if network.maximize else "below"
        text = f"toulbar2 accepts only costs {side} {float(network.bound):g}; here an assignment that reaches this"
        yield ConversionNote("bound", f"{text} bound is a solution, too: compare its cost with the bound")


class TeamCosts(NamedTuple):
    """A team's costs with their constant and decimal places, and a bound that no finite sum reaches."""

    tables: list[TabulatedConstraint]
    constant: Fraction
    places: int
    bound: int


def team_costs(team: Team) -> TeamCosts:
    """Return the costs of `team` as a network of toulbar2.

    Raises:
        UnsupportedError: if costs or a constraint's table are too large, or the team changes over time.
    """
    if team.scenario:
        raise UnsupportedError("toulbar2's formats do not support scenarios: remove scenario.xml")
    tables, constant = tabulate(team)
    places, bound = Scale([constant, *amounts(tables)]).places, finite_cost_bound(tables, constant)
    if bound * 10**places >= LIMIT:
        unit = f" in units of {decimal(Fraction(1, 10**places))}" if places else ""
        what = f"costs may add up to {bound * 10**places:,}{unit}"
        raise UnsupportedError(f"{what}: toulbar2 1.1 reads only costs below {LIMIT:,} exactly; use smaller costs")
    return TeamCosts(tables, constant, places, bound)
