"""Distributed Pseudo-tree Optimization Procedure (DPOP).

Dynamic programming on a pseudo-tree, for minimum cost. From the leaves up, each robot sends its parent a table (UTIL):
the minimum cost of its subtree for every combination of values of its separator, the higher robots that matter to the
subtree. It adds up its constraints and its children's tables, and minimises over its own values. From the root down,
each robot chooses the cheapest value (VALUE).

- **When to use**: costs, and a pseudo-tree with a small induced width. The number of messages is linear, but a table
  has one dimension for each robot in the separator. Robots may have several variables, such as a slot and a task: their
  tables contain only the variables that matter, and independent variables have separate tables.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. A run that needs
  more memory than allowed ends before any table is made.
- **Parameters (`--set`)**: `memory`, the maximum number of bytes in a robot's tables in memory (default 1 GiB);
  `disk`, the number of further bytes, on the disk, if the memory is too small (default 4 GiB; 0: none).
- **Reference**: Petcu, Faltings: "A scalable method for multiagent constraint optimization", IJCAI 2005, Algorithm 1.

The methods have the names of the paper's procedures:

    Phase 1 (pseudo-tree)   `dfs.TreeProtocol`          Compute_utils           `_compute_utils`
    UTIL_Message_handler    `_util_message_handler`     Choose_optimal          `_choose_optimal`
    VALUE_Message_handler   `_value_message_handler`

Memory needs are known before tables are made; in the paper, tables are made at once. Each robot sends its domain to
robots below (`Domain`). It sends its parent its separator, an upper bound on its costs, and the largest memory need
below (`Dimensions`). The root ends the run if that need is more than `memory` and `disk`. Otherwise it lets all robots
continue, and each robot sends its children the order of their tables' axes (`Proceed`): the nearest robot first, so no
table is ever transposed. This adds two messages for each robot except the roots, and one for each edge. A robot with
one value has no axis.

Choices that the paper leaves open, and differences:

- Costs are minimised; `inf` is a violated hard constraint. A robot whose whole table is `inf` ends the search.
- A separator contains only robots that share a constraint with a robot in the subtree.
- The join is made block by block and is never in memory as a whole. Besides the table, this robot's cheapest value for
  each cell is stored (one or two bytes), so the children's tables, larger by an axis, can be freed.
- A constraint may name only some variables of a robot. Then its table, and a table that results from it, distinguish
  only these variables' values (`dpop_groups.Partition`). The paper has one variable for each robot.
- A robot with several variables divides its tables into groups that its values do not connect, and minimises each group
  separately (`dpop_groups.divided`). It sends the resulting tables one after the other; their sum is the paper's table.
  The table sizes are then in `SplitDimensions`. So six robots with a slot (of 3) and a task (of 6) send tables of 3^5
  and 6^5 cells, not of 18^5.
- VALUE contains the indices of the values in the child's separator, in the order of the separator.
- A table has as few bytes per cost as it needs, and is sent in pieces of up to 4 MiB. Ties go to the first value.
- A constraint is checked by the lowest robot in its scope, once for each distinguishable combination, when its table is
  made. Additions and minimisations do not count as constraint checks.
- Costs are integers, added in float64. If they could reach 2^53, they would not be exact, and the run ends.
- The limits apply to each robot's arrays. They do not include messages in transit, nor costs cached by a local problem.
  On a network, a robot drops messages of a neighbour beyond 256 MiB that it has not read, and the run ends.
- A robot that needs more than `memory` keeps its table, its choices and its children's tables in unnamed files in the
  folder for temporary files (`TMPDIR`). Nothing remains of them, whatever ends the run.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), DPOP, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, TypeVar, assert_never, cast, overload

import msgspec
import numpy as np

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import NOTHING, HasOnly, HasValue, Proof, Reception, table_proves
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.dpop_groups import (
    NO_AXIS,
    Group,
    Input,
    Outline,
    Partition,
    Parts,
    code_of,
    decoded,
    distinguishes,
    divided,
    encoded,
    length_of,
    mapped,
    partition_of,
    places_of,
)
from robochoc.protocols.inference.dpop_tables import (
    CoarseTable,
    Codes,
    Extent,
    IncomingTable,
    IncomingTables,
    Places,
    Projection,
    Result,
    Table,
    Width,
    aligned,
    are_all_infinite,
    bytes_of,
    cells_of,
    coarse,
    packed_costs,
    piece_in_words,
    project,
    width_of,
)
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.cost_table import CostTable
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.local_problem import LocalProblem, TableScope
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted, listed
from robochoc.system.stored_arrays import free_disk_bytes

GIB = 1 << 30


class TableSettings(Settings, frozen=True):
    """`memory`: the maximum number of bytes in a robot's tables. A run that needs more ends before it makes any."""

    memory: int = GIB

    def __post_init__(self) -> None:
        if self.memory < 1:
            raise ValueError(f"memory is {self.memory}; it must be a number of bytes, 1 or more")

    @property
    def most(self) -> int:
        """The maximum number of bytes in a robot's tables, wherever they are."""
        return self.memory

    @property
    def limit_in_words(self) -> str:
        """The maximum in an error message."""
        return f"{self.memory:,}"

    @property
    def remedy(self) -> str:
        """The way to raise the maximum."""
        return "--set memory=BYTES raises the limit"


