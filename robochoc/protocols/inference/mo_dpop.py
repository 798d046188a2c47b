"""Multi-objective DPOP: the Pareto front of two or three objectives.

DPOP (see `dpop.py`) whose tables contain sets of cost vectors: for each combination of values of its separator, a robot
sends its parent all vectors of its subtree that no other one dominates. The root's set is the Pareto front of its tree.
From the root down, each robot then chooses a value for each point of the front.

- **When to use**: several objectives, and a pseudo-tree with a small induced width. With a single cost it finds an
  optimum, as `dpop` does.
- **Guarantees**: complete; it terminates with every point of the front and an assignment for each, or with a proof that
  there is no solution. The team adopts the first point, which is minimal in the first objective, then in the second.
- **Parameters (`--set`)**: `vectors`, the maximum number of vectors in a robot's table (default 100,000): a run that
  needs more ends; `bases`, the number system of packed vectors, set by the run.
- **Reference**: the principle is that of Rollón and Larrosa: "Bucket elimination for multiobjective optimization
  problems", Journal of Heuristics 12, 2006, of Rollón: "Multi-objective optimization in graphical models", PhD thesis,
  2008, and of Matsui, Silaghi, Hirayama, Yokoo, Matsuo: "Distributed search method with
  bounded cost vectors on multiple objective DCOPs", PRIMA 2012. Only their abstracts were found: this is built from the
  principle.

Choices:

- A vector is a single integer, the packed cost (`model/objectives.py`), so a robot's problem is an ordinary one.
- A table has the values of the separator as axes, in priority order, and lists its vectors in ascending order. Vectors
  with equal costs count once: each point of the front has one assignment.
- The separator contains only robots that share a constraint with a robot in the subtree. Its size is not known to be
  within the limits before tables are made, since the number of vectors depends on the costs.
- The values of a point are found from the root down: each robot adds up its children's tables again, and takes the
  first value and the first vectors of its children that add up to the point.
- Unconnected parts have a root each. The run adds up their fronts.
- The front is checked against the files; its points are the first `ListedPoints` of the robots.

>>> from robochoc.generators.random_csp import random_csp
>>> from robochoc.run import Options, Runtime, solve
>>> solve(random_csp(6, 3, 0.5, 0.2), Options(protocol="mo-dpop", runtime=Runtime.SIMULATOR)).verdict.value
'solution'
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, ClassVar, NamedTuple, assert_never, cast

import msgspec

from robochoc.model.objectives import added, non_dominated
from robochoc.model.outcome import Verdict
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import NOTHING, HasValue, Proof, Reception, table_proves
from robochoc.protocols.findings import Findings, ListedPoints
from robochoc.protocols.inference.dpop import MOST_CELLS, Domain, store_once
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.encoding import Cost
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted, listed

MOST_VECTORS = 400_000
"""The largest number of vectors in a table. A table is one message, of at most 9 bytes for each vector."""
ADDITIONS = 100
"""The maximum number of additions of vectors for a value in a cell, as a multiple of the maximum of vectors."""


class MODPOPSettings(Settings, frozen=True):
    """`vectors`: the maximum number of cost vectors in a robot's table. `bases`: of packed vectors, set by the run."""

    vectors: int = 100_000
    bases: str = ""

    def __post_init__(self) -> None:
        if not 1 <= self.vectors <= MOST_VECTORS:
            raise ValueError(f"vectors is {self.vectors}; it must be from 1 to {MOST_VECTORS:,}")
        parts = self.bases.split(",") if self.bases else []
        if len(parts) > 2 or not all(one.isascii() and one.isdecimal() and 0 < int(one[:19]) < 2**62 for one in parts):  # noqa: PLR2004
            raise ValueError(f"bases is {self.bases[:40]!r}; it must be up to two positive integers: 1001,201")

    @property
    def all_bases(self) -> tuple[int, ...]:
        """The bases as numbers."""
        return tuple(map(int, self.bases.split(","))) if self.bases else ()


Size = Annotated[int, msgspec.Meta(ge=1)]
Packed = Annotated[int, msgspec.Meta(ge=0)]
Place = Annotated[int, msgspec.Meta(ge=0)]


class Fronts(Message, frozen=True):
    """The sender's table: the non-dominated cost vectors of its subtree.

    `axes` are the robots of its separator with the numbers of their values. `cells` has the packed vectors for each
    combination of these values, the last axis first.
    """

    axes: dict[str, Size]
    cells: list[list[Packed]]

    act = Act(Performative.INFORM, "the receiver learns the non-dominated costs of the sender's subtree")

    def in_words(self, _: Wording) -> str:
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in self.axes.items()])
        vectors = counted(sum(map(len, self.cells)), "cost vector")
        return f"{vectors} of my subtree, in a table{' over ' if axes else ''}{axes}"

    def proves(self, reception: Reception) -> Sequence[Proof] | None:
        """Return the bounds on the sender's packed costs, as in DPOP: the first vector of a cell is the least."""
        if len(self.cells) != math.prod(self.axes.values()) or len(self.cells) > MOST_CELLS:
            return None
        least = [cell[0] if cell else math.inf for cell in self.cells]
        return table_proves([*self.axes], zip(_places(self.axes), least, strict=True), reception)


