"""Refined memory-bounded DPOP (RMB-DPOP).

MB-DPOP (see `mb_dpop.py`), with fewer and smaller enumerations. A *cluster* consists of neighbouring robots in the tree
whose separators have more than `k` robots; the robot above it is its *cluster root*. Robots are cut (fixed) one by one,
so that each cut relieves as many robots in the cluster as possible. A cut robot within the cluster enumerates its own
values, for its own branch; the cluster root enumerates the values of the others. So branches work at the same time, and
each receives only the values that it needs.

- **When to use**: costs, on a pseudo-tree too wide for `dpop`, as `mb-dpop`. If `k` is at least the induced width, it
  is the same as DPOP.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. No table that is
  sent has more than `k` dimensions. The number of messages is exponential in the cut robots of a branch.
- **Parameters (`--set`)**: `k`, the maximum number of dimensions of a table (default 4); `memory` and `disk` as in
  MB-DPOP.
- **Reference**: Chen, Zhang, Deng, Chen, Li: "RMB-DPOP: refining MB-DPOP by reducing redundant inferences", AAMAS 2020.

The messages and mechanisms of the paper are these methods:

    LABEL, SEP_DEGREE    `_announce_dimensions`    CONTEXT, distributed enumeration    `_start_context`
    ALLOCATION           `_allocate`               cache of a child's table            `_request_tables`
    UTIL                 `_compute_utils`          CC_VALUE                            `_apply_cut_values`

How cut robots are chosen in a cluster:

- A robot whose separator has more than `k` robots that are not cut yet proposes all of these. Proposals go up, and are
  added up for each candidate. If candidates are not above a robot, it sends on only the best of them.
- The cluster root chooses the candidate that relieves the most robots; in case of ties, the one nearest to the lowest
  robot that it relieves. Then it asks again, until there are no more proposals.

Choices that the paper leaves open, and differences:

- Only branches that proposed a robot learn that it is cut. If tables in a branch are small enough already, the robot
  remains an axis there.
- A table goes up with the best values of the cut robots below, for each cell (`CutUTIL`). In the end they are sent down
  once (`CutValue`), so that the whole cluster chooses under them. A branch without cut robots, whose last context had
  the same values, is not asked.
- Separators, and so memory needs, are known bottom-up, as in `mb_dpop.py`, before any table is made.
- When a cluster root enumerates, the robots on which the fewest children depend change fastest.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(3), Options(protocol="rmb-dpop", runtime=Runtime.SIMULATOR, settings={"k": "2"}))
>>> outcome.verdict.value
'no-solution'
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, assert_never, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.inference.dpop import MOST_AXES, UTIL, VALUE, Cost, Dimensions, Need, Proceed, Size, store_once
from robochoc.protocols.inference.dpop_tables import (
    PIECE,
    Codes,
    Extent,
    Projection,
    Table,
    Width,
    aligned,
    blocks_of,
    empty_table,
    packed_costs,
    piece_in_words,
    place_type,
    release,
    width_of,
)
from robochoc.protocols.inference.mb_dpop import MBDPOP, Context, Depth, DomainAtDepth, SeparatorAxis, Sizes, is_place
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted, listed


class Candidate(msgspec.Struct, frozen=True, array_like=True):
    """A robot that may be cut: the size of its domain, its depth, and the robots that cutting it would relieve.

    `relieved` is the number of robots whose separator is too large and contains it; `lowest` is the depth of the lowest
    of them.
    """

    size: Size
    depth: Depth
    relieved: Annotated[int, msgspec.Meta(ge=1)]
    lowest: Depth


class ClusterLabel(Message, frozen=True):
    """The sender's separator; if it is too large, also the robots that may be cut for the sender and its cluster below.

    `dearest`, `induced_width` and `most` are as in DPOP's `Dimensions`.
    """

    separator: dict[str, SeparatorAxis]
    candidates: dict[str, Candidate]
    dearest: Cost
    induced_width: int
    most: Need

    act = Act(Performative.INFORM, "the receiver learns the sender's separator, and the robots that may be fixed")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        sizes = {name: axis.size for name, axis in self.separator.items()}
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in sizes.items()])
        cells = counted(math.prod(sizes.values()), "cell")
        over = " over " if axes else ""
        table = f"my table has {cells}{over}{axes}, and no cost above {cost_text(self.dearest)}"
        return f"{table}; {_in_words(self.candidates)}" if self.candidates else table


class SepDegree(Message, frozen=True):
    """The robots that may still be cut for the cluster below; `most` is the largest memory need there at present."""

    candidates: dict[str, Candidate]
    most: Need

    act = Act(Performative.INFORM, "the receiver learns which other robots may be fixed")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return _in_words(self.candidates) if self.candidates else "from me down, all tables are small enough"


class Allocation(Message, frozen=True):
    """The cluster root's choice: `robot` is cut, and fixed for the tables that are too large because of it."""

    robot: str

    act = Act(Performative.REQUEST, "the receiver makes its tables for fixed values of one more robot")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"{self.robot} will be fixed; who else may be?"


