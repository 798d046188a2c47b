"""A whole team's problem as one network over values: what is written for other solvers to read."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from robochoc.problem import Kind, Team
from robochoc.solver.cliques import strengthened
from robochoc.solver.encoding import Component, Network, Table, Unsupported, components


def merged(team: Team) -> Network:
    """All variables of `team`, in its order, with all its constraints; codes are values.

    Unary constraints are folded into domains, cliques of `ne` are said outright. Raises `Unsupported` for a team
    with costs, or that changes over time, and when a constraint is too large to be a table.
    """
    if team.kind is Kind.DISWCSP:
        raise Unsupported(f"{team.name} is a DisWCSP; only problems without costs can be written yet")
    if team.dynamic:
        raise Unsupported(f"{team.name} has a scenario.xml; an XCSP3 file holds one problem, not its changes")
    place = {name: index for index, name in enumerate(team.variables)}
    domains = {name: tuple(sorted(variable.domain)) for name, variable in team.variables.items()}
    tables: list[Table] = []
    different: list[tuple[int, ...]] = []
    for part in components(team.variables.values(), team.constraints()):
        places = [place[name] for name in part.names]
        said = strengthened(part.network, lambda _: None)
        for name, codes in zip(part.names, said.domains, strict=True):
            if codes:
                domains[name] = part.decoded(codes)
            else:  # no format has an empty domain: forbid each value of the one it had
                tables.append(Table((place[name],), allowed=False, rows=tuple((value,) for value in domains[name])))
        tables += [_over_values(table, part, places) for table in said.tables]
        different += [tuple([places[member] for member in scope]) for scope in said.different]
    return Network(tuple(domains.values()), tuple(tables), tuple(different))


def identifiers(names: Sequence[str]) -> list[str]:
    """Names as XCSP3 takes them (letters, digits, `_`, a letter first), each a different one."""
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
    if table.allowed and not table.rows:  # nothing is allowed: all is forbidden
        rows = tuple(itertools.product(*(part.network.domains[member] for member in table.scope)))
        table = replace(table, allowed=False, rows=rows)
    return Table(scope, table.allowed, tuple(part.decoded(row) for row in table.rows))