class Points(Message, frozen=True):
    """For each point of the front, the values in the receiver's separator, and the receiver's vector.

    `assignments` are the values as indices, in the order of the axes. `vectors` are the packed costs of its subtree.
    """

    assignments: list[list[Place]]
    vectors: list[Packed]

    act = Act(Performative.INFORM, "the receiver learns the values above it in each point of the front")

    def in_words(self, _: Wording) -> str:
        different = counted(len({*map(tuple, self.assignments)}), "combination")
        points = counted(len(self.vectors), "point")
        return f"{points} of the front, with {different} of values of the robots in your separator"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the values in the first point, which the team adopts."""
        table = reception.last(Fronts, reception.receiver, reception.sender)
        if table is None:
            return NOTHING  # received in another epoch
        known = [
            (robot, reception.values(robot), at) for robot, at in zip(table.axes, self.assignments[0], strict=True)
        ]
        return [HasValue(robot, values[at]) for robot, values, at in known if values is not None]


def _places(axes: Mapping[str, int]) -> Iterator[tuple[int, ...]]:
    """Yield the combinations of values on these axes, as indices, in the order of a table's cells."""
    return itertools.product(*map(range, axes.values()))


class _Table(NamedTuple):
    """A child's table: its axes with their sizes, and the vectors of each cell."""

    axes: Mapping[str, int]
    cells: Sequence[Sequence[int]]

    def at(self, places: Mapping[str, int]) -> Sequence[int]:
        """Return the vectors for the values at these `places`."""
        index = 0
        for name, size in self.axes.items():
            index = index * size + places[name]
        return self.cells[index]


