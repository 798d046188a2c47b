"""A constraint graph by the name of its kind, or from a file, with the parameters that this kind has."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path

from robochoc.generators import graphs
from robochoc.generators.graph_files import read_graph
from robochoc.generators.graphs import Graph, GraphKind

KINDS = tuple(map(str, GraphKind))
_KINDS_OF = {
    "links": (GraphKind.SCALE_FREE,),
    "neighbours": (GraphKind.SMALL_WORLD,),
    "rewiring": (GraphKind.SMALL_WORLD,),
    "rows": (GraphKind.GRID,),
    "torus": (GraphKind.GRID,),
    "connected": (GraphKind.RANDOM, GraphKind.SMALL_WORLD),
}
"""Parameters of some kinds of graphs alone."""


@dataclass(frozen=True, kw_only=True)
class GraphChoice:
    """The wanted graph.

    Attributes:
        kind: One of `KINDS`, or the path of a file.
        agents: The number of robots. None: there are as many as the file has nodes.
        links: scale-free: links of a new node.
        neighbours: small-world: the nearest nodes that each is linked with.
        rewiring: small-world: the share of edges that are moved.
        rows: grid: the number of rows. None: nearest to a square.
        torus: grid: whether the borders meet.
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
        """Return the graph. None: it is a random one, which the family draws.

        Args:
            density_name: What the family calls the density of its random graphs.
            density: The given density.
            dashes: What users write before the name of a parameter.

        Raises:
            ValueError: if a parameter is missing, or has nothing to say about this graph.
            InvalidInputError: if the file holds no graph.
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
                raise ValueError(f"{dashes}{density_name} is missing (without {dashes}graph)")
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
            case _:
                return graphs.tree(agents)

    def _refuse_agents(self, dashes: str) -> None:
        """Raise `ValueError` if the file does not exist, or `agents` are given too."""
        if not Path(self.kind).exists():
            near = difflib.get_close_matches(self.kind, KINDS, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{dashes}graph {self.kind!r} is none of {', '.join(KINDS)}, and no file{hint}")
        if self.agents is not None:
            raise ValueError(f"{dashes}agents follows from the graph in the file; leave it out")
