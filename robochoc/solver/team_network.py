"""A whole team's problem as one network over values, for export to other solvers."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from robochoc.model.problem import Constraint, ProblemKind, Team
from robochoc.solver.cliques import with_cliques
from robochoc.solver.encoding import Codes, CodeTable, Component, Network, components, is_soft
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.propagation import propagate
from robochoc.solver.weighted import MAX_CODE, constant_costs, costs_by_scope

MIN_VALUE, MAX_VALUE = -(2**31) + 10, 2**31 - 11
"""The values that ACE 2.6 can read: 32 bits, except a few that it reserves (found by tests with ACE)."""
MAX_SPREAD = 2**31 - 1
"""The maximum difference between two values in a domain, because ACE counts the values between them."""


def team_network(team: Team) -> tuple[Network, Codes]:
    """Return all variables of `team`, in its order, with all its constraints; codes are values.

    Unary constraints are applied to domains, and cliques of `ne` are explicit. After the team's variables come the
    variables of split predicates (`solver/splitting.py`), then the cost variables of soft constraints. The positions of
    the cost variables are returned; their sum is the cost of the problem.

    Raises:
        UnsupportedError: if the team changes over time, a constraint is too large for a table, costs are too high, or
            XCSP3's solvers do not support a value.
    """
    if team.dynamic:
        raise UnsupportedError(f"{team.name} has a scenario.xml, but an XCSP3 file cannot contain changes")
    place = {name: index for index, name in enumerate(team.variables)}
    domains = {name: tuple(sorted(variable.domain)) for name, variable in team.variables.items()}
    tables: list[CodeTable] = []
    different: list[tuple[int, ...]] = []
    soft = [constraint for constraint in team.constraints() if is_soft(constraint) and constraint.variables]
    charges: list[CodeTable] = []
    impossible = False
    together = [one.variables for one in soft]
    parts = components(team.variables.values(), team.constraints(), together, may_split=True)
    first = {name: part.names[0] for part in parts for name in part.names}
    paid_in: dict[str, list[Constraint]] = {part.names[0]: [] for part in parts}
    for constraint in soft:
        paid_in[first[constraint.variables[0]]].append(constraint)
    for part in parts:
        places = [place.setdefault(name, len(place)) for name in part.names]
        network = with_cliques(part.network, lambda _: None)
        for name, codes in zip(part.names, network.domains, strict=True):
            domains[name] = part.decoded(codes) or domains.get(name, (0,))  # no format supports an empty domain
        impossible = impossible or part.network.impossible
        tables += [_over_values(table, part, places) for table in network.tables]
        different += [tuple([places[member] for member in scope]) for scope in network.different]
        if not part.network.impossible:
            charges += _charges(part, places, paid_in[part.names[0]])
    paid = _cost_domains(team, charges)
    costs = tuple(range(len(domains), len(domains) + len(paid)))
    tables += [replace(table, scope=(*table.scope, cost)) for table, cost in zip(charges, costs, strict=False)]
    _refuse_far_values(team, domains)
    network = Network((*domains.values(), *paid), tuple(tables), tuple(different))
    return _readable(network, impossible=impossible), costs


def _cost_domains(team: Team, charges: Sequence[CodeTable]) -> list[Codes]:
    """Return the domains of the cost variables: one for each table of `charges`, one for constant costs."""
    domains = [tuple(sorted({row[-1] for row in table.rows})) for table in charges]
    constant = constant_costs(team)
    if constant or (team.kind == ProblemKind.DISWCSP and not domains):
        domains.append((constant,))
    if sum(map(max, domains)) > MAX_CODE:
        raise UnsupportedError(
            f"the costs of {team.name} may add up to more than {MAX_CODE:,}, the maximum for XCSP3's solvers"
        )
    return domains


def _readable(network: Network, *, impossible: bool) -> Network:
    """Return `network` in a form that ACE can read, with the same variables, domains and solutions.

    ACE 2.6 crashes if its first propagation empties a table, miscounts if forbidden tuples contain a variable with one
    value (see `solver/propagation.py`), rejects an instance without constraints, and omits variables without
    constraints.
    """
    if impossible or (safe := propagate(network)).impossible:
        nothing = tuple([(value,) for value in network.domains[0]])
        network = Network(network.domains, (CodeTable((0,), allowed=False, rows=nothing),))
    elif any(not table.allowed for table in network.tables):
        network = safe
    bound = {place for table in network.tables for place in table.scope}.union(*network.different)
    free = [place for place in range(len(network.domains)) if place not in bound]
    anything = [CodeTable((place,), allowed=True, rows=tuple([(v,) for v in network.domains[place]])) for place in free]
    return replace(network, tables=(*network.tables, *anything))


def _refuse_far_values(team: Team, domains: Mapping[str, Codes]) -> None:
    """Raise `UnsupportedError` if ACE cannot read values of `domains`."""
    for name, values in domains.items():
        far = [f"{value:,}" for value in (values[0], values[-1]) if not MIN_VALUE <= value <= MAX_VALUE]
        if far or values[-1] - values[0] > MAX_SPREAD:
            shown = far[0] if far else f"{values[0]:,} and {values[-1]:,}"
            raise UnsupportedError(
                f"{team.name} has a variable {name} with the value {shown}; XCSP3's solvers compute with 32 bits: ACE"
                f" supports values from {MIN_VALUE:,} to {MAX_VALUE:,}, which differ by at most {MAX_SPREAD:,} in a"
                " domain; shift or scale the values"
            )


def _charges(part: Component, places: Sequence[int], soft: Sequence[Constraint]) -> Iterator[CodeTable]:
    """Return tables of values with a last column of costs, whose variable is added later."""
    for scope, prices in costs_by_scope(part, part.network, soft).items():
        if prices:
            rows = tuple((*part.decoded(codes), int(price)) for codes, price in prices.items())
            yield CodeTable(tuple([places[member] for member in scope]), allowed=True, rows=rows)


def identifiers(names: Sequence[str]) -> list[str]:
    """Return different valid XCSP3 names (a letter, then letters, digits, `_`) for `names`."""
    taken: set[str] = set()
    found = []
    for name in names:
        plain = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)
        plain = plain if plain[:1].isalpha() else f"v{plain}"
        numbered = (f"{plain}_{number}" for number in itertools.count(2))
        chosen = next(one for one in itertools.chain([plain], numbered) if one not in taken)
        taken.add(chosen)
        found.append(chosen)
    return found


def _over_values(table: CodeTable, part: Component, places: Sequence[int]) -> CodeTable:
    scope = tuple([places[member] for member in table.scope])
    return CodeTable(scope, table.allowed, tuple(part.decoded(row) for row in table.rows))
