"""Approximate DPOP (ADPOP): DPOP whose tables have a limited number of axes, with bounds from both sides.

DPOP (see `dpop.py`) sends tables with an axis for each robot in the separator. Here a robot removes axes from its table
until the limit is met. A table without an axis contains a lower and an upper bound on the cost of the subtree: the
minimum and the maximum over the values of the removed robot. Both bounds go up the tree, and values go down.

- **When to use**: costs, and an induced width that is too large for DPOP; a bound on the error is needed.
- **Guarantees**: incomplete; the number of messages is linear. The root reports a lower bound on the optimum. The
  result costs at most as much as the root's upper bound, which is known before a value is chosen. If the two are equal,
  the result is optimal, and a run reports `optimal`. With `ratio`, the result costs at most `ratio` times the optimum.
  If an axis of a hard constraint is removed, the upper bound may be infinite, and the result may break the
  constraint: then only the lower bound is guaranteed. A table without a finite lower bound proves that there is no
  solution.
- **Parameters (`--set`)**: `axes`, the maximum number of axes of a table that is sent (default 3); `ratio`, the maximum
  quotient of the result's cost and the optimum (1 or more; default 0: the number of axes is limited instead). Costs are
  counted from the minimum of each constraint if there are negative costs or utilities.
- **Reference**: Petcu, Faltings: "Approximations in distributed optimization", CP 2005. The text of the paper was not
  available. This implementation follows its principle: one propagation of bounds whose largest message depends on the
  permitted error, similar to mini-buckets on a pseudo-tree. Details may differ from the paper's.

    Limit of axes     `_within_limit`     UTIL with both bounds    `Bounds`
    Limit of errors   `_within_ratio`     VALUE                    `_choose`

Choices of this implementation:

- With `axes`, axes are removed from each table before the tables are joined (mini-buckets), so that no larger table is
  ever made. With `ratio`, they are removed from the joined table, as long as each upper bound is at most `ratio` times
  its lower bound. Sums and minima keep this quotient, so it also holds at the root.
- The axis that makes the smallest difference is removed first: the sum over all tables of the largest difference that
  this robot's value can make. Ties go to the robot with the lowest priority.
- A join has at most 2^19 cells. With `axes`, further axes are removed if domains are large; with `ratio`, the run ends.
- Values go down with those of all robots in the separator, also of robots whose axes have been removed. A robot adds up
  its costs and its children's bounds for these values, and chooses the value with the lowest upper bound; ties go to
  the lowest lower bound, and then to the first value. Only the upper bound limits the error before a value is chosen.
- Tables distinguish all values of a robot with several variables, unlike those of `dpop`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), ADPOP, Concurrent(seed=0)).search()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, assert_never, cast

import msgspec
import numpy as np

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import HasValue, Proof, Reception
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.dpop import MOST_AXES, Domain, Size, store_once
from robochoc.protocols.inference.dpop_tables import Array, Width, aligned, width_of
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted, listed

MOST_CELLS = 1 << 19
"""The maximum number of cells of a join; a message with two tables is then smaller than a frame of the network."""


class ADPOPSettings(Settings, frozen=True):
    """`axes`: the maximum number of axes of a table. `ratio`: the maximum quotient of the result and the optimum.

    With a `ratio` of 1 or more, tables have as many axes as this quotient needs, and `axes` has no effect.
    """

    axes: int = 3
    ratio: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.axes <= MOST_AXES:
            raise ValueError(f"axes is {self.axes}; it must be a number of axes from 0 to {MOST_AXES:,}")
        if self.ratio and not 1 <= self.ratio < math.inf:
            raise ValueError(f"ratio is {self.ratio}; it must be 1 or more (0: no limit)")


class Bounds(Message, frozen=True):
    """The sender's table of lower and upper bounds on the cost of its subtree, for each combination of values.

    `axes` are the robots of its axes with their domain sizes, `separator` all robots that matter to the subtree. The
    bounds are unsigned little-endian integers of `width` bytes; the largest number represents `inf`. Without `upper`,
    both bounds are the same. `most` is an upper bound on all finite costs.
    """

    separator: list[str]
    axes: dict[str, Size]
    width: Width
    lower: bytes
    upper: bytes
    most: float

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in self.axes.items()])
        where = f" for each combination of values of {axes}" if axes else ""
        how = "bounds on the costs" if self.upper else "the costs"
        left_out = [robot for robot in self.separator if robot not in self.axes]
        removed = f"; {listed(left_out)} may have any values" if left_out else ""
        return f"these are {how} of my subtree{where}{removed}"

    def proves(self, reception: Reception) -> Sequence[Proof] | None:
        """Return None: there is no rule for bounds over several robots' values."""
        del reception
        return None


