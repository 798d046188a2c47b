"""Problems with costs for solvers: costs are a column of tables, never an expression.

Each scope with costs gets an additional variable, whose codes are the costs, and a table that relates them to the codes
of the scope. The solver only minimises the sum of these non-negative variables; the minimum is checked with the
original problem.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace

from robochoc.model.absence import may_count_when_absent, restated
from robochoc.model.cost_units import cost_shown
from robochoc.model.problem import INFINITE, Constraint, Team, Variable, WhenAbsent
from robochoc.solver.encoding import (
    Codes,
    CodeTable,
    Component,
    Cost,
    Costs,
    Network,
    components,
    cost_function,
    is_soft,
)
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.propagation import propagate
from robochoc.system.lazy_dataclass import dataclass

MAX_COST_ROWS = 1_000_000
"""The maximum number of combinations of values in a cost table."""
MAX_TOTAL_COST = 2**53
"""The maximum sum of costs, in units of their greatest common divisor: solvers add them up in 64 bits."""
MAX_CODE = 2**30
"""The maximum cost with a single code, since ACE's codes are small; larger costs have two codes."""
DIGIT = 2**27
"""The unit of the higher code of a cost."""

CostRows = dict[Codes, float]
"""The costs of combinations of codes. All other combinations are forbidden."""


@dataclass(frozen=True)
class WeightedComponent:
    """A component with costs. In `network`, the variables of `part` come first.

    The cost of a solution is `base`, plus `unit` times the sum of `costs`.
    """

    part: Component
    network: Network
    costs: Costs
    base: int
    unit: int

    def cost(self, codes: Sequence[int]) -> int:
        """Return the cost of a solution of `network`."""
        return self.base + self.unit * sum(unit * codes[place] for place, unit in self.costs)

    def decoded(self, codes: Sequence[int]) -> dict[str, int]:
        """Return the values of the variables in a solution of `network`, without the variables of withdrawn robots."""
        values = self.part.values
        own = zip(self.part.names, codes, strict=False)
        return {name: values[code] for name, code in own if code < len(values)}


class _CostSumError(Exception):
    """The costs of a component may add up to `total`, which is more than `limit`."""

    def __init__(self, total: int, limit: int) -> None:
        super().__init__(total, limit)
        self.total = total
        self.limit = limit


def priced_components(team: Team, withdrawal_cost: int | None = None) -> list[WeightedComponent]:
    """Return the independent parts of the problem of `team`.

    Args:
        team: The team, with normalised costs.
        withdrawal_cost: The cost of withdrawing a robot of weight 1. None: no robot may withdraw.

    Raises:
        UnsupportedError: if a constraint has too many tuples, or costs are too high.
    """
    try:
        if withdrawal_cost is not None:
            return components_with_withdrawal(team, withdrawal_cost)
        return weighted_components(team.variables.values(), list(team.constraints()))
    except _CostSumError as error:
        units = replace(team.user_units, constant=0)
        total, limit = (cost_shown(units.in_user_units(cost)) for cost in (error.total, error.limit))
        raise UnsupportedError(
            f"costs may add up to {total}, but central solvers minimise sums up to {limit}: round costs to fewer"
            " decimals, or replace costs that mean 'never' by infinity"
        ) from None


def weighted_components(variables: Iterable[Variable], constraints: Sequence[Constraint]) -> list[WeightedComponent]:
    """Return the independent components of the problem with `variables` and `constraints`.

    The costs of constraints on constants are left out.

    Raises:
        UnsupportedError: if a constraint has too many tuples, or costs are too high.
    """
    soft = [constraint for constraint in constraints if is_soft(constraint) and constraint.variables]
    scopes = [constraint.variables for constraint in soft]
    parts = components(variables, constraints, scopes, may_split=True, may_add=True)
    of: dict[str, list[Constraint]] = {part.names[0]: [] for part in parts}
    first = {name: part.names[0] for part in parts for name in part.names}
    for constraint in soft:
        of[first[constraint.variables[0]]].append(constraint)
    return [_priced(part, of[part.names[0]]) for part in parts]


def constant_costs(team: Team) -> int:
    """Return the cost of soft constraints on constants."""
    fixed = (cost_function(constraint, ())(()) for constraint in team.constraints() if not constraint.variables)
    return int(sum(price for price in fixed if price < INFINITE))


def _priced(part: Component, soft: Iterable[Constraint]) -> WeightedComponent:
    network = propagate(part.network)
    if network.impossible:
        return WeightedComponent(part, network, (), 0, 1)
    return with_cost_variables(part, network, costs_by_scope(part, network, soft))


