"""Memory-bounded DPOP (MB-DPOP).

DPOP (see `dpop.py`) whose tables have at most `k` dimensions. If a robot's separator is larger, some robots in it, the
*cycle-cut* robots, are fixed. A *cluster root* enumerates their values: it sends each combination down (`Context`) and
receives a table for it. So memory is bounded, but more messages are needed.

- **When to use**: costs, on a pseudo-tree too wide for `dpop`. If `k` is at least the induced width, it is the same as
  DPOP.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. No table that is
  sent has more than `k` dimensions. The number of messages is exponential in the cycle-cut robots of a cluster.
- **Parameters (`--set`)**: `k`, the maximum number of dimensions of a table (default 4); `memory` and `disk`, the
  maximum numbers of bytes in a robot's tables in memory and on the disk, as in DPOP.
- **Reference**: Petcu, Faltings: "MB-DPOP: a new memory-bounded algorithm for distributed optimization", IJCAI 2007,
  Algorithms 1 (labeling) and 2 (memory-bounded inference).

The paper's procedures are these methods:

    labeling, bottom up     `_plan`, `_send_dimensions`    UTIL of a context   `_compute_utils`
    cluster root            `_next_context`                best context        `_choose_optimal`

The rules of labelling, leaves first. A robot's list contains the cycle-cut robots of its cluster, including those below
it:

- A robot inherits the lists of its children. It is a cluster root if these lists are not empty, none of their robots is
  in its separator, and its separator has at most `k` robots. Then it enumerates them (it is one of them itself), and
  has no list.
- Otherwise it adds robots in its separator to the list, until at most `k` of the others are left.

Choices that the paper leaves open, and differences:

- The robots that are highest in the tree are added to a list first. Therefore `DomainAtDepth`, which replaces DPOP's
  `Domain`, contains the sender's depth.
- Sizes, limits and the permission to proceed are as in DPOP, so nothing is computed before all tables are known to fit.
- A context is sent only to children whose tables depend on it, as indices of the values in the order of the child's
  list. Tables from other children are requested once.
- Once a cluster root has its values, it sends the best context down again, and waits for the tables: then all robots in
  the cluster have their choices for it, and VALUE continues as in DPOP.
- The tables of a robot's constraints are made once, and are as large as the constraints.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(3), Options(protocol="mb-dpop", runtime=Runtime.SIMULATOR, settings={"k": "2"}))
>>> outcome.verdict.value
'no-solution'
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, assert_never, cast

import msgspec
import numpy as np

from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import HasOnly, Proof, Reception
from robochoc.protocols.inference.dpop import (
    DPOP,
    MOST_AXES,
    UTIL,
    VALUE,
    Cost,
    Dimensions,
    DPOPSettings,
    Need,
    Proceed,
    Size,
    costs_of,
    store_once,
)
from robochoc.protocols.inference.dpop_tables import (
    CoarseTable,
    Codes,
    Extent,
    Projection,
    Table,
    Width,
    aligned,
    blocks_of,
    empty_table,
    part_of,
    place_type,
    project,
    release,
    width_of,
)
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted, listed


class MBDPOPSettings(DPOPSettings, frozen=True):
    """`k`: the maximum number of dimensions of a table. `memory` and `disk` as in DPOP."""

    k: int = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.k < 1:
            raise ValueError(f"k is {self.k}; it must be 1 or more, as a table has at least one dimension")


Depth = Annotated[int, msgspec.Meta(ge=0)]


class DomainAtDepth(Message, frozen=True):
    """The sender's domain and its depth in the tree, for the robots below that share a constraint with it."""

    depth: Depth
    values: list[Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return f"{counted(self.depth, 'robot')} above me in the tree; {words.domain(self.values)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values))]


class SeparatorAxis(msgspec.Struct, frozen=True, array_like=True):
    """A robot in a separator: the size of its domain, and its depth in the tree."""

    size: Size
    depth: Depth


class Label(Message, frozen=True):
    """The sender's label: its separator, and its list of cycle-cut robots with the sizes of their domains.

    While these robots have fixed values, the sender's table has axes only for the rest of the separator. `dearest`,
    `induced_width` and `most` are as in DPOP's `Dimensions`.
    """

    separator: dict[str, SeparatorAxis]
    cut: dict[str, Size]
    dearest: Cost
    induced_width: int
    most: Need

    act = Act(Performative.INFORM, "the receiver learns the size of the sender's table, and the robots fixed for it")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        free = {name: axis.size for name, axis in self.separator.items() if name not in self.cut}
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in free.items()])
        cells = counted(math.prod(free.values()), "cell")
        fixed = f"while {listed(self.cut)} {'is' if len(self.cut) == 1 else 'are'} fixed, " if self.cut else ""
        return (
            f"{fixed}my table has {cells}{' over ' if axes else ''}{axes}, and no cost above {cost_text(self.dearest)}"
        )