class Places(Message, frozen=True):
    """The values of the robots in the receiver's separator, as indices, in the order of the receiver's `Bounds`."""

    assignment: list[int]

    act = Act(Performative.INFORM, "the receiver learns the values above it")

    def in_words(self, _: Wording) -> str:
        places = listed([str(place + 1) for place in self.assignment])
        return f"by number, the values of the robots in your separator are {places}" if places else "choose your value"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        bounds = reception.last(Bounds, reception.receiver, reception.sender)
        robots = bounds.separator if isinstance(bounds, Bounds) else []
        known = [(robot, reception.values(robot), place) for robot, place in zip(robots, self.assignment, strict=False)]
        return [HasValue(robot, values[place]) for robot, values, place in known if values is not None]


class Table(NamedTuple):
    """Lower and upper bounds on a cost, with an axis for each of the robots in `axes`."""

    axes: tuple[str, ...]
    lower: Array
    upper: Array

    def without(self, robot: str) -> Table:
        """Return this table without the axis of `robot`: the extreme bounds over its values."""
        axis = self.axes.index(robot)
        left = (*self.axes[:axis], *self.axes[axis + 1 :])
        return Table(left, self.lower.min(axis=axis), self.upper.max(axis=axis))

    def difference(self, robot: str) -> float:
        """Return the largest difference between bounds that the value of `robot` can make; 0 without its axis."""
        if robot not in self.axes:
            return 0.0
        left = self.without(robot)
        return float(
            np.subtract(left.upper, left.lower, out=np.zeros_like(left.upper), where=left.lower < np.inf).max()
        )

    def at(self, places: Mapping[str, int], own: str) -> tuple[Array, Array]:
        """Return the bounds for each value of `own`, or a single one without its axis; others have these `places`."""
        index = tuple([slice(None) if name == own else places[name] for name in self.axes])
        return np.atleast_1d(self.lower[index]), np.atleast_1d(self.upper[index])