class CutUTIL(Message, frozen=True):
    """A piece of the sender's table, as in UTIL, with the best values of the cut robots from the sender down.

    `places` has a row for each of these robots, in the order of their allocation, with an index for each cell.
    """

    width: Width
    costs: bytes
    places: bytes

    act = Act(Performative.INFORM, "the receiver learns the costs of the sender's subtree, and the values for them")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        values = counted(len(self.places), "byte")
        return f"{piece_in_words(self.costs, self.width)}, with the values that are fixed for them ({values})"


class CutValue(Message, frozen=True):
    """The optimal values, as indices, of the receiver's cut robots: first those above it, then those from it down."""

    values: list[int]

    act = Act(Performative.REQUEST, "the receiver makes its table for the optimal values")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        places = listed([str(place + 1) for place in self.values])
        return f"the best values of the robots that are fixed for you, or for others below, are by number {places}"


def _in_words(candidates: dict[str, Candidate]) -> str:
    texts = [f"{robot} (for {counted(one.relieved, 'table')})" for robot, one in candidates.items()]
    return f"from me down, tables are too large, unless robots are fixed: {listed(texts)}"


Places = NDArray[np.unsignedinteger[Any]]


SCRATCH = 16
"""The bytes for each cell while results are compared: an index, a mask, and the better part of a table."""


def added_up(all_candidates: Iterable[Mapping[str, Candidate]]) -> dict[str, Candidate]:
    """Return the sums of the candidates of several robots or branches."""
    found = dict[str, Candidate]()
    for candidates in all_candidates:
        for name, one in candidates.items():
            other = found.get(name)
            found[name] = one if other is None else msgspec.structs.replace(
                one, relieved=one.relieved + other.relieved, lowest=max(one.lowest, other.lowest)
            )  # fmt: skip
    return found


def best(candidates: Mapping[str, Candidate]) -> str:
    """Return the candidate that relieves the most robots; then the nearest to its lowest robot; then the deepest."""

    def merit(name: str) -> tuple[int, int, int, str]:
        one = candidates[name]
        return -one.relieved, one.lowest - one.depth, -one.depth, name

    return min(candidates, key=merit)


def thinned(candidates: Mapping[str, Candidate], above: Mapping[str, int]) -> dict[str, Candidate]:
    """Return the candidates `above`, and the best of the others, whose numbers cannot grow any more."""
    kept = {name: one for name, one in candidates.items() if name in above}
    others = {name: one for name, one in candidates.items() if name not in above}
    if others:
        kept[best(others)] = others[best(others)]
    return kept