class MODPOP(TreeProtocol):
    """One agent of multi-objective DPOP.

    State besides the position in the tree:

    - `domains`: the values of the robots above that share a constraint with this robot;
    - `tables`: the children's tables;
    - `axes`: the robots of this robot's separator, with the numbers of their values, once its table is made;
    - `front`: as a root, the packed vectors of the front of its tree;
    - `listed`: the index of this robot's value in each point of the front.
    """

    messages = TreeMessage | Domain | Fronts | Points
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Rollón 2008",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tree=True,
        wide_tables=True,
        fronts=True,
        privacy="constraints of others, but for sums",
        use_when="several objectives: the Pareto front, small induced width",
    )
    settings: ClassVar[MODPOPSettings] = MODPOPSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.domains: dict[str, list[Value]] = {}
        self.tables: dict[str, _Table] = {}
        self.axes: dict[str, int] | None = None
        self.front: list[int] | None = None
        self.listed: list[int] | None = None

    def start_in_tree(self) -> None:
        """Send the domain to the neighbours below."""
        for name in self.descendants:
            self.send(name, Domain(list(self.problem.values)))
        self._make_table()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | Fronts | Points", message):
            case Domain(values):
                store_once(sender, values, self.domains, self.ancestors)
                self._make_table()
            case Fronts(axes, cells):
                if len(cells) != math.prod(axes.values()):
                    raise ValueError(f"a table over {', '.join(axes)} has {len(cells):,} cells")
                store_once(sender, _Table(axes, cells), self.tables, self.children)
                self._make_table()
            case Points(assignments, vectors):
                self._points_handler(assignments, vectors)
            case never:
                assert_never(never)

    @property
    def findings(self) -> Findings:
        """The position in the tree, and the points of the front; for a root also its optimum and the vectors."""
        points = None if self.listed is None else ListedPoints(self.listed, self.front or [])
        bound = self.front[0] if self.front else None
        return msgspec.structs.replace(super().findings, bound=bound, points=points)

    # Tables, from the leaves up

    def _make_table(self) -> None:
        """Make this robot's table, once all domains and tables have arrived; send it, or begin to choose as a root."""
        if len(self.domains) < len(self.ancestors) or len(self.tables) < len(self.children):
            return
        self.axes = self._separator()
        cells = math.prod(self.axes.values())
        self._refuse_excess(cells)
        charged = _Costs(self)
        table: list[list[int]] = []
        vectors = 0
        for places in self._combinations():
            table.append(self._cell(charged.at(places), places))
            vectors += len(table[-1])
            self._refuse_excess(vectors)
        if not vectors:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.parent is not None:
            self.send(self.parent, Fronts(self.axes, table))
        else:
            self.front = table[0]
            self._choose([[]] * len(self.front), self.front)

    def _separator(self) -> dict[str, int]:
        """Return the axes of this robot's table: the robots above that matter to its subtree, by priority."""
        checked = {name for scope in self.problem.scopes_in_tables(self.ancestors) for name in scope.agents}
        sizes = {name: len(self.domains[name]) for name in checked}
        for child, table in self.tables.items():
            for name, size in table.axes.items():
                known = len(self.problem.values) if name == self.problem.agent else sizes.setdefault(name, size)
                if size != known:
                    raise ValueError(f"{child}'s table has {size} values of {name}, which has {known}")
        sizes.pop(self.problem.agent, None)
        return {name: sizes[name] for name in sorted(sizes, key=self.order.rank.__getitem__)}

    def _combinations(self) -> Iterator[dict[str, int]]:
        """Yield the combinations of the values of the separator, as indices, in the order of the table's cells."""
        axes = self.axes or {}
        for places in _places(axes):
            yield dict(zip(axes, places, strict=True))

    def _cell(self, costs: Sequence[Cost], places: Mapping[str, int]) -> list[int]:
        """Return the non-dominated vectors of the subtree for the values at these `places`."""
        found: list[int] = []
        for own, cost in enumerate(costs):
            if cost < math.inf:
                found += self._sums([[int(cost)], *self._fronts_below(own, places)])
        return non_dominated(found, self.settings.all_bases)

    def _fronts_below(self, own: int, places: Mapping[str, int]) -> list[Sequence[int]]:
        """Return the vectors of each child for these values above it."""
        view = {**places, self.problem.agent: own}
        return [self.tables[child].at(view) for child in self.children]

    def _sums(self, fronts: Sequence[Sequence[int]]) -> list[int]:
        """Return the non-dominated sums of one vector from each of `fronts`. Raises `TooLargeError`."""
        sums = added(fronts, self.settings.all_bases, ADDITIONS * self.settings.vectors)
        if sums is None:
            self._refuse_excess(self.settings.vectors + 1)
        return sums or []

    def _refuse_excess(self, vectors: int) -> None:
        most = self.settings.vectors
        if vectors > most:
            raise TooLargeError(
                f"the table of {self.problem.agent} has more than {most:,} cost vectors or cells;"
                f" --set vectors=N raises the limit, up to {MOST_VECTORS:,}"
            )

    # Points, from the root down

    def _points_handler(self, assignments: Sequence[Sequence[int]], vectors: Sequence[int]) -> None:
        """Process the points of the front. Raises `ValueError` if they are invalid or unexpected."""
        if self.axes is None or self.listed is not None or self.parent is None:
            raise ValueError(f"{self.problem.agent} already has values, or has no table yet")
        if not 0 < len(assignments) == len(vectors):
            raise ValueError(
                f"{len(assignments):,} combinations of values, {len(vectors):,} vectors: both must be equal"
            )
        sizes = [*self.axes.values()]
        for one in assignments:
            if len(one) != len(sizes) or any(place >= size for place, size in zip(one, sizes, strict=True)):
                raise ValueError(f"{one} are not values of {', '.join(self.axes)}")
        self._choose(assignments, vectors)

    def _choose(self, assignments: Sequence[Sequence[int]], vectors: Sequence[int]) -> None:
        """Choose this robot's value in each point, and send the children their vectors."""
        axes = self.axes or {}
        views = [dict(zip(axes, one, strict=True)) for one in assignments]
        charged = _Costs(self)
        chosen = [self._decompose(charged.at(view), view, vector) for view, vector in zip(views, vectors, strict=True)]
        self.listed = [own for own, _ in chosen]
        self.value = self.listed[0]
        for number, child in enumerate(self.children):
            below = [{**view, self.problem.agent: own} for view, own in zip(views, self.listed, strict=True)]
            places = [[one[name] for name in self.tables[child].axes] for one in below]
            self.send(child, Points(places, [parts[number] for _, parts in chosen]))
        self.tables = {}

    def _decompose(self, costs: Sequence[Cost], places: Mapping[str, int], vector: int) -> tuple[int, list[int]]:
        """Return the first value, and a vector of each child, that add up to `vector`."""
        for own, cost in enumerate(costs):
            if cost <= vector:
                parts = self._parts(vector - int(cost), self._fronts_below(own, places))
                if parts is not None:
                    return own, parts
        raise ValueError(f"no value of {self.problem.agent} costs {vector}: its table contradicts its parent's message")

    def _parts(self, vector: int, fronts: Sequence[Sequence[int]]) -> list[int] | None:
        """Return one of each of `fronts` that add up to `vector`; None if there are none.

        Sums of the first fronts that are dominated cannot be part of a vector that no other one dominates.
        """
        if not fronts:
            return None if vector else []
        if len(fronts) == 1:
            return [vector] if vector in {*fronts[0]} else None
        *others, last = fronts
        sums = {*self._sums(others)}
        for part in last:
            if vector - part in sums:
                before = self._parts(vector - part, others)
                if before is not None:
                    return [*before, part]
        return None


class _Costs:
    """The costs of a robot's values, for values of the robots above. Each combination is evaluated once."""

    def __init__(self, robot: MODPOP) -> None:
        self._problem = robot.problem
        self._domains = robot.domains
        self._known: dict[tuple[int, ...], list[Cost]] = {}
        scopes = robot.problem.scopes_in_tables(robot.ancestors)
        self._robots = sorted({name for scope in scopes for name in scope.agents})

    def at(self, places: Mapping[str, int]) -> list[Cost]:
        """Return the cost of each own value: private, and in the constraints with the robots above."""
        key = tuple([places[name] for name in self._robots])
        if key not in self._known:
            view = {name: self._domains[name][place] for name, place in zip(self._robots, key, strict=True)}
            self._known[key] = self._problem.costs(view)
        return self._known[key]