class DPOPSettings(TableSettings, frozen=True):
    """`memory` as in `TableSettings`; `disk`: the maximum number of further bytes, on the disk."""

    disk: int = 4 * GIB

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.disk < 0:
            raise ValueError(f"disk is {self.disk}; it must be a number of bytes, 0 or more")

    @property
    def most(self) -> int:
        return self.memory + self.disk

    @property
    def limit_in_words(self) -> str:
        return f"{self.memory:,} in memory and {self.disk:,} on the disk"

    @property
    def remedy(self) -> str:
        return "--set memory=BYTES and --set disk=BYTES raise the limits"


Size = Annotated[int, msgspec.Meta(ge=2)]


Cost = Annotated[int, msgspec.Meta(ge=0, le=EXACT)]
"""2^53 also represents all larger costs; a run with such costs ends."""


MOST_CELLS = 4096
"""Larger tables have no rule about their proofs, because computing the proofs would take too long."""


class Need(msgspec.Struct, frozen=True, array_like=True, order=True):
    """A memory need: the peak number of `bytes` in the arrays of `robot`; from 2^53 on, the nearest float."""

    bytes: int | float
    robot: str


class Domain(Message, frozen=True):
    """The sender's domain, for the robots below that share a constraint with it."""

    values: list[Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return words.domain(self.values)

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values))]


class Dimensions(Message, frozen=True):
    """The sender's separator with its domain sizes; `dearest` is an upper bound on the costs in its table.

    `induced_width` is the size of the largest separator in the sender's subtree, `most` the largest memory need in it.
    """

    separator: dict[str, Size]
    dearest: Cost
    induced_width: int
    most: Need

    act = Act(Performative.INFORM, "the receiver learns how large the sender's table will be")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        cells = counted(math.prod(self.separator.values()), "cell")
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in self.separator.items()])
        return (
            f"my table will have {cells}{' over ' if axes else ''}{axes}, and no cost above {cost_text(self.dearest)};"
            f" from me down the induced width is {self.induced_width},"
            f" and {self.most.robot} needs the most memory, {cost_text(self.most.bytes)} bytes"
        )


class TableSizes(msgspec.Struct, frozen=True, array_like=True):
    """One of several tables: an upper bound on its costs, and its axes, each with the codes of the robot's values.

    Values with the same code are not distinguished: the code is the index on the axis. Codes are little-endian integers
    as narrow as the domain size allows. Without codes, all values are distinguished.
    """

    dearest: Cost
    axes: dict[str, bytes]


class SplitDimensions(Dimensions, frozen=True):
    """The `Dimensions` of a sender with several tables, or with one that does not distinguish all values of a robot.

    The sum of the `tables` is the table of DPOP. They are sent one after the other, in this order.
    """

    tables: list[TableSizes]

    def in_words(self, _: Wording) -> str:
        tables = "; ".join(map(self._table_in_words, self.tables))
        return (
            f"the costs of my subtree are the sum of {counted(len(self.tables), 'table')}: {tables}; no cost is above"
            f" {cost_text(self.dearest)}; from me down the induced width is {self.induced_width},"
            f" and {self.most.robot} needs the most memory, {cost_text(self.most.bytes)} bytes"
        )

    def _table_in_words(self, table: TableSizes) -> str:
        axes = listed([self._axis_in_words(*axis) for axis in table.axes.items()])
        return f"one over {axes}" if axes else "a single cost"

    def _axis_in_words(self, robot: str, codes: bytes) -> str:
        return f"{robot} ({counted(length_of(decoded(codes, self.separator[robot]), self.separator[robot]), 'value')})"


