"""A team's whole problem as one XCSP3 file, which ACE, Choco and other solvers read (https://xcsp.org)."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from decimal import Decimal

from lxml import etree

from robochoc.model.costs import flat_units, normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.encoding import Codes, Network, Table
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.team_network import identifiers, team_network
from robochoc.solver.weighted import MAX_CODE


def xcsp3(team: Team, solver: AceProcess | None = None) -> bytes:
    """Return the merged problem of `team` as an XCSP3-core document: tables over the true values, and allDifferent.

    Variables get names that XCSP3 allows; the attribute `note` says whose variable each is. Those without one are parts
    of predicates that are too wide for one table. With costs it is a COP: what soft constraints charge are variables
    too, and their sum is to be minimised, or maximised where the team does.
    Costs are integers in the team's unit, as a `note` says where that is not 1; one further variable stands for their
    constant part. To export many teams, one may lend a `solver`.

    Raises:
        UnsupportedError: if the team has what XCSP3 has not.
        SolverLostError: if pycsp3, which writes it in a process of its own, fails.
    """
    team = normalized(team)
    network, costs = _as_told(team, *team_network(team))
    names = list(team.variables)
    further = [f"partial{number}" for number in range(1, len(network.domains) - len(names) - len(costs) + 1)]
    charged = [f"cost{number}" for number in range(1, len(costs) + 1)]
    with nullcontext(solver) if solver else AceProcess(java=False) as writer:
        document = writer.export(network, identifiers([*names, *further, *charged]), costs)
    root = etree.fromstring(document, etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True))
    for element, name in zip(root.iterfind("variables/var"), names, strict=False):
        element.set("note", f"{name} of {team.owner[name]}")
    for objective in root.iterfind("objectives/minimize"):
        objective.tag = "maximize" if team.told_in.maximize else "minimize"
        if team.told_in.places:
            objective.set("note", f"in units of {Decimal(1).scaleb(-team.told_in.places):f}")
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")


def _as_told(team: Team, network: Network, costs: Codes) -> tuple[Network, Codes]:
    """Return a network of normalised costs with the costs that the user has: negated, and with their constant."""
    sign = -1 if team.told_in.maximize else 1
    constant = flat_units(team).constant
    if team.kind != ProblemKind.DISWCSP or (sign == 1 and not constant):
        return network, costs
    if abs(constant) > MAX_CODE:
        raise UnsupportedError(f"{team.name} has a constant cost of {constant:,}, too much for XCSP3's solvers")
    paid = set(costs)
    domains = [
        tuple(sorted(sign * value for value in domain)) if place in paid else domain
        for place, domain in enumerate(network.domains)
    ]
    tables = [
        replace(table, rows=tuple((*row[:-1], sign * row[-1]) for row in table.rows))
        if table.scope[-1] in paid
        else table
        for table in network.tables
    ]
    if constant:
        costs = (*costs, len(domains))
        tables.append(Table((len(domains),), allowed=True, rows=((constant,),)))
        domains.append((constant,))
    return replace(network, domains=tuple(domains), tables=tuple(tables)), costs
