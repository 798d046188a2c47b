"""Write a team's problem as one XCSP3 file for ACE, Choco and other solvers (https://xcsp.org)."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from decimal import Decimal

from lxml import etree

from robochoc.model.costs import flat_units, normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.encoding import Codes, CodeTable, Network
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.team_network import identifiers, team_network
from robochoc.solver.weighted import MAX_CODE


def xcsp3(team: Team, solver: AceProcess | None = None) -> bytes:
    """Return the merged problem of `team` as an XCSP3-core document: tables over the original values, and allDifferent.

    Variables get names that XCSP3 allows; the attribute `note` names the variable of the team and its robot. Variables
    without a note are parts of predicates that are too wide for one table. A problem with costs becomes a COP: the cost
    of each soft constraint is a variable, and the sum of these is minimised, or maximised as in the team. Costs are
    integers in the team's unit, which a `note` states unless it is 1; one more variable is their constant part.

    Args:
        team: The team.
        solver: A running process to use, for the export of many teams. None: start one.

    Raises:
        UnsupportedError: if XCSP3 lacks a feature of the team.
        SolverLostError: if pycsp3, which writes the document in its own process, fails.
    """
    team = normalized(team)
    network, costs = _with_user_costs(team, *team_network(team))
    names = list(team.variables)
    further = [f"partial{number}" for number in range(1, len(network.domains) - len(names) - len(costs) + 1)]
    charged = [f"cost{number}" for number in range(1, len(costs) + 1)]
    with nullcontext(solver) if solver else AceProcess(java=False) as writer:
        document = writer.export(network, identifiers([*names, *further, *charged]), costs)
    root = etree.fromstring(document, etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True))
    for element, name in zip(root.iterfind("variables/var"), names, strict=False):
        element.set("note", f"{name} of {team.owner[name]}")
    for objective in root.iterfind("objectives/minimize"):
        objective.tag = "maximize" if team.user_units.maximize else "minimize"
        if team.user_units.places:
            objective.set("note", f"in units of {Decimal(1).scaleb(-team.user_units.places):f}")
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")


def _with_user_costs(team: Team, network: Network, costs: Codes) -> tuple[Network, Codes]:
    """Return a network of normalised costs with the user's costs: negated if maximised, and with their constant."""
    sign = -1 if team.user_units.maximize else 1
    constant = flat_units(team).constant
    if team.kind != ProblemKind.DISWCSP or (sign == 1 and not constant):
        return network, costs
    if abs(constant) > MAX_CODE:
        raise UnsupportedError(
            f"{team.name} has a constant cost of {constant:,}, but XCSP3's solvers support at most {MAX_CODE:,}: use a"
            " smaller constant"
        )
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
        tables.append(CodeTable((len(domains),), allowed=True, rows=((constant,),)))
        domains.append((constant,))
    return replace(network, domains=tuple(domains), tables=tuple(tables)), costs