class Context(Message, frozen=True):
    """Fixed values, as indices, for the cycle-cut robots in the receiver's list, in the order of the list."""

    values: list[int]

    act = Act(Performative.REQUEST, "the receiver makes its table for these values")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        places = listed([str(place + 1) for place in self.values])
        return f"make your table for these values of the robots that are fixed, by number: {places}"


Sizes = dict[str, int]


@mypyc_attr(allow_interpreted_subclasses=True)
class MBDPOP(DPOP):
    """One agent of MB-DPOP.

    State besides that of DPOP:

    - `depth`, and the `depths` of robots above;
    - `cuts`: the children's lists of cycle-cut robots, with the sizes of their domains;
    - `cut`: this robot's list; `enumerated`: the robots that a cluster root enumerates;
    - `context`: the current values, as indices, of the robots in these lists.
    """

    messages: ClassVar[Any] = TreeMessage | DomainAtDepth | Label | Proceed | Context | UTIL | VALUE
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2007",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs, where tables of dpop are too large: bounds them",
    )
    settings: ClassVar[MBDPOPSettings] = MBDPOPSettings()
    divides = False

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.depth = 0
        self.depths: dict[str, int] = {}
        self.cuts: dict[str, Sizes] = {}
        self.cut: Sizes = {}
        self.enumerated: Sizes = {}
        self.context: dict[str, int] | None = None
        self._own_tables: list[tuple[Table | CoarseTable, Sequence[str]]] = []
        self._contexts: Iterator[tuple[int, ...]] = iter(())
        self._best: Codes | None = None
        self._best_context: Codes | None = None
        self._final: Sequence[int] | None = None

    def start_in_tree(self) -> None:
        """Send domain and depth to the neighbours below; all but the root wait for their parent's depth."""
        if self.parent is None:
            self._send_place()
            self._measure()

    def handle(self, sender: str, message: Message) -> None:
        match cast("DomainAtDepth | Label | Proceed | Context | UTIL | VALUE", message):
            case DomainAtDepth(depth, values):
                store_once(sender, values, self.domains, self.ancestors)
                self.depths[sender] = depth
                if sender == self.parent:
                    self.depth = depth + 1
                    self._send_place()
                self._measure()
            case Label() as label:
                self._store_label(sender, label)
                self._measure()
            case Context(values):
                self._receive_context(values)
            case Proceed() | UTIL() | VALUE() as others:
                super().handle(sender, others)
            case never:
                assert_never(never)

    def _send_place(self) -> None:
        for name in self.descendants:
            self.send(name, DomainAtDepth(self.depth, list(self.problem.values)))

    # Labels, from the leaves up

    def _store_label(self, child: str, label: Label) -> None:
        """Store a child's label. Raises `ValueError` if the child's table would have more than `k` dimensions."""
        free = [name for name in label.separator if name not in label.cut]
        if len(free) > self.settings.k or len(label.cut) > MOST_AXES:
            raise ValueError(f"{child} announced a table of {len(free)} dimensions, more than {self.settings.k}")
        sizes = {name: axis.size for name, axis in label.separator.items()}
        dimensions = Dimensions(sizes, label.dearest, label.induced_width, label.most)
        self._check_dimensions(child, dimensions)
        store_once(child, dimensions, self.dimensions, self.children)
        self.cuts[child] = label.cut
        for name, axis in label.separator.items():
            self.depths.setdefault(name, axis.depth)

    def _plan(self) -> None:
        """Label this robot: the robots that it enumerates as a cluster root, or its list of cycle-cut robots."""
        inherited = {name: size for child in self.children for name, size in self.cuts[child].items()}
        if inherited and self._sizes.keys().isdisjoint(inherited) and len(self._sizes) <= self.settings.k:
            self.enumerated = inherited
            return
        free = sorted((name for name in self._sizes if name not in inherited), key=self._by_depth)
        added = free[: max(0, len(free) - self.settings.k)]
        self.cut = {**inherited, **{name: self._sizes[name] for name in added}}

    def _by_depth(self, name: str) -> tuple[int, int]:
        return self.depths[name], self.order.rank[name]

    def _send_dimensions(self, dimensions: Dimensions) -> None:
        """Send the parent this robot's label."""
        axes = {name: SeparatorAxis(size, self.depths[name]) for name, size in dimensions.separator.items()}
        label = Label(axes, self.cut, dimensions.dearest, dimensions.induced_width, dimensions.most)
        self.send(self.parent or "", label)

    def _own_sizes(self) -> list[int]:
        return [size for name, size in self._sizes.items() if name not in self.cut]

    def _child_sizes(self, child: str) -> list[int]:
        sizes = self.dimensions[child].separator
        return [size for name, size in sizes.items() if name not in self.cuts[child]]

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes of tables stored for the next context; a cluster root also stores the best of each cell."""
        stored = sum(table.cells * table.width for table in inputs)
        if self.enumerated:
            places = place_type(self.enumerated.values()).itemsize * len(self.enumerated)
            stored += math.prod(self._own_sizes()) * (width_of(self._dearest) + places)
        return stored

    # Tables in a context

    def _table_axes(self, child: str) -> Sequence[str]:
        """Return the robots in a child's table that are not fixed for it."""
        return [name for name in self._axes[child] if name not in self.cuts[child]]

    @property
    def _free(self) -> tuple[str, ...]:
        """The robots that the axes of this robot's table belong to."""
        return tuple(name for name in self.separator or () if name not in self.cut)

    def _start_utils(self) -> None:
        """Make the tables of this robot's constraints; compute at once if there is nothing to wait for."""
        tables = self.problem.tables({name: self.domains[name] for name in self.ancestors})
        self._own_tables = [(costs_of(table), (*table.agents, self.problem.agent)) for table in tables]
        self._start_inference()
        self._compute_if_complete()

    def _start_inference(self) -> None:
        """Start the first context, unless the parent sends it."""
        if self.enumerated:
            self._contexts = itertools.product(*map(range, self.enumerated.values()))
            self._next_context()
        elif not self.cut:
            self.context = {}

    def _receive_context(self, values: Sequence[int]) -> None:
        """Process the parent's context."""
        if not self.cut or self.separator is None or (self.context is not None and self.choices is None):
            raise ValueError(f"{self.problem.agent} received an unexpected context")
        if len(values) != len(self.cut) or not all(map(is_place, values, self.cut.values())):
            raise ValueError(f"{values} are not values of {', '.join(self.cut)}")
        self._start_context(dict(zip(self.cut, values, strict=True)))
        self._compute_if_complete()

    def _next_context(self) -> bool:
        """As a cluster root, start the next context; return whether there was one."""
        values = next(self._contexts, None)
        if values is not None:
            self._start_context(dict(zip(self.enumerated, values, strict=True)))
        return values is not None

    def _start_context(self, context: dict[str, int]) -> None:
        """Request the tables of the children in the cluster."""
        self.context, self.choices = context, None
        for child in self.children:
            if self.cuts[child]:
                self.utils.pop(child, None)
                self.send(child, Context([context[name] for name in self.cuts[child]]))

    def _compute_if_complete(self) -> None:
        """Compute if there is a context and all tables for it have arrived."""
        if self.context is not None and self.choices is None and self._all_arrived:
            self._compute_utils()

    def _compute_utils_of_all(self) -> None:
        self._compute_if_complete()

    def _util_message_handler(self, child: str, width: Width, costs: bytes) -> None:
        """Store a piece of the child's table. Raises `ValueError` for an unexpected piece."""
        if self.context is None and self.cuts.get(child):
            raise ValueError(f"{child} sent a table without a request")
        super()._util_message_handler(child, width, costs)

    def _compute_utils(self) -> None:
        """Compute the minimum cost of the subtree in the context, for each combination of the robots not fixed."""
        costs, choices = self._projected(self._free, self.context or {})
        self.choices = [choices]
        if self.cut:
            self._send_table(costs)
        elif not self.enumerated:
            self._send_or_choose(costs)
        elif self._final is None:
            self._record_best(costs)
        else:
            self._choose_in_context(self._final)

    def _projected(self, axes: Sequence[str], context: Mapping[str, int]) -> Projection:
        """Join and project all tables in `context`; `axes` are the robots that are not fixed."""
        onto = (self.problem.agent, *axes)
        children = [(table.costs, self._table_axes(child)) for child, table in self.utils.items()]
        tables: list[Table | CoarseTable] = []
        for table, over in [*self._own_tables, *children]:
            index, left = self._fixed(over, context)
            tables.append(aligned(part_of(table, index), left, onto))
        own = context.get(self.problem.agent)
        charges = self.problem.charges if own is None else self.problem.charges[own : own + 1]
        return project([self._sizes[name] for name in axes], charges, tables, self._dearest, on_disk=self._on_disk)

    def _fixed(self, axes: Sequence[str], context: Mapping[str, int]) -> tuple[list[slice | int], list[str]]:
        """Return the index of the part in `context` of a table with these axes, and the axes of this part."""
        own = self.problem.agent
        index = [
            slice(None) if name not in context
            else slice(context[name], context[name] + 1) if name == own
            else context[name]
            for name in axes
        ]  # fmt: skip
        return index, [name for name in axes if name not in context or name == own]

    # The enumeration of a cluster root

    def _record_best(self, costs: Codes) -> None:
        """Store the costs of this context that are lower than all before; then start the next, or send on the best."""
        if self._best is None or self._best_context is None:
            self._best = empty_table(costs.shape, costs.dtype, on_disk=self._on_disk)
            self._best.fill(np.iinfo(costs.dtype).max)
            shape, kind = (len(self.enumerated), *costs.shape), place_type(self.enumerated.values())
            self._best_context = empty_table(shape, kind, on_disk=self._on_disk)
            self._best_context.fill(0)
        for block in blocks_of(costs.shape):
            better = costs[block] < self._best[block]
            np.copyto(self._best[block], costs[block], where=better)
            for number, value in enumerate((self.context or {}).values()):
                np.copyto(self._best_context[number, *block], value, where=better, casting="unsafe")
        release(costs, self._best, self._best_context)
        if not self._next_context():
            best, self._best = self._best, None
            self._send_or_choose(best)

    # VALUE, from the root down

    def _choose_optimal(self, assignment: Sequence[int]) -> None:
        """Choose the cheapest value; a cluster root first sends its best context down again."""
        if not self.enumerated:
            self._choose_in_context(assignment)
            return
        if self._best_context is None or self._final is not None:
            raise ValueError(f"{self.problem.agent} already has a value, or has no table yet")
        self._final = assignment
        best = {
            name: int(places[tuple(assignment)])
            for name, places in zip(self.enumerated, self._best_context, strict=True)
        }
        self._best_context = None
        if best == self.context:
            self._choose_in_context(assignment)
        else:
            self._start_context(best)

    def _choose_in_context(self, assignment: Sequence[int]) -> None:
        """Choose the cheapest value in the context of the whole cluster."""
        view = dict(zip(self.separator or (), assignment, strict=True))
        context = self.context or {}
        if any(context.get(name, place) != place for name, place in view.items()):
            raise ValueError(f"{self.problem.agent} has other fixed values than the values received: {assignment}")
        super()._choose_optimal(assignment)

    def _best_value(self, choices: Sequence[Codes], assignment: Sequence[int]) -> int:
        """Return the index of this robot's cheapest value, or of its fixed value."""
        free = [place for name, place in zip(self.separator or (), assignment, strict=True) if name not in self.cut]
        return int(choices[0][tuple(free)]) + (self.context or {}).get(self.problem.agent, 0)


def is_place(place: int, size: int) -> bool:
    """Return whether a robot with `size` values has a value with index `place`."""
    return 0 <= place < size