class BestTables:
    """The best of several tables, cell by cell: costs, this robot's values, those of `cut` robots, as indices."""

    def __init__(
        self, shape: Sequence[int], costs: np.dtype[Any], own: int, cut: Sequence[int], *, on_disk: bool
    ) -> None:
        self.costs: Codes = empty_table(shape, costs, on_disk=on_disk)
        self.choices: Codes = empty_table(shape, place_type([own]), on_disk=on_disk)
        self.places: Places = empty_table((len(cut), *shape), place_type(cut or [own]), on_disk=on_disk and bool(cut))
        self.costs.fill(np.iinfo(costs).max)
        self.choices.fill(0)
        self.places.fill(0)

    def improve(
        self, at: Sequence[slice | int], found: Projection, own: int | None, places: Sequence[Table | int]
    ) -> None:
        """Adopt the cheaper cells, in the part `at` these axes; `own`: this robot's value, if it is fixed."""
        costs, choices, rows = (table[(..., *at)] for table in (self.costs, self.choices, self.places))
        for block in blocks_of(found.costs.shape):
            better = found.costs[block] < costs[block]
            np.copyto(costs[block], found.costs[block], where=better)
            here = found.choices[block]
            np.copyto(choices[block], here if own is None else own, where=better, casting="unsafe")
            for number, place in enumerate(places):
                best = place if isinstance(place, int) else picked(part_at(place, block), here)
                np.copyto(rows[number, *block], best, where=better, casting="unsafe")
        release(*found, self.costs, self.choices, self.places)

    def packed(self) -> Iterator[tuple[Width, bytes, bytes]]:
        """Yield the costs in pieces for messages, each with the indices that belong to it."""
        rows, start = self.places.reshape(len(self.places), -1), 0
        for width, piece in packed_costs(self.costs):
            cells = len(piece) // width
            yield width, piece, rows[:, start : start + cells].tobytes()
            start += cells


def bytes_of_best(shape: Sequence[int], width: int, own: int, cut: Sequence[int]) -> int:
    """Return the peak size of `BestTables` and of its packed pieces."""
    row = place_type(cut or [own]).itemsize * len(cut)
    cells = math.prod(shape)
    return cells * (width + place_type([own]).itemsize + row + SCRATCH) + min(cells, PIECE) * row


class IncomingPlaces:
    """The indices of cut robots' values that come with a table of this `shape`; `cut`: their numbers of values."""

    def __init__(self, shape: Sequence[int], cut: Sequence[int], *, on_disk: bool) -> None:
        self._limits = np.array(cut).reshape(-1, 1)
        self._start = 0
        self.table: Places = empty_table((len(cut), *shape), place_type(cut), on_disk=on_disk)

    def add(self, cells: int, piece: bytes) -> None:
        """Append the next piece, of `cells` cells. Raises `ValueError` if the bytes do not fit."""
        rows = self.table.reshape(len(self.table), -1)
        if len(piece) != cells * len(rows) * rows.itemsize or cells > rows.shape[1] - self._start:
            raise ValueError(f"{len(piece)} bytes cannot contain the values of {len(rows)} robots for {cells} cells")
        places = np.frombuffer(piece, rows.dtype).reshape(len(rows), cells)
        if (places >= self._limits).any():
            raise ValueError(
                f"the index of a value is too large: the robots have {self._limits.ravel().tolist()} values"
            )
        rows[:, self._start : self._start + cells] = places
        release(self.table)
        self._start += cells


def part_at(table: Table, block: Sequence[Any]) -> Table:
    """Return a view of the `block` of `table`, whose first axis belongs to this robot."""
    places = [place if length > 1 else 0 for place, length in zip(block[:-1], table.shape[1:], strict=False)]
    return table[(slice(None), *places)]


def picked(table: Table, choices: Codes) -> Table:
    """Return the part of `table` at this robot's values in `choices`; this robot's axis is the table's first."""
    if len(table) == 1:
        return np.broadcast_to(table[0], choices.shape)
    full = np.broadcast_to(table, (len(table), *choices.shape))
    found: Table = np.take_along_axis(full, choices[np.newaxis].astype(np.intp), 0)[0]
    return found


RMBMessage = (
    DomainAtDepth | ClusterLabel | SepDegree | Allocation | Proceed | Context | UTIL | CutUTIL | CutValue | VALUE
)


