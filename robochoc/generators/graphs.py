"""Random constraint graphs: uniform, scale-free, small worlds, grids and trees.

networkx is not used, since its random graphs may differ between versions.

* `uniform`: a given number of edges; all such graphs are equally likely (Model B; `random_csp`).
* `scale_free`: Barabasi and Albert, "Emergence of scaling in random networks", Science 286 (1999).
* `small_world`: Watts and Strogatz, "Collective dynamics of 'small-world' networks", Nature 393 (1998).
* `grid`: four neighbours each; in a torus, opposite borders are joined. Used by Ising models (`generators/ising.py`).
* `delaunay`: triangulations of random points (`generators/delaunay.py`).
* `tree`: all trees with numbered nodes are equally likely, by Pruefer sequences (Cayley's n**(n-2) trees).
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterable, Iterator
from enum import StrEnum
from math import isqrt
from random import Random

from robochoc.generators.draws import MAX_EDGES, MAX_NODES, check_bounds, sample
from robochoc.system.lazy_dataclass import dataclass

MAX_GRAPH_DRAWS = 1000
"""The maximum number of graphs that are drawn to find a connected one."""

Edge = tuple[int, int]
"""The numbers of two robots, from 1, the smaller number first."""


class GraphKind(StrEnum):
    """The kinds of random graphs."""

    RANDOM = "random"
    SCALE_FREE = "scale-free"
    SMALL_WORLD = "small-world"
    GRID = "grid"
    TREE = "tree"
    DELAUNAY = "delaunay"


@dataclass(frozen=True)
class Graph:
    """A graph to be drawn.

    Attributes:
        agents: The number of nodes.
        label: The name of the graph in a team's name.
        draw: Returns the edges, in ascending order.
        suffix: The end of a team's name.
    """

    agents: int
    label: str
    draw: Callable[[Random], list[Edge]]
    suffix: str = ""


def uniform(agents: int, edges: int, label: str, *, connected: bool = False) -> Graph:
    """Return a uniformly random graph with `edges` edges; if `connected`, graphs are drawn until one is connected.

    Raises:
        ValueError: There are more than `MAX_EDGES` edges.
    """
    check_bounds({"constraints": (edges, 0, MAX_EDGES)})

    def draw(chance: Random) -> list[Edge]:
        return random_graph(chance, agents, edges, connected=connected)

    return Graph(agents, label, draw, "-connected" * connected)


def scale_free(agents: int, links: int = 2) -> Graph:
    """Return a connected scale-free graph with links * (agents - links) edges.

    The first `links` nodes are not linked to each other. The next node is linked to all of them; each later node is
    linked to `links` existing nodes, with probabilities proportional to their numbers of links.

    Raises:
        ValueError: `links` is not from 1 to agents - 1.
    """
    check_bounds({"agents": (agents, 2, MAX_NODES), "links": (links, 1, agents - 1)})
    check_bounds({"constraints": (links * (agents - links), 1, MAX_EDGES)})

    def draw(chance: Random) -> list[Edge]:
        edges = []
        ends: list[int] = []
        """Each node, repeated for each of its links."""
        chosen: Collection[int] = range(1, links + 1)
        for new in range(links + 1, agents + 1):
            edges += [(old, new) for old in chosen]
            ends += [*sorted(chosen), *[new] * links]
            chosen = set()
            while len(chosen) < links:
                chosen.add(ends[int(chance.random() * len(ends))])
        return sorted(edges)

    return Graph(agents, f"scale-free{links}", draw)


def small_world(agents: int, neighbours: int = 4, rewiring: float = 0.1, *, connected: bool = False) -> Graph:
    """Return a small-world graph with agents * neighbours / 2 edges.

    In a ring, each node is linked to its `neighbours` nearest nodes; then the far end of each edge is moved, with the
    probability `rewiring`, to a node that is not yet linked to the near end.

    Args:
        agents: The number of nodes.
        neighbours: The number of nearest nodes; even.
        rewiring: The probability that an edge is moved; 0 leaves the ring.
        connected: True if graphs are drawn until one is connected.

    Raises:
        ValueError: `neighbours` is odd, or more than the number of other nodes.
    """
    check_bounds({"agents": (agents, 3, MAX_NODES), "neighbours": (neighbours, 2, agents - 1)})
    check_bounds({"rewiring": (rewiring, 0, 1), "constraints": (agents * neighbours // 2, 1, MAX_EDGES)})
    if neighbours % 2:
        raise ValueError(f"neighbours is {neighbours}; it must be even: half of them on either side of the ring")

    def draw(chance: Random) -> list[Edge]:
        return _until_connected(lambda: _rewired_ring(chance, agents, neighbours, rewiring), agents, connected)

    return Graph(agents, f"small-world{neighbours}-{float(rewiring)}", draw, "-connected" * connected)


def _rewired_ring(chance: Random, agents: int, neighbours: int, rewiring: float) -> list[Edge]:
    near: list[set[int]] = [set() for _ in range(agents)]
    rings = [(node, (node + far) % agents) for far in range(1, neighbours // 2 + 1) for node in range(agents)]
    for node, other in rings:
        near[node].add(other)
        near[other].add(node)
    for node, other in rings:
        if chance.random() < rewiring and len(near[node]) < agents - 1:
            linked = sorted((node, *near[node]))
            new = _other_than(linked, int(chance.random() * (agents - len(linked))))
            near[node].remove(other)
            near[other].remove(node)
            near[node].add(new)
            near[new].add(node)
    return [(node + 1, other + 1) for node in range(agents) for other in sorted(near[node]) if node < other]


def _other_than(taken: Iterable[int], place: int) -> int:
    """Return the number at index `place` among all numbers from 0 that are not in `taken`, which is ascending."""
    for one in taken:
        if one > place:
            break
        place += 1
    return place


def grid(rows: int, columns: int, *, torus: bool = False) -> Graph:
    """Return a grid, numbered row by row. In a `torus`, the last row is next to the first row; so are the columns."""
    check_bounds({"rows": (rows, 1, MAX_NODES), "columns": (columns, 1, MAX_NODES)})
    check_bounds({"agents": (rows * columns, 1, MAX_NODES)})
    edges = grid_edges(rows, columns, torus=torus)
    return Graph(rows * columns, f"{'torus' if torus else 'grid'}{rows}x{columns}", lambda _: list(edges))


def grid_edges(rows: int, columns: int, *, torus: bool) -> list[Edge]:
    """Return the edges of a grid whose nodes are numbered row by row, in ascending order."""
    edges = set()
    for row in range(rows):
        for column in range(columns):
            for down, right in ((row + 1, column), (row, column + 1)):
                if torus or (down < rows and right < columns):
                    one, other = row * columns + column, down % rows * columns + right % columns
                    edges.add((min(one, other) + 1, max(one, other) + 1))
    return sorted(edge for edge in edges if edge[0] != edge[1])


def nearest_to_a_square(agents: int) -> int:
    """Return the number of rows, at most the number of columns, in the most nearly square grid with `agents` nodes."""
    return next(rows for rows in range(isqrt(agents), 0, -1) if agents % rows == 0)


def tree(agents: int) -> Graph:
    """Return a random tree, with agents - 1 edges."""
    check_bounds({"agents": (agents, 1, MAX_NODES)})

    def draw(chance: Random) -> list[Edge]:
        sequence = [int(chance.random() * agents) + 1 for _ in range(agents - 2)]
        return _tree_of(sequence, agents)

    return Graph(agents, "tree", draw)


def _tree_of(sequence: list[int], agents: int) -> list[Edge]:
    """Return the tree of a Pruefer sequence."""
    missing = [0] * (agents + 1)
    """The number of occurrences of each node in the rest of the sequence."""
    for node in sequence:
        missing[node] += 1
    edges = []
    waiting = [node for node in range(1, agents + 1) if not missing[node]]  # ascending, so it is a heap
    for node in sequence:
        leaf = heapq.heappop(waiting)
        edges.append((min(leaf, node), max(leaf, node)))
        missing[node] -= 1
        if not missing[node]:
            heapq.heappush(waiting, node)
    if agents > 1:
        one, other = sorted(waiting)
        edges.append((one, other))
    return sorted(edges)


def random_graph(chance: Random, agents: int, count: int, *, connected: bool = False) -> list[Edge]:
    """Return `count` pairs of robots, chosen uniformly at random, in ascending order; see `random_csp`."""
    if connected and count < agents - 1:
        raise ValueError(
            f"a connected graph of {agents} robots needs {agents - 1} constraints, and the density makes {count}"
        )
    return _until_connected(lambda: _edges(chance, agents, count), agents, connected)


def _edges(chance: Random, agents: int, count: int) -> list[Edge]:
    """Return `count` pairs of robots, in ascending order."""
    return list(_pairs_at(sample(chance, agents * (agents - 1) // 2, count), agents))


def _pairs_at(places: Iterable[int], agents: int) -> Iterator[Edge]:
    """Yield the pairs at the ascending indices `places` in the ascending list of all pairs of robots."""
    higher, first = 1, 0
    for place in places:
        while place - first >= agents - higher:
            first += agents - higher
            higher += 1
        yield higher, higher + 1 + place - first


def _until_connected(draw: Callable[[], list[Edge]], agents: int, wanted: bool) -> list[Edge]:  # noqa: FBT001 - a fact
    """Return the first connected graph if this is `wanted`, else the first graph.

    Raises `ValueError` after `MAX_GRAPH_DRAWS` graphs.
    """
    for _ in range(MAX_GRAPH_DRAWS):
        edges = draw()
        if not wanted or links_all(edges, agents):
            return edges
    raise ValueError(
        f"none of {MAX_GRAPH_DRAWS:,} graphs of {agents} robots and {len(edges)} constraints was connected;"
        " increase the density"
    )


def links_all(edges: Iterable[Edge], agents: int) -> bool:
    """Return whether `edges` connect all robots."""
    near: dict[int, list[int]] = {number: [] for number in range(1, agents + 1)}
    for one, other in edges:
        near[one].append(other)
        near[other].append(one)
    met = {1}
    waiting = [1]
    while waiting:
        new = [number for number in near[waiting.pop()] if number not in met]
        met.update(new)
        waiting += new
    return len(met) == agents
