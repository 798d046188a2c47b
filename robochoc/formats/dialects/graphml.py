"""GraphML: the constraint graph of a team's variables (Brandes et al., "GraphML progress report", GD 2001)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lxml import etree

from robochoc.formats.dialects.constraint_graph import shared_constraints
from robochoc.formats.dialects.dialect import Dialect, ExportOptions, ExportResult, ImportOptions, ImportResult
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError

NAME = "graphml"

_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_KEYS = (("robot", "node", "string"), ("values", "node", "int"), ("constraints", "edge", "int"))


def _write(team: Team, options: ExportOptions) -> ExportResult:
    del options
    root = etree.Element("graphml", xmlns=_NAMESPACE)
    for name, what, kind in _KEYS:
        etree.SubElement(root, "key", {"id": name, "for": what, "attr.name": name, "attr.type": kind})
    graph = etree.SubElement(root, "graph", id=team.name, edgedefault="undirected")
    for variable in team.variables.values():
        node = etree.SubElement(graph, "node", id=variable.name)
        etree.SubElement(node, "data", key="robot").text = team.owner[variable.name]
        etree.SubElement(node, "data", key="values").text = str(len(variable.domain))
    for (one, other), number in shared_constraints(team).items():
        edge = etree.SubElement(graph, "edge", source=one, target=other)
        etree.SubElement(edge, "data", key="constraints").text = str(number)
    body = etree.tostring(root, pretty_print=True, encoding="unicode")
    return ExportResult({f"{team.name}.graphml": f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()})


def _read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    del options
    raise UnsupportedError(f"{paths[0]}: GraphML files can be exported but not imported")


def _recognises(path: Path, beginning: bytes) -> bool:
    del path, beginning
    return False


DIALECT = Dialect(NAME, "GraphML", _recognises, _read, _write)