class Proceed(Message, frozen=True):
    """Permission to make tables, because the tables of the tree fit in memory; with the axes of the receiver's table.

    The axes are the receiver's separator, the nearest robot first.
    """

    separator: list[str]

    act = Act(Performative.REQUEST, "the receiver makes its table")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        axes = f", over {listed(self.separator)}" if self.separator else ""
        return f"all tables fit: make yours{axes}"


class UTIL(Message, frozen=True):
    """A piece of the sender's table, in the order of its cells; its first axis belongs to the nearest robot.

    `costs` are unsigned little-endian integers of `width` bytes; the largest number represents `inf`.
    """

    width: Width
    costs: bytes

    act = Act(Performative.INFORM, "the receiver learns the costs of the sender's subtree")

    def in_words(self, _: Wording) -> str:
        return piece_in_words(self.costs, self.width)

    def proves(self, reception: Reception) -> Sequence[Proof] | None:
        """Return the bounds on the sender's costs. There is no rule for large tables, or several of them.

        For each combination of values, some value of the sender costs no more than its cell, because all robots below
        cost at least 0. If all neighbours of the sender are above it, no robot is below; then no value costs less.
        """
        axes = axes_of(reception, reception.receiver, reception.sender)
        dimensions = reception.last(Dimensions, reception.sender, reception.receiver)
        if isinstance(dimensions, SplitDimensions):
            return None
        if axes is None or dimensions is None:
            return NOTHING  # received in another epoch, or as labels (MB-DPOP)
        shape = [dimensions.separator[robot] for robot in axes]
        cells = cells_of(self.costs, self.width)
        if len(cells) != math.prod(shape) or len(cells) > MOST_CELLS:
            return None
        return table_proves(axes, zip(itertools.product(*map(range, shape)), cells, strict=True), reception)


class VALUE(Message, frozen=True):
    """The values of the robots in the receiver's separator, as indices, in the order of its axes."""

    assignment: list[int]

    act = Act(Performative.INFORM, "the receiver learns the values above it")

    def in_words(self, _: Wording) -> str:
        if not self.assignment:
            return "nobody above you has to do with your subtree: take your best value"
        places = listed([str(place + 1) for place in self.assignment])
        return f"by number, the values of the robots in your separator are {places}, the nearest robot first"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        axes = axes_of(reception, reception.sender, reception.receiver)
        if axes is None:
            return NOTHING  # received in another epoch
        known = [(robot, reception.values(robot), place) for robot, place in zip(axes, self.assignment, strict=True)]
        return [HasValue(robot, values[place]) for robot, values, place in known if values is not None]


def axes_of(reception: Reception, parent: str, child: str) -> Sequence[str] | None:
    """Return the axes of a child's table; None if they were not sent in this run."""
    proceed = reception.last(Proceed, parent, child)
    return None if proceed is None else proceed.separator


MOST_AXES = 1_000
"""A table with this many axes never fits into memory."""
Scope = tuple[str, ...]
T = TypeVar("T")


