"""A team's whole problem as one XCSP3 file, which ACE, Choco and other solvers read (https://xcsp.org)."""

from __future__ import annotations

from contextlib import nullcontext

from lxml import etree

from robochoc.model.problem import Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.team_network import identifiers, team_network


def xcsp3(team: Team, solver: AceProcess | None = None) -> bytes:
    """Return the merged problem of `team` as an XCSP3-core document: tables over the true values, and allDifferent.

    Variables get names that XCSP3 allows; the attribute `note` says whose variable each is. With costs it is a COP:
    what soft constraints charge are variables too, and their sum is to be minimised. To export many teams, one may
    lend a `solver`. Raises `UnsupportedError`, and `SolverLostError` when pycsp3, which writes it in a process of its
    own, fails.
    """
    network, costs = team_network(team)
    names = list(team.variables)
    charged = [f"cost{number}" for number in range(1, len(costs) + 1)]
    with nullcontext(solver) if solver else AceProcess(java=False) as writer:
        document = writer.export(network, identifiers([*names, *charged]), costs)
    root = etree.fromstring(document, etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True))
    for element, name in zip(root.iterfind("variables/var"), names, strict=False):
        element.set("note", f"{name} of {team.owner[name]}")
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")
