"""Graphs from files that networkx reads: GraphML, GEXF, GML, Pajek, lists of edges and of neighbours.

networkx is an extra, `robochoc[graphs]`. It only reads: what it draws may differ from one version to the next, so
graphs that a seed stands for are drawn in `generators/graphs.py`.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable
from itertools import chain
from pathlib import Path

from robochoc.formats import Diagnostic, InvalidInputError
from robochoc.generators.draws import MAX_NODES
from robochoc.generators.graphs import Edge, Graph

MAX_BYTES = 16 * 1024 * 1024
MAX_LABEL = 50
READERS = {
    ".graphml": "read_graphml",
    ".gexf": "read_gexf",
    ".gml": "read_gml",
    ".net": "read_pajek",
    ".edgelist": "read_edgelist",
    ".edges": "read_edgelist",
    ".adjlist": "read_adjlist",
}
"""The reader of networkx for each ending of a file's name."""


def read_graph(path: Path) -> Graph:
    """Return the graph in the file `path`. Directions, parallel edges and whatever edges carry do not count.

    Nodes are numbered from 1: as their own numbers are ordered, where all are integers, else as in the file.

    Raises:
        InvalidInputError: if the file is not a valid graph, or networkx is not installed.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise _invalid(path, f"'{path.suffix}' is not a type of graph files", f"supported: {' '.join(READERS)}")
    content = _content(path)
    try:
        import networkx as nx  # noqa: PLC0415 - an extra
    except ImportError:
        raise _invalid(path, "graph files need networkx", "say: pip install 'robochoc[graphs]'") from None
    from io import BytesIO  # noqa: PLC0415 - start-up: only to read a graph

    options = {"data": False} if reader == "read_edgelist" else {}
    try:
        graph = getattr(nx, reader)(BytesIO(content), **options)
        nodes, edges = list(graph.nodes), [(one, other) for one, other, *_ in graph.edges]
    except Exception as error:  # noqa: BLE001 - networkx raises what its parsers raise
        raise _invalid(path, "networkx cannot read it", f"it says: {error}") from None
    numbered = _numbered(nodes)
    if not 1 <= len(nodes) <= MAX_NODES:
        raise _invalid(path, f"a graph of {len(nodes)} nodes", f"it must have from 1 to {MAX_NODES}")
    for one, other in edges:
        if one == other:
            raise _invalid(path, f"the node {one!s:.100} is linked to itself", "a constraint is between two robots")
    known: list[Edge] = sorted({(min(pair), max(pair)) for pair in ((numbered[a], numbered[b]) for a, b in edges)})
    label = re.sub(r"[^A-Za-z0-9_.]+", "-", path.stem)[:MAX_LABEL].strip("-.") or "graph"
    return Graph(len(nodes), label, lambda _: list(known))


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise _invalid(path, str(error.strerror), "name a file that can be read") from None
    if len(content) > MAX_BYTES:
        raise _invalid(path, "it is too large", f"a graph file has at most {MAX_BYTES:,} bytes")
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise _invalid(path, "it defines entities", "delete its document type; GraphML and GEXF need none")
    return content


def _numbered(nodes: Iterable[Hashable]) -> dict[Hashable, int]:
    """Return the number of each node."""
    named = {node: str(node) for node in nodes}
    if all(name.removeprefix("-").isdecimal() and len(name) < 20 for name in named.values()):  # noqa: PLR2004 - 64 bits
        named = dict(sorted(named.items(), key=lambda node: int(node[1])))
    return {node: number for number, node in enumerate(named, 1)}


def _invalid(path: Path, message: str, hint: str) -> InvalidInputError:
    hint = " ".join(chain.from_iterable(part.split() for part in hint.split("\n")))
    return InvalidInputError([Diagnostic(str(path), 0, message, hint[:300])])
