"""A whole team's problem as one network over values: what is written for other solvers to read."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from robochoc.model.problem import Constraint, ProblemKind, Team
from robochoc.solver.cliques import with_cliques
from robochoc.solver.encoding import Codes, Component, Network, Table, UnsupportedError, components, is_soft
from robochoc.solver.propagation import propagate
from robochoc.solver.weighted import MAX_CODE, constant_costs, costs_by_scope

MIN_VALUE, MAX_VALUE = -(2**31) + 10, 2**31 - 11
"""Values that ACE 2.6 reads: of 32 bits, but for a few that it keeps for itself (tried with ACE, one by one)."""
MAX_SPREAD = 2**31 - 1
"""So far apart may the values of one domain be; ACE counts what is between them, too."""


def team_network(team: Team) -> tuple[Network, Codes]:
    """Return all variables of `team`, in its order, with all its constraints; codes are values.

    Unary constraints are folded into domains, cliques of `ne` are made explicit. Behind the team's variables come those
    that wide predicates are split by (`solver/splitting.py`). What soft constraints charge are variables too, after the
    others: those at the places that are returned, whose sum is what the problem costs.

    Raises:
        UnsupportedError: for a team that changes over time, and when a constraint is too large to be a table, or
            charges too much, or a value is none that XCSP3's solvers take.
    """
    if team.dynamic:
        raise UnsupportedError(f"{team.name} has a scenario.xml; an XCSP3 file holds one problem, not its changes")
    place = {name: index for index, name in enumerate(team.variables)}
    domains = {name: tuple(sorted(variable.domain)) for name, variable in team.variables.items()}
    tables: list[Table] = []
    different: list[tuple[int, ...]] = []
    soft = [constraint for constraint in team.constraints() if is_soft(constraint) and constraint.variables]
    charges: list[Table] = []
    impossible = False
    together = [one.variables for one in soft]
    for part in components(team.variables.values(), team.constraints(), together, may_split=True):
        places = [place.setdefault(name, len(place)) for name in part.names]
        network = with_cliques(part.network, lambda _: None)
        for name, codes in zip(part.names, network.domains, strict=True):
            domains[name] = part.decoded(codes) or domains.get(name, (0,))  # no format has an empty domain
        impossible = impossible or part.network.impossible
        tables += [_over_values(table, part, places) for table in network.tables]
        different += [tuple([places[member] for member in scope]) for scope in network.different]
        if not part.network.impossible:
            known = set(part.names)
            charges += _charges(part, places, [one for one in soft if one.variables[0] in known])
    paid = _cost_domains(team, charges)
    costs = tuple(range(len(domains), len(domains) + len(paid)))
    tables += [replace(table, scope=(*table.scope, cost)) for table, cost in zip(charges, costs, strict=False)]
    _refuse_far_values(team, domains)
    network = Network((*domains.values(), *paid), tuple(tables), tuple(different))
    return _readable(network, impossible=impossible), costs


def _cost_domains(team: Team, charges: Sequence[Table]) -> list[Codes]:
    """Return the domains of the cost variables: one for each table of `charges`, one for constant costs."""
    domains = [tuple(sorted({row[-1] for row in table.rows})) for table in charges]
    constant = constant_costs(team)
    if constant or (team.kind == ProblemKind.DISWCSP and not domains):
        domains.append((constant,))
    if sum(map(max, domains)) > MAX_CODE:
        raise UnsupportedError(
            f"{team.name} has costs that add up to more than {MAX_CODE:,}, too much for XCSP3's solvers"
        )
    return domains


def _readable(network: Network, *, impossible: bool) -> Network:
    """Return `network` such that ACE takes it: with the same variables, domains and solutions.

    ACE 2.6 dies where its first propagation empties a table, miscounts where forbidden tuples meet a domain of one
    value (see `solver/propagation.py`), refuses an instance without constraints, and leaves out variables that stand
    in none.
    """
    if impossible or (safe := propagate(network)).impossible:
        nothing = tuple([(value,) for value in network.domains[0]])
        network = Network(network.domains, (Table((0,), allowed=False, rows=nothing),))
    elif any(not table.allowed for table in network.tables):
        network = safe
    bound = {place for table in network.tables for place in table.scope}.union(*network.different)
    free = [place for place in range(len(network.domains)) if place not in bound]
    anything = [Table((place,), allowed=True, rows=tuple([(v,) for v in network.domains[place]])) for place in free]
    return replace(network, tables=(*network.tables, *anything))


def _refuse_far_values(team: Team, domains: Mapping[str, Codes]) -> None:
    """Raise `UnsupportedError` when values of `domains` are none that ACE reads."""
    for name, values in domains.items():
        far = [f"{value:,}" for value in (values[0], values[-1]) if not MIN_VALUE <= value <= MAX_VALUE]
        if far or values[-1] - values[0] > MAX_SPREAD:
            shown = far[0] if far else f"{values[0]:,} and {values[-1]:,}"
            raise UnsupportedError(
                f"{team.name} has a variable {name} with the value {shown}; XCSP3's solvers compute with 32 bits: ACE"
                f" takes values from {MIN_VALUE:,} to {MAX_VALUE:,}, and in one domain no further apart than"
                f" {MAX_SPREAD:,}; shift the problem's values, or scale them"
            )


def _charges(part: Component, places: Sequence[int], soft: Sequence[Constraint]) -> Iterator[Table]:
    """Return tables of values and their costs, the latter in a column whose variable is not there yet."""
    for scope, prices in costs_by_scope(part, part.network, soft).items():
        if prices:
            rows = tuple((*part.decoded(codes), int(price)) for codes, price in prices.items())
            yield Table(tuple([places[member] for member in scope]), allowed=True, rows=rows)


def identifiers(names: Sequence[str]) -> list[str]:
    """Return names as XCSP3 takes them (letters, digits, `_`, a letter first), each a different one."""
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


def _over_values(table: Table, part: Component, places: Sequence[int]) -> Table:
    scope = tuple([places[member] for member in table.scope])
    return Table(scope, table.allowed, tuple(part.decoded(row) for row in table.rows))