def costs_by_scope(part: Component, network: Network, soft: Iterable[Constraint]) -> dict[Codes, CostRows]:
    """Return the costs of `soft` constraints on variables in `part`, by scope, for the codes in `network`.

    Scopes with equal constraints and domains share one object.
    """
    together = _by_scope(part, soft)
    _join_unary(together)
    known: dict[Hashable, CostRows] = {}
    found: dict[Codes, CostRows] = {}
    for scope, held in together.items():
        place = {part.names[index]: number for number, index in enumerate(scope)}
        alike = tuple(
            [
                (
                    id(one.definition),
                    one.cost,
                    tuple([place[t] if isinstance(t, str) else (t,) for t in one.parameters]),
                )
                for one in held
            ]
        )
        key = alike, tuple([network.domains[index] for index in scope])
        if key not in known:
            known[key] = _prices(part, network, scope, held)
        found[scope] = known[key]
    return found


def _by_scope(part: Component, soft: Iterable[Constraint]) -> dict[Codes, list[Constraint]]:
    place = {name: index for index, name in enumerate(part.names)}
    together: dict[Codes, list[Constraint]] = {}
    for constraint in soft:
        together.setdefault(tuple(sorted(place[name] for name in constraint.variables)), []).append(constraint)
    return together


def with_cost_variables(part: Component, network: Network, charges: Mapping[Codes, CostRows]) -> WeightedComponent:
    """Return `network`, the network of `part`, with a cost variable for every scope with costs.

    Combinations of codes without a cost are forbidden.

    Raises:
        _CostSumError: if the costs are too high.
    """
    least = {scope: int(min(prices.values(), default=0)) for scope, prices in charges.items()}
    above = {scope: {row: int(price) - least[scope] for row, price in charges[scope].items()} for scope in charges}
    unit = math.gcd(*(price for prices in above.values() for price in prices.values())) or 1
    worst = sum(max(prices.values(), default=0) for prices in above.values()) // unit
    if worst > MAX_TOTAL_COST:
        raise _CostSumError(worst * unit, MAX_TOTAL_COST * unit)
    domains, tables, costs = list(network.domains), list(network.tables), list[tuple[int, int]]()
    for scope, prices in above.items():
        if not any(prices.values()):
            continue
        rows, units = _cost_rows({row: price // unit for row, price in prices.items()})
        places = range(len(domains), len(domains) + len(units))
        costs += zip(places, units, strict=True)
        tables.append(CodeTable((*scope, *places), allowed=True, rows=rows))
        domains += [tuple(sorted(set(column))) for column in [*zip(*rows, strict=True)][len(scope) :]]
    return WeightedComponent(
        part, replace(network, domains=tuple(domains), tables=tuple(tables)), tuple(costs), sum(least.values()), unit
    )


def _cost_rows(prices: Mapping[Codes, int]) -> tuple[tuple[Codes, ...], Codes]:
    """Return the rows of a cost table, which end with one or two codes of the cost, and the units of these codes."""
    if max(prices.values()) <= MAX_CODE:
        return tuple(sorted((*row, price) for row, price in prices.items())), (1,)
    return tuple(sorted((*row, *divmod(price, DIGIT)) for row, price in prices.items())), (DIGIT, 1)


def components_with_withdrawal(team: Team, withdrawal_cost: int) -> list[WeightedComponent]:
    """Return the components of `team`, with all their constraints, if robots may withdraw.

    `withdrawal_cost` is the cost of withdrawing a robot of weight 1. Variables have an additional code that means no
    value.
    """
    constraints = list(team.constraints())
    soft = [constraint for constraint in constraints if is_soft(constraint) and constraint.variables]
    shared = [one for robot in team.robots for one in robot.shared]
    bearing = [one for one in shared if may_count_when_absent(one)]
    own = {robot.name: tuple(variable.name for variable in robot.variables) for robot in team.robots}
    scopes = [*own.values(), *(one.variables for one in (*soft, *bearing))]
    parts = components(team.variables.values(), constraints, scopes)
    found = []
    for part in parts:
        place = {name: index for index, name in enumerate(part.names)}
        together = _by_scope(part, [one for one in soft if one.variables[0] in place])
        absent = len(part.values)
        network = Network(
            tuple((*domain, absent) for domain in part.network.domains),
            tuple(_unless_absent(table, part.network.domains, absent) for table in part.network.tables),
        )
        forbidden = [_forbidden_by_absence(part, network, one) for one in bearing if one.variables[0] in place]
        network = replace(network, tables=(*network.tables, *(table for table in forbidden if table.rows)))
        charges = {
            scope: {**_prices(part, part.network, scope, held), **_prices_in_absence(part, network, scope, held)}
            for scope, held in together.items()
        }
        robots = [robot for robot in team.robots if own[robot.name][0] in place]
        for robot in robots:
            first, *others = (place[name] for name in own[robot.name])
            network = replace(network, tables=(*network.tables, *_all_or_none(network, first, others, absent)))
            prices = charges.setdefault((first,), {(code,): 0 for code in network.domains[first]})
            prices[absent,] += robot.weight * withdrawal_cost
            if any(one.when_absent == WhenAbsent.FAIL for one in robot.private):
                stays = network.domains[first][:-1]
                network = replace(network, domains=(*network.domains[:first], stays, *network.domains[first + 1 :]))
        found.append(with_cost_variables(part, network, charges))
    return found


def _unless_absent(table: CodeTable, domains: Sequence[Codes], absent: int) -> CodeTable:
    """Return `table`, extended to allow all tuples in which a variable has the code `absent`."""
    if not table.allowed:
        return table
    return replace(table, rows=(*table.rows, *_absences([domains[place] for place in table.scope], absent)))


def _forbidden_by_absence(part: Component, network: Network, constraint: Constraint) -> CodeTable:
    """Return the rows that a hard constraint forbids if robots are absent (`model/absence.py`)."""
    scope = tuple(sorted(part.names.index(name) for name in constraint.variables))
    prices = _prices_in_absence(part, network, scope, [constraint])
    allowed = set(prices)
    rows = _absences([network.domains[place][:-1] for place in scope], len(part.values))
    return CodeTable(scope, allowed=False, rows=tuple(sorted(row for row in rows if row not in allowed)))


def _prices_in_absence(part: Component, network: Network, scope: Codes, charging: Sequence[Constraint]) -> CostRows:
    """Return the costs of constraints in each row with absent robots. Forbidden rows are left out."""
    absent = len(part.values)
    names = [part.names[place] for place in scope]
    known: dict[tuple[str, ...], list[Callable[[Sequence[int]], Cost]]] = {}
    found: CostRows = {}
    for row in _absences([network.domains[place][:-1] for place in scope], absent):
        gone = tuple([name for name, code in zip(names, row, strict=True) if code == absent])
        if gone not in known:
            left = [restated(constraint, gone) for constraint in charging]
            present = [name for name in names if name not in gone]
            known[gone] = [cost_function(constraint, present) for constraint in left if constraint is not None]
        values = [part.values[code] for code in row if code != absent]
        cost = sum(price(values) for price in known[gone])
        if cost < INFINITE:
            found[row] = cost
    return found


def _absences(domains: Sequence[Codes], absent: int) -> Iterable[Codes]:
    """Return all combinations of codes from `domains` in which at least one code is replaced by `absent`."""
    wider = itertools.product(*((*domain, absent) for domain in domains))
    return (row for row in wider if absent in row)


def _all_or_none(network: Network, first: int, others: Iterable[int], absent: int) -> Iterable[CodeTable]:
    """Yield tables that require the variables of one robot to be absent together."""
    for other in others:
        rows = itertools.product(network.domains[first], network.domains[other])
        alike = tuple(row for row in rows if (row[0] == absent) == (row[1] == absent))
        yield CodeTable((first, other), allowed=True, rows=alike)


def _join_unary(together: dict[Codes, list[Constraint]]) -> None:
    """Add unary costs to the costs of a wider scope with the same variable, if there is such a scope."""
    wider = {place: scope for scope in together if len(scope) > 1 for place in scope}
    for scope in [scope for scope in together if len(scope) == 1 and scope[0] in wider]:
        together[wider[scope[0]]] += together.pop(scope)


def _prices(part: Component, network: Network, scope: Codes, charging: Iterable[Constraint]) -> CostRows:
    """Return the sum of the costs of constraints on `scope` for each combination of codes."""
    size = math.prod(len(network.domains[place]) for place in scope)
    if size > MAX_COST_ROWS:
        names = ", ".join(constraint.name for constraint in charging)
        raise UnsupportedError(
            f"constraint {names} has costs for {size:,} combinations of values, more than the {MAX_COST_ROWS:,} that"
            " the central solver can list; split it"
        )
    prices = [cost_function(constraint, [part.names[place] for place in scope]) for constraint in charging]
    found = {}
    for codes in itertools.product(*(network.domains[place] for place in scope)):
        values = part.decoded(codes)
        total = sum(price(values) for price in prices)
        if total < INFINITE:
            found[codes] = total
    return found
