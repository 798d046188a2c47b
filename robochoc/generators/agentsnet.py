"""The tasks of AgentsNet, a benchmark for teams of language-model agents, as constraint problems.

Groetschla, Mueller, Toenshoff, Galkin and Perozzi, "AgentsNet: coordination and collaborative reasoning in multi-agent
LLMs", arXiv 2507.08616 (2025). Each agent is a node of a graph and talks only to its neighbours. The five tasks:

* `coloring`: neighbours are in different groups. There is one group more than the largest number of neighbours.
* `vertex-cover`: at least one robot of each pair of neighbours is a coordinator (value 1). A coordinator costs 1. The
  paper asks for a cover from which no coordinator can be removed; the minimum is one of these.
* `matching`: a robot chooses a neighbour, which chooses this robot, or nobody (value 0). Two neighbours do not both
  choose nobody, so the matching is maximal.
* `leader-election`: all robots choose the same robot as the leader. In a connected graph, exactly one robot then
  chooses itself, as the paper demands.
* `consensus`: all robots choose the same value, 0 or 1.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from itertools import chain
from types import MappingProxyType

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import MAX_VALUES, check_bounds, limited, seeded
from robochoc.generators.graphs import Edge, Graph, links_all
from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.problem import Constraint, Domain, Predicate, ProblemKind, Team, Variable
from robochoc.system.suggestions import member

COVERED = Predicate("covered", ("X", "Y"), parse("ge(add(X, Y), 1)", ("X", "Y"), Type.BOOLEAN))
"""At least one of two robots is a coordinator."""
ONE_COORDINATOR = Predicate("regular", ("X",), parse("eq(X, 0)", ("X",), Type.BOOLEAN))
"""A robot is not a coordinator."""
_TERMS = ("X", "Y", "i", "j")
MATCHED = Predicate(
    "matched",
    _TERMS,
    parse(
        "and(or(ne(X, j), eq(Y, i)), or(ne(Y, i), eq(X, j)), or(ne(X, 0), ne(Y, 0)))",
        _TERMS,
        Type.BOOLEAN,
    ),
)
"""The neighbours i and j choose each other or neither of them chooses the other, and not both choose nobody."""


class Task(StrEnum):
    """The tasks of AgentsNet."""

    COLORING = "coloring"
    VERTEX_COVER = "vertex-cover"
    MATCHING = "matching"
    LEADER_ELECTION = "leader-election"
    CONSENSUS = "consensus"


def agentsnet_on(graph: Graph, task: Task | str, seed: int = 0) -> Team:
    """Return a task of AgentsNet on `graph`. `Robot3` owns `V3`.

    Args:
        graph: The graph of the robots.
        task: The task.
        seed: The same seed gives the same graph on every machine.

    Raises:
        ValueError: The graph is too large for the task, or not connected although the task requires this.
    """
    task = member(Task, "task", task)
    edges = graph.draw(seeded(seed))
    if task in _GLOBAL and not links_all(edges, graph.agents):
        raise ValueError(f"the graph is not connected, but {task} requires it: use another seed or graph")
    values, constraints = _PARTS[task](graph.agents, edges)
    return assemble(
        f"agentsnet-{task}-{graph.agents}-{graph.label}-{seed}{graph.suffix}",
        {f"Robot{number}": [Variable(f"V{number}", values(number))] for number in range(1, graph.agents + 1)},
        limited(constraints),
        kind=ProblemKind.DISWCSP if task == Task.VERTEX_COVER else ProblemKind.DISCSP,
    )


_Parts = tuple[Callable[[int], Domain], Iterable[Constraint]]
"""The domain of each robot, by its number, and the constraints."""


def _coloring(_agents: int, edges: list[Edge]) -> _Parts:
    most = max(Counter(chain.from_iterable(edges)).values(), default=0)
    check_bounds({"neighbours": (most, 0, MAX_VALUES - 1)})
    groups = Domain("Groups", (range(1, most + 2),))
    return lambda _: groups, _on_edges(edges, PREDEFINED["ne"])


def _vertex_cover(agents: int, edges: list[Edge]) -> _Parts:
    choice = Domain("Coordinator", (range(2),))
    single = [(f"V{number}",) for number in range(1, agents + 1)]
    paid = (Constraint("paid", ONE_COORDINATOR, scope, scope, cost=1) for scope in single)
    return lambda _: choice, chain(_on_edges(edges, COVERED), paid)


def _matching(_agents: int, edges: list[Edge]) -> _Parts:
    near: dict[int, list[range]] = {}
    for one, other in edges:
        near.setdefault(one, [range(1)]).append(range(other, other + 1))
        near.setdefault(other, [range(1)]).append(range(one, one + 1))
    constraints = (
        Constraint(f"C{one}.{other}", MATCHED, (f"V{one}", f"V{other}"), (f"V{one}", f"V{other}", one, other))
        for one, other in edges
    )
    return lambda number: Domain(f"Partner{number}", tuple(near.get(number, [range(1)]))), constraints


def _leader_election(agents: int, edges: list[Edge]) -> _Parts:
    check_bounds({"agents": (agents, 1, MAX_VALUES)})
    names = Domain("Leader", (range(1, agents + 1),))
    return lambda _: names, _on_edges(edges, PREDEFINED["eq"])


def _consensus(_agents: int, edges: list[Edge]) -> _Parts:
    values = Domain("Value", (range(2),))
    return lambda _: values, _on_edges(edges, PREDEFINED["eq"])


def _on_edges(edges: list[Edge], predicate: Predicate) -> Iterator[Constraint]:
    for one, other in edges:
        scope = (f"V{one}", f"V{other}")
        yield Constraint(f"C{one}.{other}", predicate, scope, scope)


_GLOBAL = frozenset({Task.LEADER_ELECTION, Task.CONSENSUS})
"""The tasks in which all robots agree, which needs a connected graph."""
_PARTS: Mapping[Task, Callable[[int, list[Edge]], _Parts]] = MappingProxyType(
    {
        Task.COLORING: _coloring,
        Task.VERTEX_COVER: _vertex_cover,
        Task.MATCHING: _matching,
        Task.LEADER_ELECTION: _leader_election,
        Task.CONSENSUS: _consensus,
    }
)
