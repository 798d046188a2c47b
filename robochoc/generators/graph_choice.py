"""Chooses a constraint graph: from a random family, with its parameters, or from a file that networkx reads.

File formats are GraphML, GEXF, GML, Pajek, edge lists and adjacency lists. networkx is an extra, `robochoc[graphs]`. It
is only used for files: random graphs are drawn by `generators/graphs.py`, since those of networkx may differ between
versions.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Hashable, Iterable
from itertools import chain
from pathlib import Path

from robochoc.formats import Diagnostic, InvalidInputError
from robochoc.generators import graphs
from robochoc.generators.delaunay import delaunay
from robochoc.generators.draws import MAX_NODES
from robochoc.generators.graphs import Edge, Graph, GraphKind
from robochoc.system.lazy_dataclass import dataclass

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
"""The networkx reader for each file name extension."""


KINDS = tuple(map(str, GraphKind))
_KINDS_OF = {
    "links": (GraphKind.SCALE_FREE,),
    "neighbours": (GraphKind.SMALL_WORLD,),
    "rewiring": (GraphKind.SMALL_WORLD,),
    "rows": (GraphKind.GRID,),
    "torus": (GraphKind.GRID,),
    "connected": (GraphKind.RANDOM, GraphKind.SMALL_WORLD),
}
"""The parameters of only some kinds of graphs."""


@dataclass(frozen=True, kw_only=True)
class GraphChoice:
    """The kind and the parameters of a graph.

    Attributes:
        kind: One of `KINDS`, or the path of a file.
        agents: The number of robots. None: the number of nodes in the file.
        links: scale-free: the number of links of a new node.
        neighbours: small-world: the number of nearest nodes to which each node is linked.
        rewiring: small-world: the fraction of edges that are moved.
        rows: grid: the number of rows. None: as nearly square as possible.
        torus: grid: whether opposite borders are joined.
        connected: random, small-world: whether graphs are drawn until one is connected.
    """

    kind: str = GraphKind.RANDOM
    agents: int | None = None
    links: int | None = None
    neighbours: int | None = None
    rewiring: float | None = None
    rows: int | None = None
    torus: bool = False
    connected: bool = False

    def graph(self, density_name: str, density: float | None, dashes: str = "") -> Graph | None:
        """Return the graph; None for a uniform random graph, which the family draws.

        Args:
            density_name: The family's name for the density of its random graphs.
            density: The given density.
            dashes: The prefix of parameters in messages: `--` on the command line.

        Raises:
            ValueError: A parameter is missing, or does not apply to this graph.
            InvalidInputError: The file is not a valid graph.
        """
        for name, kinds in _KINDS_OF.items():
            if getattr(self, name) not in {None, False} and self.kind not in kinds:
                raise ValueError(f"{dashes}{name} is for {dashes}graph {' or '.join(kinds)}, not for {self.kind}")
        if self.kind not in KINDS:
            self._refuse_agents(dashes)
        elif self.agents is None:
            raise ValueError(f"{dashes}agents is missing")
        if self.kind == GraphKind.RANDOM:
            if density is None:
                raise ValueError(f"{dashes}{density_name} is missing (required for {dashes}graph random)")
            return None
        if density is not None:
            why = f"of {self.kind} it follows from the other parameters"
            raise ValueError(f"{dashes}{density_name} is for {dashes}graph random; {why}")
        return read_graph(Path(self.kind)) if self.agents is None else self._drawn(self.agents, dashes)

    def _drawn(self, agents: int, dashes: str) -> Graph:
        match self.kind:
            case GraphKind.SCALE_FREE:
                return graphs.scale_free(agents, self.links or 2)
            case GraphKind.SMALL_WORLD:
                rewiring = 0.1 if self.rewiring is None else self.rewiring
                return graphs.small_world(agents, self.neighbours or 4, rewiring, connected=self.connected)
            case GraphKind.GRID:
                rows = self.rows or graphs.nearest_to_a_square(agents)
                if agents % rows:
                    change = f"change {dashes}agents or {dashes}rows"
                    raise ValueError(f"{agents} robots do not fill {rows} rows; {change}")
                return graphs.grid(rows, agents // rows, torus=self.torus)
            case GraphKind.DELAUNAY:
                return delaunay(agents)
            case _:
                return graphs.tree(agents)

    def _refuse_agents(self, dashes: str) -> None:
        """Raise `ValueError` if the file does not exist, or if `agents` is also given."""
        if not Path(self.kind).exists():
            near = difflib.get_close_matches(self.kind, KINDS, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{dashes}graph {self.kind!r} is not one of {', '.join(KINDS)}, nor a file{hint}")
        if self.agents is not None:
            raise ValueError(f"{dashes}agents follows from the graph in the file; leave it out")


# Graphs in files


def read_graph(path: Path) -> Graph:
    """Return the graph in the file `path`. Directions, parallel edges and attributes of edges are ignored.

    Nodes are numbered from 1, in ascending order if all their names are integers, otherwise in the order of the file.

    Raises:
        InvalidInputError: The file is not a valid graph, or networkx is not installed.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise _invalid(path, f"'{path.suffix}' is not a type of graph files", f"supported: {' '.join(READERS)}")
    content = _content(path)
    try:
        import networkx as nx  # noqa: PLC0415 - an extra
    except ImportError:
        raise _invalid(path, "graph files require networkx", "run: pip install 'robochoc[graphs]'") from None
    from io import BytesIO  # noqa: PLC0415 - start-up: only to read a graph

    options = {"data": False} if reader == "read_edgelist" else {}
    try:
        graph = getattr(nx, reader)(BytesIO(content), **options)
        nodes, edges = list(graph.nodes), [(one, other) for one, other, *_ in graph.edges]
    except Exception as error:  # noqa: BLE001 - networkx raises what its parsers raise
        raise _invalid(path, "networkx cannot read it", f"correct the file: {error}") from None
    numbered = _numbered(nodes)
    if not 1 <= len(nodes) <= MAX_NODES:
        raise _invalid(path, f"the graph has {len(nodes)} nodes", f"it must have from 1 to {MAX_NODES}")
    for one, other in edges:
        if one == other:
            raise _invalid(path, f"the node {one!s:.100} is linked to itself", "delete this edge")
    known: list[Edge] = sorted({(min(pair), max(pair)) for pair in ((numbered[a], numbered[b]) for a, b in edges)})
    label = re.sub(r"[^A-Za-z0-9_.]+", "-", path.stem)[:MAX_LABEL].strip("-.") or "graph"
    return Graph(len(nodes), label, lambda _: list(known))


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise _invalid(path, f"cannot be read: {error.strerror}", "check the path and its permissions") from None
    if len(content) > MAX_BYTES:
        raise _invalid(path, "is too large", f"use a file of at most {MAX_BYTES:,} bytes")
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise _invalid(path, "defines entities", "delete the document type: GraphML and GEXF need none")
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