@mypyc_attr(allow_interpreted_subclasses=True)
class ADPOP(TreeProtocol):
    """One agent of ADPOP.

    `tables` are the children's tables. `separator` are the robots above that matter to this robot's subtree. A root
    knows the bounds on the cost of its tree: `least` and `most`.
    """

    messages: ClassVar[Any] = TreeMessage | Domain | Bounds | Places
    settings: ClassVar[ADPOPSettings] = ADPOPSettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2005",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs, width too large for dpop: bounds on the error",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.domains: dict[str, list[Value]] = {}
        self.tables: dict[str, Table] = {}
        self.separators: dict[str, list[str]] = {}
        self.separator: tuple[str, ...] = ()
        self.least: float | None = None
        self.most: float = 0
        self._sizes: dict[str, int] = {problem.agent: len(problem.values)}
        self._dearest: float = 0
        self._announced: dict[str, Bounds] = {}

    @property
    def findings(self) -> Findings:
        """The position in the tree; for a root also the lower bound on the cost of its tree."""
        return msgspec.structs.replace(super().findings, bound=self.least)

    @property
    def most_above_bound(self) -> float | None:
        """At a root, the difference of its bounds."""
        return None if self.least is None else self.most - self.least

    def start_in_tree(self) -> None:
        """Send the domain to the neighbours below."""
        for name in self.descendants:
            self.send(name, Domain(list(self.problem.values)))
        self._compute()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | Bounds | Places", message):
            case Domain(values):
                store_once(sender, values, self.domains, self.ancestors)
                self._sizes[sender] = len(values)
                self._compute()
            case Bounds() as bounds:
                store_once(sender, bounds, self._announced, self.children)
                self._compute()
            case Places(assignment):
                self._receive_places(sender, assignment)
            case never:
                assert_never(never)

    # Bounds, from the leaves up

    def _compute(self) -> None:
        """Make this robot's table, once all domains and the children's tables are known."""
        if len(self.domains) < len(self.ancestors) or len(self._announced) < len(self.children):
            return
        for child in self.children:
            self._store_table(child, self._announced[child])
        tables = [*self._own_tables(), *self.tables.values()]
        self._find_separator()
        joined = self._within_ratio(tables) if self.settings.ratio else self._within_limit(tables)
        if joined.lower.min() == math.inf:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.parent is None:
            check_exact(self._dearest)
            self.least, self.most = _number(joined.lower), _number(joined.upper)
            self._choose({})
        else:
            self.send(self.parent, self._bounds(joined))

    def _store_table(self, child: str, bounds: Bounds) -> None:
        """Store a child's table. Raises `ValueError` if it is invalid."""
        for name, size in bounds.axes.items():
            if name not in bounds.separator or self._sizes.setdefault(name, size) != size:
                raise ValueError(f"{child} sent an invalid axis: {name} with {size:,} values")
        known = len({*bounds.separator}) == len(bounds.separator) <= MOST_AXES
        if not known or not bounds.most >= 0 or math.prod(bounds.axes.values()) > MOST_CELLS:
            raise ValueError(f"{child} sent an invalid table: repeated robots, negative costs, or too many cells")
        lower = _unpacked(child, bounds.lower, bounds)
        upper = _unpacked(child, bounds.upper, bounds) if bounds.upper else lower
        if bool((lower > upper).any()):
            raise ValueError(f"{child} sent a lower bound above its upper bound")
        self.tables[child] = Table(tuple(bounds.axes), lower, upper)
        self.separators[child] = bounds.separator
        self._dearest += bounds.most

    def _own_tables(self) -> Iterable[Table]:
        """Return the tables of this robot's constraints with robots above, and of its private costs."""
        yield self._table([self.problem.agent], np.array([float(cost) for cost in self.problem.charges]))
        for table in self.problem.tables({name: self.domains[name] for name in self.ancestors}):
            yield self._table([*table.agents, self.problem.agent], table.joined())

    def _table(self, axes: Sequence[str], costs: Array) -> Table:
        """Return a table of exact costs, and add the largest of them to the upper bound on all costs."""
        self._dearest += float(costs.max(initial=0, where=costs < math.inf))
        return Table(tuple(axes), costs, costs)

    def _find_separator(self) -> None:
        """Find the robots above that share a constraint with this robot or with a robot below it."""
        own = [name for scope in self.problem.scopes_in_tables(self.ancestors) for name in scope.agents]
        below = [name for names in self.separators.values() for name in names]
        self.separator = tuple(dict.fromkeys(name for name in (*own, *below) if name != self.problem.agent))

    def _within_limit(self, tables: Sequence[Table]) -> Table:
        """Join `tables` without the axes above the limit, and minimise over this robot's values."""
        for name in self._removable(tables):
            axes = self._axes(tables)
            if len(axes) <= self.settings.axes and self._cells(axes) <= MOST_CELLS:
                break
            tables = [table.without(name) if name in table.axes else table for table in tables]
        return self._projected(tables)

    def _within_ratio(self, tables: Sequence[Table]) -> Table:
        """Join `tables` and minimise over this robot's values, and remove the axes that the ratio allows."""
        cells = self._cells(self._axes(tables))
        if cells > MOST_CELLS:
            raise TooLargeError(
                f"{self.problem.agent} would need a table of {cells:,} cells, more than {MOST_CELLS:,}: use a larger"
                " ratio (--set ratio=R), or limit the axes instead (--set axes=N)"
            )
        joined = self._projected(tables)
        for name in self._removable([joined]):
            fewer = joined.without(name)
            if bool((fewer.upper <= self.settings.ratio * fewer.lower).all()):
                joined = fewer
        return joined

    def _axes(self, tables: Sequence[Table]) -> list[str]:
        """Return the axes of the joined table, in the order of the separator."""
        named = {name for table in tables for name in table.axes}
        return [name for name in self.separator if name in named]

    def _cells(self, axes: Sequence[str]) -> int:
        return math.prod([len(self.problem.values), *(self._sizes[name] for name in axes)])

    def _removable(self, tables: Sequence[Table]) -> list[str]:
        """Return the axes in the order in which they are removed."""
        weights = {name: sum(table.difference(name) for table in tables) for name in self._axes(tables)}
        return sorted(weights, key=lambda name: (weights[name], -self.order.rank[name]))

    def _projected(self, tables: Sequence[Table]) -> Table:
        """Return the sum of `tables`, minimised over this robot's values."""
        axes = self._axes(tables)
        onto = (self.problem.agent, *axes)
        shape = [self._sizes[name] for name in onto]
        lower, upper = np.zeros(shape), np.zeros(shape)
        for table in tables:
            lower += aligned(table.lower, table.axes, onto)
            upper += aligned(table.upper, table.axes, onto)
        return Table(tuple(axes), lower.min(axis=0), upper.min(axis=0))

    def _bounds(self, joined: Table) -> Bounds:
        """Return the message with a table. Axes of robots with a single value are left out."""
        check_exact(self._dearest)
        for name in joined.axes:
            joined = joined.without(name) if self._sizes[name] == 1 else joined
        exact = bool((joined.lower == joined.upper).all())
        finite = [int(costs.max(initial=0, where=costs < math.inf)) for costs in (joined.lower, joined.upper)]
        width = width_of(max(finite))
        axes = {name: self._sizes[name] for name in joined.axes}
        upper = b"" if exact else _packed(joined.upper, width)
        return Bounds(list(self.separator), axes, width, _packed(joined.lower, width), upper, self._dearest)

    # Values, from the root down

    def _receive_places(self, sender: str, assignment: Sequence[int]) -> None:
        """Process the values of the separator's robots."""
        sizes = [self._sizes.get(name, EXACT) for name in self.separator]
        wrong = len(assignment) != len(sizes) or not all(map(range.__contains__, map(range, sizes), assignment))
        if sender != self.parent or self.value is not None or wrong:
            raise ValueError(f"{sender} sent unexpected values: {list(assignment)}, for {', '.join(self.separator)}")
        self._choose(dict(zip(self.separator, assignment, strict=True)))

    def _choose(self, places: Mapping[str, int]) -> None:
        """Choose the value with the lowest upper bound for the values above; send the children their values."""
        view = {name: values[places[name]] for name, values in self.domains.items() if name in places}
        lower = np.array([float(cost) for cost in self.problem.costs(view)])
        upper = lower.copy()
        for table in self.tables.values():
            least, most = table.at(places, self.problem.agent)
            lower, upper = lower + least, upper + most
        self.value = int(np.lexsort((lower, upper))[0])
        known = {**places, self.problem.agent: self.value}
        for child in self.children:
            self.send(child, Places([known[name] for name in self.separators[child]]))


def _number(costs: Array) -> float:
    """Return the only cost in a table; an integer if it is finite."""
    cost = float(costs.item())
    return int(cost) if cost < math.inf else cost


def _packed(costs: Array, width: Width) -> bytes:
    """Return costs as integers of `width` bytes; the largest integer represents `inf`."""
    infinite = np.isinf(costs)
    codes = np.where(infinite, 0, costs).astype(f"<u{width}")
    codes[infinite] = np.iinfo(codes.dtype).max
    return codes.tobytes()


def _unpacked(child: str, costs: bytes, bounds: Bounds) -> Array:
    """Return the costs in a message. Raises `ValueError` if their number is wrong."""
    shape = tuple(bounds.axes.values())
    if len(costs) != math.prod(shape) * bounds.width:
        raise ValueError(f"{child} sent {len(costs):,} bytes of costs, not {math.prod(shape) * bounds.width:,}")
    codes = np.frombuffer(costs, f"<u{bounds.width}")
    return np.where(codes == np.iinfo(codes.dtype).max, np.inf, codes).astype(np.float64).reshape(shape)