class RMBDPOP(MBDPOP):
    """One agent of RMB-DPOP.

    State besides that of MB-DPOP, whose `cut` contains the cut robots above, and `cuts` those above each child:

    - `proposed`: the children's candidates; `candidates`: their sum; `awaited`: children that will propose again;
    - `below`: the cut robots from this one down; `inner`: from each child down;
    - `best`: the tables of the enumeration; `settled`: whether the cut robots have their final values.
    """

    messages = TreeMessage | RMBMessage
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Chen et al. 2020",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        privacy="constraints of others, but for sums",
        use_when="as mb-dpop: branches enumerate for themselves",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.proposed: dict[str, Mapping[str, Candidate]] = {}
        self.candidates: dict[str, Candidate] = {}
        self.awaited: set[str] = set()
        self.below: Sizes = {}
        self.inner: dict[str, Sizes] = {}
        self.best: BestTables | None = None
        self.settled = False
        self._labelled = False
        self._above: dict[str, int] = {}
        self._requested: dict[str, list[int]] = {}
        self._places: dict[str, IncomingPlaces] = {}

    def handle(self, sender: str, message: Message) -> None:
        match cast("RMBMessage", message):
            case ClusterLabel() as label:
                self._store_cluster_label(sender, label)
                self._measure()
            case SepDegree() as degrees:
                self._sep_degree_handler(sender, degrees)
            case Allocation(robot):
                self._allocation_handler(robot)
            case CutUTIL(width, costs, places):
                self._places_of(sender).add(len(costs) // width, places)
                self._util_message_handler(sender, width, costs)
            case CutValue(values):
                self._receive_cut_values(values)
            case UTIL() if self.inner.get(sender) and not self.settled:
                raise ValueError(f"{sender} sent a table without the values of its cut robots")
            case DomainAtDepth() | Proceed() | Context() | UTIL() | VALUE() as others:
                super().handle(sender, others)
            case never:
                assert_never(never)

    # Labels and the choice of cut robots

    @property
    def _is_in_cluster(self) -> bool:
        """True if the separator is too large: the robot is in a cluster, below its root."""
        return len(self._sizes) > self.settings.k

    def _store_cluster_label(self, child: str, label: ClusterLabel) -> None:
        """Store a child's label. Raises `ValueError` for an impossible one."""
        sizes = {name: axis.size for name, axis in label.separator.items()}
        dimensions = Dimensions(sizes, label.dearest, label.induced_width, label.most)
        self._check_dimensions(child, dimensions)
        if bool(label.candidates) != (len(sizes) > self.settings.k):
            sizes_text = f"a separator of {len(sizes)} robots and {counted(len(label.candidates), 'candidate')}"
            raise ValueError(f"{child} sent {sizes_text}: exactly separators above {self.settings.k} have candidates")
        store_once(child, dimensions, self.dimensions, self.children)
        self._store_candidates(child, label.candidates)
        self.cuts[child], self.inner[child] = {}, {}
        for name, axis in label.separator.items():
            self.depths.setdefault(name, axis.depth)

    def _store_candidates(self, child: str, candidates: Mapping[str, Candidate]) -> None:
        """Store a child's candidates. Raises `ValueError` unless they are of its separator, and at most one below."""
        sizes = self.dimensions[child].separator
        others = [name for name in candidates if name not in sizes]
        wrong = any(one.size != sizes.get(name, one.size) for name, one in candidates.items())
        if len(others) > 1 or self.problem.agent in others or wrong:
            raise ValueError(f"{child} proposed robots that cannot be cut: {', '.join(candidates)}")
        self.proposed[child] = candidates

    def _plan(self) -> None:
        """Do nothing: the cluster root chooses the cut robots."""

    def _announce_dimensions(self) -> None:
        """Send the parent the candidates. A cluster root chooses one; without candidates it sends its label."""
        self.candidates = self._all_candidates()
        if self._is_in_cluster:
            self.candidates = thinned(self.candidates, self._sizes)
            self._propose()
        elif self.candidates:
            self._allocate(best(self.candidates))
        else:
            super()._announce_dimensions()

    def _all_candidates(self) -> dict[str, Candidate]:
        free = [name for name in self._sizes if name not in self.cut]
        own = {name: Candidate(self._sizes[name], self.depths[name], 1, self.depth) for name in free}
        return added_up([own if len(free) > self.settings.k else {}, *self.proposed.values()])

    def _propose(self) -> None:
        """Send the parent the candidates, the first time with the label."""
        width, most = self._width_and_need()
        if self._labelled:
            self.send(self.parent or "", SepDegree(self.candidates, most))
        else:
            self._send_dimensions(Dimensions(self._sizes, self._dearest, width, most))
        self._labelled = True

    def _send_dimensions(self, dimensions: Dimensions) -> None:
        """Send the parent this robot's label."""
        axes = {name: SeparatorAxis(size, self.depths[name]) for name, size in dimensions.separator.items()}
        candidates = self.candidates if self._is_in_cluster else {}
        label = ClusterLabel(axes, candidates, dimensions.dearest, dimensions.induced_width, dimensions.most)
        self.send(self.parent or "", label)

    def _sep_degree_handler(self, child: str, degrees: SepDegree) -> None:
        """Process a child's proposals after an allocation; continue when all awaited children have answered."""
        if child not in self.awaited or degrees.most.bytes < 0:
            raise ValueError(f"{child} sent an unexpected or invalid SepDegree")
        self._store_candidates(child, degrees.candidates)
        self.dimensions[child] = msgspec.structs.replace(self.dimensions[child], most=degrees.most)
        self.awaited.remove(child)
        if not self.awaited:
            self._announce_dimensions()

    def _allocation_handler(self, robot: str) -> None:
        """Process the choice of the cluster root. Raises `ValueError` if this robot did not propose it."""
        if not self._is_in_cluster or not self._labelled or self.awaited or robot not in self.candidates:
            raise ValueError(f"{self.problem.agent} did not propose to cut {robot}")
        self._allocate(robot)
        if not self.awaited:
            self._announce_dimensions()

    def _allocate(self, robot: str) -> None:
        """Cut `robot`, and inform the children that proposed it."""
        size = self.candidates[robot].size
        if len(self.cut) + len(self.below) >= MOST_AXES:
            raise ValueError(f"{self.problem.agent} cannot cut {robot}: {MOST_AXES} robots are cut already")
        if robot in self._sizes and self._is_in_cluster:
            self.cut[robot] = size
        elif robot in (*self._sizes, self.problem.agent):
            self.enumerated[robot] = size
        if robot not in self._sizes:
            self.below[robot] = size
        for child in self.children:
            if robot in self.proposed[child]:
                known = self.cuts if robot in self.dimensions[child].separator else self.inner
                known[child][robot] = size
                self.awaited.add(child)
                self.send(child, Allocation(robot))

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes of tables stored for the next context, and of the best costs and values for each cell."""
        stored = sum(table.cells * table.width for table in inputs)
        for child, cut in self.inner.items():
            row = place_type(cut.values()).itemsize * len(cut) if cut else 0
            stored += math.prod(self._child_sizes(child)) * row
        own, below = len(self.problem.values), [*self.below.values()]
        return stored + bytes_of_best(self._own_sizes(), width_of(self._dearest), own, below)

    # Contexts: each robot enumerates its own part

    def _start_inference(self) -> None:
        """Start to enumerate, unless the parent sends a context."""
        shared = {name: sum(name in cut for cut in self.cuts.values()) for name in self.enumerated}
        self.enumerated = {name: self.enumerated[name] for name in sorted(shared, key=lambda name: -shared[name])}
        if not self.cut:
            self._start_context({})

    def _start_context(self, context: dict[str, int]) -> None:
        """Start this robot's enumeration in the parent's context."""
        self._above, self.choices, self.best = context, None, None
        self._contexts = itertools.product(*map(range, self.enumerated.values()))
        self._next_context()

    def _next_context(self) -> bool:
        """Start the next context of this robot's enumeration; return whether there was one."""
        values = next(self._contexts, None)
        if values is not None:
            self.context = {**self._above, **dict(zip(self.enumerated, values, strict=True))}
            self._request_tables(self.context)
        return values is not None

    def _request_tables(self, context: Mapping[str, int]) -> None:
        """Request tables from the children in the cluster, except children whose values are the same as last time."""
        for child, cut in self.cuts.items():
            values = [context[name] for name in cut]
            if self._requested.get(child, []) != values:
                self._discard_table(child, values)
                self.send(child, Context(values))

    def _discard_table(self, child: str, values: list[int]) -> None:
        self._requested[child] = values
        self.utils.pop(child, None)
        self._places.pop(child, None)

    def _places_of(self, child: str) -> IncomingPlaces:
        """Return the received values that belong to a child's table."""
        cut = self.inner.get(child)
        if not cut or child not in self._requested or self.settled:
            raise ValueError(f"{child} sent a table with values without a request")
        if child not in self._places:
            sizes = self.dimensions[child].separator
            shape = [sizes[name] for name in self._table_axes(child)]
            self._places[child] = IncomingPlaces(shape, [*cut.values()], on_disk=self._on_disk)
        return self._places[child]

    def _compute_utils(self) -> None:
        """Compute the minimum cost of the subtree in the context; after the last context, send the best of all."""
        context = self.context or {}
        axes = [name for name in self._free if name not in context]
        found = self._projected(axes, context)
        if self.best is None:
            shape, below = [self._sizes[name] for name in self._free], [*self.below.values()]
            own = len(self.problem.values)
            self.best = BestTables(shape, found.costs.dtype, own, below, on_disk=self._on_disk)
        at = [context.get(name, slice(None)) for name in self._free]
        fixed = context.get(self.problem.agent)
        self.best.improve(at, found, fixed, [] if self.settled else self._best_places(axes, context))
        if not self._next_context():
            self._end_contexts(self.best)

    def _best_places(self, axes: Sequence[str], context: Mapping[str, int]) -> list[Table | int]:
        """Return the value of each cut robot from this one down in this context, for each of this robot's values."""
        onto = (self.problem.agent, *axes)
        rows = dict[str, Table]()
        for child, incoming in self._places.items():
            at, left = self._fixed(self._table_axes(child), context)
            index = tuple(at)
            for name, row in zip(self.inner[child], incoming.table, strict=True):
                rows[name] = aligned(row[index], left, onto)
        return [rows[name] if name in rows else context[name] for name in self.below]

    def _end_contexts(self, found: BestTables) -> None:
        """Send the best of all contexts: robots in a cluster to their parent, others as in DPOP."""
        self.choices = [found.choices]
        if self._final is not None:
            self._choose_in_context(self._final)
        elif not self._is_in_cluster:
            self._send_or_choose(found.costs)
        elif self.settled or not self.below:
            self._send_table(found.costs)
        else:
            for width, costs, places in found.packed():
                self.send(self.parent or "", CutUTIL(width, costs, places))

    # VALUE, from the root down

    def _choose_optimal(self, assignment: Sequence[int]) -> None:
        """Choose the cheapest value; a cluster root first sends the best values of cut robots down."""
        if self._is_in_cluster or not any(self.cuts.values()):
            if self.below and not self.settled:
                raise ValueError(f"{self.problem.agent} does not know the best values of the cut robots")
            self._choose_in_context(assignment)
            return
        if self.best is None or self.choices is None or self._final is not None:
            raise ValueError(f"{self.problem.agent} already has a value, or has no table yet")
        self._final = assignment
        values = dict(zip(self.separator or (), assignment, strict=True))
        rows = zip(self.below, self.best.places, strict=True)
        self._apply_cut_values({**values, **{name: int(row[tuple(assignment)]) for name, row in rows}})

    def _receive_cut_values(self, values: Sequence[int]) -> None:
        """Process the best values of cut robots. Raises `ValueError` if they are unexpected or invalid."""
        cut = {**self.cut, **self.below}
        if not self.cut or self.choices is None or self.settled:
            raise ValueError(f"{self.problem.agent} received unexpected values of cut robots")
        if len(values) != len(cut) or not all(map(is_place, values, cut.values())):
            raise ValueError(f"{values} are not values of {', '.join(cut)}")
        self._apply_cut_values(dict(zip(cut, values, strict=True)))

    def _apply_cut_values(self, values: Mapping[str, int]) -> None:
        """Send on the best values of cut robots, and make this robot's table under these values."""
        self.settled, self.choices, self.best = True, None, None
        self.context = {name: values[name] for name in (*self.cut, *self.enumerated)}
        for child, cut in self.cuts.items():
            needed = [values[name] for name in (*cut, *self.inner[child])]
            if self.inner[child] or self._requested.get(child, []) != needed:
                self._discard_table(child, needed)
                self.send(child, CutValue(needed))
        self._compute_if_complete()

    def _best_value(self, choices: Sequence[Codes], assignment: Sequence[int]) -> int:
        """Return the index of this robot's cheapest value; if it is fixed, the tables contain only its fixed value."""
        free = [place for name, place in zip(self.separator or (), assignment, strict=True) if name not in self.cut]
        return int(choices[0][tuple(free)])