@mypyc_attr(allow_interpreted_subclasses=True)
class DPOP(TreeProtocol):
    """One agent of DPOP.

    State, in the order in which it becomes known:

    - `domains` of the neighbours above, and `dimensions` of the children;
    - `separator`, and `utils`, the children's tables;
    - `groups` of tables that this robot's values do not connect;
    - `choices`: for each group and combination of values in its separator, this robot's cheapest value;
    - `optimum`: the cost of the whole tree (at its root).
    """

    messages: ClassVar[Any] = TreeMessage | Domain | Dimensions | SplitDimensions | Proceed | UTIL | VALUE
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2005",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        wide_tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs, small induced width: number of messages is linear",
    )
    settings: ClassVar[TableSettings] = DPOPSettings()
    divides: ClassVar[bool] = True
    """True if the protocol divides tables into independent groups."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.domains: dict[str, list[Value]] = {}
        self.dimensions: dict[str, Dimensions] = {}
        self.separator: tuple[str, ...] | None = None
        self.utils: dict[str, IncomingTables] = {}
        self.choices: list[Codes] | None = None
        self.optimum: int | None = None
        self.groups: list[Group] = []
        self._parts: Parts | None = None
        self._to_join: list[Input] = []
        self._outlines: dict[str, list[Outline]] = {}
        """The outlines of the tables of children that have sent `SplitDimensions`."""
        self._made: list[tuple[Any, Sequence[str]]] = []
        """Tables to be joined, and the robots of their axes: as they are if they are divided into groups."""
        self._checked: list[TableScope] = []
        self._partitions: dict[tuple[str, tuple[int, ...]], Partition] = {}
        self._sizes: dict[str, int] = {}
        self._dearest = 0
        self._need = Need(0, problem.agent)
        self._axes: dict[str, tuple[str, ...]] = {}
        self._joined: list[Table | CoarseTable] = []

    def start_in_tree(self) -> None:
        """Send the domain to the neighbours below."""
        for name in self.descendants:
            self.send(name, Domain(list(self.problem.values)))
        self._measure()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | Dimensions | SplitDimensions | Proceed | UTIL | VALUE", message):
            case Domain(values):
                store_once(sender, values, self.domains, self.ancestors)
                self._measure()
            case Dimensions() | SplitDimensions() as dimensions:
                self._store_dimensions(sender, dimensions)
                self._measure()
            case Proceed(separator):
                self._proceed(separator)
            case UTIL(width, costs):
                self._util_message_handler(sender, width, costs)
            case VALUE(assignment):
                self._value_message_handler(assignment)
            case never:
                assert_never(never)

    @property
    def findings(self) -> Findings:
        """The position in the tree; for a root also the optimum of its tree, once it has received all tables."""
        return msgspec.structs.replace(super().findings, bound=self.optimum)

    # The sizes of tables

    def _measure(self) -> None:
        """Send the dimensions to the parent, or decide as the root, once all domains and dimensions have arrived."""
        if len(self.domains) < len(self.ancestors) or len(self.dimensions) < len(self.children):
            return
        self._compute_dimensions()

    def _compute_dimensions(self) -> None:
        """Compute the dimensions of this robot's table, and announce them."""
        self._partitions = {}  # in S-DPOP, the domains above may have changed
        self._checked = self.problem.scopes_in_tables(self.ancestors)
        self._sizes = self._separator_sizes([one.agents for one in self._checked])
        self._dearest = self._upper_bound([one.max_cost for one in self._checked])
        self._divide()
        self._plan()
        self._announce_dimensions()

    def _announce_dimensions(self) -> None:
        """Send the parent the dimensions of this robot's table; a root decides whether all proceed."""
        width, most = self._width_and_need()
        if self.parent is None:
            self._check_limits(most, width)
            self._proceed([])
        else:
            self._send_dimensions(self._dimensions(width, most))

    def _width_and_need(self) -> tuple[int, Need]:
        """Return the induced width and the largest memory need of this robot's subtree."""
        self._need = self._memory_need()
        below = [self.dimensions[child] for child in self.children]
        width = max([len(self._sizes), *(one.induced_width for one in below)])
        return width, max([self._need, *(one.most for one in below)])

    def _divide(self) -> None:
        """Divide the tables into groups that this robot's values do not connect."""
        self._parts, self.groups = None, []
        if not self.divides or (not self._outlines and all(scope.places is None for scope in self._checked)):
            return
        self._to_join = self._inputs_of_join()
        if all(one.is_whole for one in self._to_join):
            return
        self._parts = Parts(self.problem.values, self.problem.charges)
        self.groups = divided(self._parts, self._to_join, self._sizes)
        named = {name for group in self.groups for name in group.result.axes}
        self._sizes = {name: size for name, size in self._sizes.items() if name in named}

    def _inputs_of_join(self) -> list[Input]:
        """Return the tables that this robot joins: those of its constraints, and then its children's."""
        found = []
        for scope in self._checked:
            robots = (*scope.agents, self.problem.agent)
            axes = zip(robots, self._partitions_of(scope), strict=True)
            found.append(self._input(scope.max_cost, dict(axes)))
        for child in self.children:
            found += [self._input(*outline) for outline in self._outlines_of(child)]
        return found

    def _input(self, dearest: float, axes: Mapping[str, Partition]) -> Input:
        """Return a table to be joined, given all its axes. An axis with a single index is left out."""
        own = axes.get(self.problem.agent, NO_AXIS)
        above = {
            name: axis
            for name, axis in axes.items()
            if name in self._sizes and name != self.problem.agent and distinguishes(axis)
        }
        single = len(self.problem.values) == 1 or not distinguishes(own)
        return Input(Outline(int(dearest), above), NO_AXIS if single else own)

    def _outlines_of(self, child: str) -> list[Outline]:
        """Return the outlines of a child's tables."""
        dimensions = self.dimensions[child]
        return self._outlines.get(child) or [Outline(dimensions.dearest, dict.fromkeys(dimensions.separator))]

    def _dimensions(self, width: int, most: Need) -> Dimensions:
        """Return the dimensions of this robot's tables."""
        results = [group.result for group in self.groups]
        if not results or (len(results) == 1 and all(axis is None for axis in results[0].axes.values())):
            return Dimensions(self._sizes, self._dearest, width, most)
        tables = [
            TableSizes(
                min(one.dearest, EXACT), {name: encoded(axis, self._sizes[name]) for name, axis in one.axes.items()}
            )
            for one in results
        ]
        return SplitDimensions(self._sizes, self._dearest, width, most, tables)

    def _plan(self) -> None:
        """Prepare the memory needs, after the sizes of the separator are known. DPOP itself has nothing to prepare."""

    def _send_dimensions(self, dimensions: Dimensions) -> None:
        """Send the parent the dimensions of this robot's table."""
        self.send(self.parent or "", dimensions)

    def _store_dimensions(self, child: str, dimensions: Dimensions) -> None:
        """Store the dimensions of a child's tables."""
        self._check_dimensions(child, dimensions)
        outlines = outlines_of(child, dimensions) if isinstance(dimensions, SplitDimensions) else None
        store_once(child, dimensions, self.dimensions, self.children)
        if outlines is not None:
            self._outlines[child] = outlines

    def _check_dimensions(self, child: str, dimensions: Dimensions) -> None:
        """Raise `ValueError` unless `dimensions` are possible."""
        if not (
            len(dimensions.separator) <= MOST_AXES and dimensions.induced_width >= 0 and dimensions.most.bytes >= 0
        ):
            axes, width = len(dimensions.separator), dimensions.induced_width
            raise ValueError(
                f"{child} sent invalid dimensions: {axes:,} axes (at most {MOST_AXES:,}), induced width {width:,}, and"
                f" {dimensions.most.bytes:,} bytes"
            )

    def _check_limits(self, most: Need, width: int) -> None:
        """Raise `TooLargeError` if the largest memory need of the whole tree is above the limit.

        If tables have to be on the disk, the free space of this robot's computer is a limit, too.
        """
        check_exact(self._dearest)
        settings = self.settings
        needs = f"{most.robot} needs {_bytes_text(most.bytes)} for its tables"
        if most.bytes > settings.most:
            raise TooLargeError(
                f"{needs}, more than {settings.limit_in_words}: the robots' pseudo-tree has induced width {width}"
                f" ({settings.remedy})"
            )
        if most.bytes > settings.memory and most.bytes > free_disk_bytes():
            raise TooLargeError(
                f"{needs}, and the folder for temporary files has only {free_disk_bytes():,} bytes left (free space"
                " there, or choose another folder by the environment variable TMPDIR)"
            )

    @property
    def _on_disk(self) -> bool:
        """True if this robot's tables have to be on the disk."""
        return self._need.bytes > self.settings.memory

    def _separator_sizes(self, checked: Sequence[Scope]) -> dict[str, int]:
        """Return the separator, with each robot's domain size.

        The separator contains the ancestors that share a constraint with this robot or with a robot below it.
        """
        sizes = {name: len(self.domains[name]) for scope in checked for name in scope}
        own = len(self.problem.values)
        for child in self.children:
            for name, size in self.dimensions[child].separator.items():
                if size != (own if name == self.problem.agent else sizes.setdefault(name, size)):
                    raise ValueError(f"{child} sent a wrong domain size: {size:,} values of {name}")
        return {name: size for name, size in sizes.items() if size > 1}

    def _upper_bound(self, checked: Sequence[float]) -> int:
        """Return an upper bound on the cost of this robot's subtree if no hard constraint is broken."""
        own = max((charge for charge in self.problem.charges if charge < math.inf), default=0)
        below = sum(self.dimensions[child].dearest for child in self.children)
        return min(int(own + sum(checked) + below), EXACT)

    def _memory_need(self) -> Need:
        """Return the memory that this robot's tables need: an integer, if it is small enough for a message."""
        inputs = [Extent(math.prod(self._lengths(scope)), 8) for scope in self._checked]
        for child in self.children:
            inputs += self._child_extents(child)
        need = bytes_of(self._results(), inputs) + self._additional_bytes(inputs)
        return Need(need if need < EXACT else _nearest(need), self.problem.agent)

    def _results(self) -> list[Result]:
        """Return the sizes of this robot's tables, with their axes in any order."""
        if self._parts is None:
            return [Result(self._own_sizes(), len(self.problem.values), width_of(self._dearest))]
        return [
            Result(group.result.shape(self._sizes), len(group.values), width_of(min(group.result.dearest, EXACT)))
            for group in self.groups
        ]

    def _child_extents(self, child: str) -> list[Extent]:
        """Return the sizes of a child's tables."""
        dimensions, outlines = self.dimensions[child], self._outlines.get(child)
        if not outlines:
            return [Extent(math.prod(self._child_sizes(child)), width_of(dimensions.dearest))]
        return [Extent(math.prod(one.shape(dimensions.separator)), width_of(one.dearest)) for one in outlines]

    def _lengths(self, scope: TableScope) -> list[int]:
        """Return the shape of the table of a constraint that this robot checks."""
        sizes = [*(len(self.domains[name]) for name in scope.agents), len(self.problem.values)]
        return sizes if scope.places is None else list(map(length_of, self._partitions_of(scope), sizes))

    def _partitions_of(self, scope: TableScope) -> list[Partition]:
        """Return the partitions of the other robots' values, then of this robot's, by the variables in a constraint."""
        robots = (*scope.agents, self.problem.agent)
        return [None] * len(robots) if scope.places is None else list(map(self._partition, robots, scope.places))

    def _values_of(self, robot: str) -> Sequence[Value]:
        """Return the values of this robot, or of a neighbour above."""
        return self.problem.values if robot == self.problem.agent else self.domains[robot]

    def _partition(self, robot: str, places: tuple[int, ...]) -> Partition:
        """Return the partition of the values of this robot, or of a neighbour above, by some of its variables."""
        if (robot, places) not in self._partitions:
            self._partitions[robot, places] = partition_of(self._values_of(robot), places)
        return self._partitions[robot, places]

    def _own_sizes(self) -> list[int]:
        """Return the shape of this robot's table, with its axes in any order."""
        return list(self._sizes.values())

    def _child_sizes(self, child: str) -> list[int]:
        """Return the shape of a child's table, with its axes in any order."""
        return list(self.dimensions[child].separator.values())

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes of arrays that are stored longer than a join of `inputs`. DPOP itself has none."""
        del inputs
        return 0

    def _proceed(self, separator: Sequence[str]) -> None:
        """Make the tables of this robot's constraints, after the children have been allowed to make theirs."""
        self._check_axes(separator, expected=self.separator is None)
        self.separator = tuple(separator)
        for child in self.children:
            self._let_proceed(child)
        self._start_utils()

    def _check_axes(self, separator: Sequence[str], *, expected: bool) -> None:
        """Raise `ValueError` unless axes are `expected` now, match the separator, and tables fit in memory."""
        if sorted(separator) != sorted(self._sizes) or not expected:
            own = ", ".join(self._sizes)
            raise ValueError(f"{self.problem.agent} received unexpected axes {list(separator)}; its separator is {own}")
        if self._need.bytes > self.settings.most:
            raise ValueError(f"{self.problem.agent} must proceed, but its tables exceed the limit of memory")

    def _let_proceed(self, child: str) -> None:
        """Send a child the axes of its table, the nearest robot first."""
        needed = self.dimensions[child].separator
        self._axes[child] = tuple(name for name in (self.problem.agent, *(self.separator or ())) if name in needed)
        self.send(child, Proceed(list(self._axes[child])))

    def _start_utils(self) -> None:
        """Make the tables of this robot's constraints; a leaf computes its table at once."""
        tables = self.problem.tables({name: self.domains[name] for name in self.ancestors})
        whole = self._parts is None
        self._made = [
            (costs_of(table) if whole else table.charges, (*table.agents, self.problem.agent)) for table in tables
        ]
        del tables
        if not self.children:
            self._compute_utils()

    # UTIL, from the leaves up

    def _util_message_handler(self, child: str, width: Width, costs: bytes) -> None:
        """Store a piece of the child's table; compute this robot's table when all children's tables are complete."""
        if child not in self._axes:
            raise ValueError(f"{child} sent a table without a request")
        if child not in self.utils:
            shapes = self._shapes_below(child)
            tables = [IncomingTable(shape, dearest, on_disk=self._on_disk) for shape, dearest in shapes]
            self.utils[child] = IncomingTables(tables)
        self.utils[child].add(width, costs)
        if self._all_arrived:
            self._compute_utils_of_all()

    @property
    def _all_arrived(self) -> bool:
        """True if all children's tables of costs are complete."""
        return len(self.utils) == len(self.children) and all(table.complete for table in self.utils.values())

    def _table_axes(self, child: str) -> Sequence[str]:
        """Return the robots that the axes of a child's table belong to."""
        return self._axes[child]

    def _axes_below(self, child: str) -> list[Sequence[str]]:
        """Return, for each of a child's tables, the robots that its axes belong to."""
        if child not in self._outlines:
            return [self._table_axes(child)]
        return [[name for name in self._table_axes(child) if name in one.axes] for one in self._outlines_of(child)]

    def _shapes_below(self, child: str) -> list[tuple[list[int], int]]:
        """Return the shapes of a child's tables, and the upper bounds on their costs."""
        dimensions = self.dimensions[child]
        sizes = dimensions.separator
        if child not in self._outlines:
            return [([sizes[name] for name in self._table_axes(child)], dimensions.dearest)]
        outlines = zip(self._outlines[child], self._axes_below(child), strict=True)
        return [([length_of(one.axes[name], sizes[name]) for name in axes], one.dearest) for one, axes in outlines]

    def _compute_utils_of_all(self) -> None:
        """Join the children's tables, all of which have arrived, and free them."""
        for child in self.children:
            for table, axes in zip(self.utils[child].tables, self._axes_below(child), strict=True):
                self._made.append((table.costs, axes))
        self.utils.clear()
        self._compute_utils()

    @overload
    def _aligned(self, table: Table, axes: Sequence[str]) -> Table: ...

    @overload
    def _aligned(self, table: Table | CoarseTable, axes: Sequence[str]) -> Table | CoarseTable: ...

    def _aligned(self, table: Table | CoarseTable, axes: Sequence[str]) -> Table | CoarseTable:
        """Return `table` with this robot's axis first and the other axes in the order of its separator."""
        return aligned(table, axes, (self.problem.agent, *(self.separator or ())))

    def _compute_utils(self) -> None:
        """Compute the minimum cost of the subtree for each combination of values in the separator."""
        if self._parts is None:
            shape = [self._sizes[name] for name in self.separator or ()]
            self._joined = [self._aligned(table, axes) for table, axes in self._made]
            found = [project(shape, self.problem.charges, self._joined, self._dearest, on_disk=self._on_disk)]
        else:
            found = [self._projected_group(group) for group in self.groups]
        self._made.clear()
        self.choices = [one.choices for one in found]
        self._process_joined(found[0].costs)
        self._joined.clear()
        self._send_or_choose(*[one.costs for one in found])

    def _projected_group(self, group: Group) -> Projection:
        """Join the tables of a group, and minimise over this robot's values."""
        result = group.result
        onto = [name for name in self.separator or () if name in result.axes]
        shape = [length_of(result.axes[name], self._sizes[name]) for name in onto]
        tables = [self._in_join(group, number, onto) for number in group.inputs]
        return project(shape, group.charges, tables, result.dearest, on_disk=self._on_disk)

    def _in_join(self, group: Group, number: int, onto: Sequence[str]) -> Table | CoarseTable:
        """Return the table with this `number` as a part of the join of `group`, with the axes `onto`."""
        (table, axes), (outline, own) = self._made[number], self._to_join[number]
        places: dict[str, Places | None] = {
            name: mapped(axis, places_of(group.result.axes[name], self._sizes[name]))
            for name, axis in outline.axes.items()
        }
        if own is not NO_AXIS:
            places[self.problem.agent] = mapped(own, group.values)
        return aligned(coarse(table, [places.get(name) for name in axes]), axes, (self.problem.agent, *onto))

    def _process_joined(self, costs: Codes) -> None:
        """Compute further results from the joined tables, besides the least `costs`. DPOP itself has none."""

    def _send_or_choose(self, *tables: Codes) -> None:
        """Send tables to the parent; a root chooses its value, and a table without a finite cost ends the search."""
        if any(map(are_all_infinite, tables)):
            self.conclude(Verdict.NO_SOLUTION)
        elif self.parent is None:
            self.optimum = sum([int(costs.item()) for costs in tables])
            self._choose_optimal([])
        else:
            for costs in tables:
                self._send_table(costs)

    def _send_table(self, costs: Codes) -> None:
        for width, piece in packed_costs(costs):
            self.send(self.parent or "", UTIL(width, piece))

    # VALUE, from the root down

    def _value_message_handler(self, assignment: Sequence[int]) -> None:
        """Process the values of the separator's robots."""
        separator = self.separator or ()
        if len(assignment) != len(separator) or not all(
            0 <= index < self._sizes[name] for name, index in zip(separator, assignment, strict=True)
        ):
            raise ValueError(f"{assignment} are not values of {', '.join(separator)}")
        self._choose_optimal(assignment)

    def _choose_optimal(self, assignment: Sequence[int]) -> None:
        """Choose the cheapest value, and send the children the values of their separators."""
        if self.choices is None:
            raise ValueError(f"{self.problem.agent} already has a value, or has no table yet")
        self.value = self._best_value(self.choices, assignment)
        self.choices = None
        agent_view: Mapping[str, int] = dict(
            zip((self.problem.agent, *(self.separator or ())), (self.value, *assignment), strict=True)
        )
        for child in self.children:
            self.send(child, VALUE([agent_view[name] for name in self._axes[child]]))

    def _best_value(self, choices: Sequence[Codes], assignment: Sequence[int]) -> int:
        """Return the index of this robot's cheapest value for these values in the separator."""
        if self._parts is None:
            return int(choices[0][tuple(assignment)])
        chosen = []
        for group, table in zip(self.groups, choices, strict=True):
            axes = group.result.axes
            known = zip(self.separator or (), assignment, strict=True)
            at = [code_of(axes[name], place) for name, place in known if name in axes]
            chosen.append((group, int(group.values[table[tuple(at)]])))
        return self._parts.value(chosen)


def costs_of(table: CostTable) -> Table | CoarseTable:
    """Return the costs of a constraint, whose axes belong to the other robots and then to this robot."""
    lengths = table.charges.shape
    if lengths == tuple(map(len, table.codes)):
        return table.charges
    places = [
        None if len(codes) == length else np.array(codes, np.intp)
        for codes, length in zip(table.codes, lengths, strict=True)
    ]
    return coarse(table.charges, places)


def outlines_of(child: str, dimensions: SplitDimensions) -> list[Outline]:
    """Return the outlines of a child's tables. Raises `ValueError` if they are invalid."""
    sizes = dimensions.separator
    if not dimensions.tables or not all(one.axes.keys() <= sizes.keys() for one in dimensions.tables):
        raise ValueError(f"{child} sent invalid dimensions: no tables, or axes of robots outside its separator")
    return [
        Outline(one.dearest, {name: decoded(codes, sizes[name]) for name, codes in one.axes.items()})
        for one in dimensions.tables
    ]


def store_once(sender: str, item: T, received: dict[str, T], senders: Sequence[str]) -> None:
    """Store the one message that each of `senders` sends.

    Raises:
        ValueError: if `sender` is not one of them, or has already sent one.
    """
    if sender not in senders or sender in received:
        raise ValueError(f"{sender} sent an unexpected or repeated message")
    received[sender] = item


def _nearest(number: int) -> float:
    """Return the nearest float, for integers of any size."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


def _bytes_text(size: float) -> str:
    """Return a number of bytes in words."""
    if size == math.inf:
        return "more than 10^308 bytes"
    return f"{size:,} bytes" if size < EXACT else f"{size:.1e} bytes"
