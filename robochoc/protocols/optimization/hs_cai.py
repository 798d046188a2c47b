"""HS-CAI: search with context-based inference.

Complete search for minimum cost on a pseudo-tree, with lower bounds from tables. Before the search each robot sends its
parent a table of its subtree's least costs (PREUTIL), as in DPOP, but over at most k robots: the other robots above are
left out, so the table is a lower bound. Then subtrees are searched in parallel, and values are tried by increasing
bound, without requests for bounds. When the values of omitted robots stay the same for more than t searches, a robot
requests new tables from its children for these values (INFERCTXT, CTXTUTIL). The new bounds are tighter while the
values stay the same. The search continues meanwhile.

- **When to use**: costs, few but larger messages, a pseudo-tree too wide for DPOP.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. No table is over
  more than k robots, or has more than 131,072 cells.
- **Parameters (`--set`)**: `k`, the maximum number of robots of a table (default 4), and `t`, the number of searches
  with the same values before bounds are inferred with them (default 1).
- **Reference**: Chen, Zhang, Deng, Chen, Li: "HS-CAI: a hybrid DCOP algorithm via combining search with context-based
  inference", AAAI 2020.

The messages have the names in the paper, except BACKTRACK, which is `Result`. The framework of the search is in
`branching`.

Choices that the paper leaves open, and differences:

- Constraints may be n-ary: the lowest robot in the scope pays them. There may be several trees.
- The highest robots are left out of a table. Each summand is minimised over them separately.
- Robots first send their domain and depth to the robots below (`Domain`). A CPA contains the values that matter to the
  subtree.
- A robot infers with all values that have stayed the same long enough, for one table of a child at a time.
- Constraints are checked once for the tables, and again with each CPA. Sums and minima of tables are not checks.
- Costs are integers, added in float64. If they could reach 2^53, they would not be exact, and the run ends.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), HSCAI, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple, assert_never, cast

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import INFINITE
from robochoc.protocols import acts, message
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import HasOnly, Proof, Reception, table_proves
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.branching import BranchingProtocol, Number, Result, Terminate, allowance
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import listed

MOST_CELLS = 1 << 17
"""The maximum number of cells in a table and in its message; while it is computed, for each value of the robot."""


class RobotTable(NamedTuple):
    """Costs, with an axis for each robot in `names`.

    `codes` contains, for each robot, the index of each value on its axis; None if the values are the indices. It is
    empty if all are None.
    """

    names: tuple[str, ...]
    costs: NDArray[np.float64]
    codes: Sequence[Sequence[int] | None] = ()

    def at(self, places: Mapping[str, int]) -> RobotTable:
        """Return the part of the table for these robots' values, given as indices."""
        coded = [*zip(self.names, self.codes or [None] * len(self.names), strict=True)]
        index = tuple(
            [
                slice(None) if name not in places else places[name] if codes is None else codes[places[name]]
                for name, codes in coded
            ]
        )
        left = [one for one in coded if one[0] not in places]
        return RobotTable(tuple(name for name, _ in left), self.costs[index], [codes for _, codes in left])

    def over(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the least costs with an axis for each of `names`, in this order; of length 1 if the table has none."""
        gone = tuple(axis for axis, name in enumerate(self.names) if name not in names)
        left = [name for name in self.names if name in names]
        least = self.costs.min(axis=gone)
        codes = [one for name, one in zip(self.names, self.codes, strict=True) if name in names] if self.codes else []
        for axis, coded in enumerate(codes):
            least = least if coded is None else least.take(coded, axis)
        least = least.transpose([left.index(name) for name in names if name in left])
        aligned: NDArray[np.float64] = least[tuple([slice(None) if name in left else np.newaxis for name in names])]
        return aligned


def limited_axes(axes: Sequence[Axis], most: int) -> list[Axis]:
    """Return the axes that a table may have: the lowest robots, at most `most`, within the cell limit."""
    kept: list[Axis] = []
    for axis in sorted(axes, key=lambda axis: axis[1], reverse=True)[:most]:
        if math.prod([size for _, _, size in kept]) * axis[2] > MOST_CELLS:
            break
        kept.append(axis)
    return kept[::-1]


def least_over(axes: Sequence[Axis], own: str, charges: Sequence[Number], tables: Sequence[RobotTable]) -> list[Number]:
    """Return the least sum of `charges` and `tables` over the robot's values, for each combination of values on `axes`.

    Each table is minimised separately over robots that are not in `axes`, so the sum is a lower bound.
    """
    shape = [size for _, _, size in axes]
    names = [name for name, _, _ in axes]
    least = np.full(shape, np.inf)
    parts = [table.over([own, *names]) for table in tables]
    for index, charge in enumerate(charges):
        total = np.full(shape, float(charge))
        for part in parts:
            total = total + part[index if part.shape[0] > 1 else 0]
        least = np.minimum(least, total)
    return [number_of(cost) for cost in least.reshape(-1).tolist()]


def table_of(axes: Sequence[Axis], costs: Sequence[Number]) -> RobotTable:
    """Return the table in a message.

    Raises:
        ValueError: if the number of costs does not match the axes, or is too large.
    """
    shape = [size for _, _, size in axes]
    if min(shape, default=1) < 1 or math.prod(shape) != len(costs) or len(costs) > MOST_CELLS:
        raise ValueError(f"{len(costs)} costs do not form a table of {shape}")
    return RobotTable(tuple(name for name, _, _ in axes), np.array(costs, np.float64).reshape(shape))


def number_of(cost: float) -> Number:
    """Return a cost as an integer, or infinity."""
    return int(cost) if cost < INFINITE else INFINITE


class HSCAISettings(Settings, frozen=True):
    """The amount of inference before and during the search.

    `k`: the maximum number of robots above in a table. From the tree's induced width on, all bounds are exact.
    `t`: a robot requests new bounds when a value above has stayed the same for more than `t` searches.
    """

    k: int = 4
    t: int = 1

    def __post_init__(self) -> None:
        for name, number in (("k", self.k), ("t", self.t)):
            if number < 1:
                raise ValueError(f"{name} is {number}; it must be 1 or more")


Axis = tuple[str, int, int]
"""A robot, its depth in the tree, and the number of its values."""


class Domain(Message, frozen=True):
    """The sender's values, and its depth in the tree."""

    values: list[message.Value]
    level: int

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return f"{words.domain(self.values)}; my depth in the tree is {self.level}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values))]


class PreUtil(Message, frozen=True):
    """A lower bound on the cost of the sender's subtree for all values of the robots in `axes` (PREUTIL).

    `dropped`: other robots above that matter to the subtree; the bound holds for all their values. `dearest`: an upper
    bound on the cost of a solution of the subtree.
    """

    axes: list[Axis]
    dropped: list[Axis]
    dearest: int
    costs: list[Number]

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        names = listed(name for name, _, _ in self.axes)
        told = f"my subtree costs {span_in_words(self.costs)}, by the values of {names or 'nobody'}"
        return f"{told}; left out: {listed(name for name, _, _ in self.dropped)}" if self.dropped else told

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return bounds_prove(self.axes, self.costs, reception)


class CPA(Message, frozen=True):
    """A request to search the receiver's subtree for a cost below `bound` (CPA).

    `places`: the values of the robots above that matter to the subtree, as indices in their domains.
    """

    bound: Number
    places: dict[str, int]

    act = acts.PROPOSE_CPA
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"search your subtree {allowance(self.bound)}, with {places_in_words(self.places)}"


class InferCtxt(Message, frozen=True):
    """A request for a tighter table for these values, given as indices (INFERCTXT)."""

    places: dict[str, int]

    act = Act(Performative.REQUEST, "the receiver must infer a tighter lower bound")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"what does your subtree cost at least with {places_in_words(self.places)}?"


class CtxtUtil(Message, frozen=True):
    """A lower bound as in PREUTIL, for the values in the receiver's request (CTXTUTIL)."""

    axes: list[Axis]
    costs: list[Number]

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        names = listed(name for name, _, _ in self.axes)
        return f"with these values my subtree costs {span_in_words(self.costs)}, by the values of {names or 'nobody'}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return bounds_prove(self.axes, self.costs, reception)


def places_in_words(places: dict[str, int]) -> str:
    """Return values in words, given as indices."""
    return listed([f"{name}'s value number {place + 1}" for name, place in places.items()]) or "any values"


def span_in_words(costs: list[Number]) -> str:
    """Return the range of lower bounds in words: `at least 3 to 9`."""
    finite = [cost for cost in costs if not math.isinf(cost)]
    if not finite:
        return "infinity"
    least, most = min(finite), max(finite)
    return f"at least {cost_text(least)}{'' if least == most else f' to {cost_text(most)}'}"


def bounds_prove(axes: Sequence[Axis], costs: Sequence[Number], reception: Reception) -> Sequence[Proof]:
    """Return the proofs in lower bounds over `axes`, as for a DPOP table: they hold for all omitted robots."""
    places = itertools.product(*[range(size) for _, _, size in axes])
    return table_proves([name for name, _, _ in axes], zip(places, costs, strict=True), reception)


Places = Mapping[str, int]

MOST_WAITING = 2
"""The maximum number of open requests for a tighter table: one for the parent's search, one for the parent's parent."""


class Tighter(NamedTuple):
    """A child's table in a context."""

    context: Places
    table: RobotTable


class HSCAI(BranchingProtocol):
    """One agent of HS-CAI.

    - `domains` and `level`: the values of the linked robots above, and the number of all robots above.
    - `tables`: the children's tables from before the search; `tighter`: their tables in a context.
    - `places`: the values of the robots above that matter to the subtree, as indices, in the last CPA.
    - `stayed`: for each of these values, the number of successive CPAs in which it has stayed the same.
    - `inferring`: for each child, the contexts of the requested tables; None: a table for the parent.
    """

    messages = TreeMessage | Domain | PreUtil | CPA | InferCtxt | CtxtUtil | Result | Terminate
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Chen, Zhang, Deng, Chen & Li 2020",
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs, few but larger messages, tree too wide for DPOP",
    )
    settings: ClassVar[HSCAISettings] = HSCAISettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.domains: dict[str, list[Value]] = {}
        self.level = 0
        self.tables: dict[str, RobotTable] = {}
        self.tighter: dict[str, Tighter] = {}
        self.places: dict[str, int] = {}
        self.stayed: dict[str, int] = {}
        self.inferring: dict[str, list[Places | None]] = {}
        self._levels: dict[str, int] = {}
        self._from: dict[str, PreUtil] = {}
        self._axes: dict[str, Axis] = {}
        self._own_tables: list[RobotTable] = []
        self._asked: list[Places] = []
        self._made: dict[str, RobotTable] = {}

    def start_in_tree(self) -> None:
        """Send the domain to the robots below, as the root."""
        if self.parent is None:
            self._send_domain()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | PreUtil | CPA | InferCtxt | CtxtUtil | Result | Terminate", message):
            case Domain(values, level):
                self._store_domain(sender, values, level)
            case PreUtil() as util:
                self._store_util(sender, util)
            case CPA(bound, places):
                self._search(bound, places)
            case InferCtxt(places):
                self._infer(places)
            case CtxtUtil(axes, costs):
                self._store_tighter(sender, table_of(axes, costs))
            case Result() as result:
                self.store_result(sender, result)
            case Terminate(values):
                self.finish(values)
            case never:
                assert_never(never)

    # Before the search

    def _send_domain(self) -> None:
        for name in self.descendants:
            self.send(name, Domain(list(self.problem.values), self.level))
        self._pre_infer()

    def _store_domain(self, sender: str, values: list[Value], level: int) -> None:
        """Store the values of a robot above; the depth of the parent determines the depth of this robot."""
        if sender not in self.ancestors or sender in self.domains or not values or level < 0:
            raise ValueError(f"unexpected or invalid domain from {sender}")
        self.domains[sender] = values
        self._levels[sender] = level
        if sender == self.parent:
            self.level = level + 1
            self._send_domain()
        else:
            self._pre_infer()

    def _store_util(self, child: str, util: PreUtil) -> None:
        """Store a child's table."""
        if child not in self.children or child in self.tables or util.dearest < 0:
            raise ValueError(f"unexpected or repeated table from {child}")
        self._from[child] = util
        self.tables[child] = table_of(util.axes, util.costs)
        self.inferring[child] = []
        self._pre_infer()

    def _pre_infer(self) -> None:
        """Send this robot's table to the parent once all tables have arrived, or begin the search as the root."""
        if len(self.domains) < len(self.ancestors) or len(self.tables) < len(self.children):
            return
        self._axes = self._separator()
        scopes = self.problem.scopes(self.ancestors)
        charges = max((charge for charge in self.problem.charges if charge < INFINITE), default=0)
        below = sum(util.dearest for util in self._from.values())
        dearest = min(int(charges + sum(cost for _, cost in scopes) + below), EXACT)
        if self.parent is None:
            check_exact(dearest)
            self.search(self.limit, self.problem.charges)
            return
        made = self.problem.tables({name: self.domains[name] for name in self.ancestors})
        self._own_tables = [
            RobotTable((*table.agents, self.problem.agent), table.charges, table.distinct_codes()) for table in made
        ]
        axes, costs = self._least({}, self.tables)
        dropped = [axis for name, axis in self._axes.items() if axis not in axes]
        self.send(self.parent, PreUtil(axes, dropped, dearest, costs))

    def _separator(self) -> dict[str, Axis]:
        """Return the robots above that matter to the subtree.

        Raises:
            ValueError: if a child's table has another domain size or depth for a robot.
        """
        axes = {name: (name, self._levels[name], len(self.domains[name])) for name in self.ancestors}
        own = (self.problem.agent, self.level, len(self.problem.values))
        for child, util in self._from.items():
            for axis in (*util.axes, *util.dropped):
                if axis != (own if axis[0] == own[0] else axes.setdefault(axis[0], axis)):
                    raise ValueError(f"{child} sends another depth or number of values for {axis[0]}")
        return axes

    def _least(self, context: Places, tables: Mapping[str, RobotTable]) -> tuple[list[Axis], list[Number]]:
        """Return the axes and costs of this robot's table for the values in `context`."""
        axes = limited_axes([axis for name, axis in self._axes.items() if name not in context], self.settings.k)
        parts = [table.at(context) for table in (*self._own_tables, *tables.values())]
        return axes, least_over(axes, self.problem.agent, self.problem.charges, parts)

    # The search

    def _search(self, bound: Number, places: Places) -> None:
        """Search the subtree with the values above."""
        if self.searching or not self._axes or places.keys() != self._axes.keys() or not self._fits(places):
            raise ValueError(f"{self.problem.agent} is already searching, or the CPA lacks values of robots above")
        for name, place in places.items():
            self.stayed[name] = self.stayed.get(name, 0) + 1 if self.places.get(name) == place else 0
        self.places = dict(places)
        for child in self.children:
            self._ask_if_it_pays(child)
        view = {name: self.domains[name][places[name]] for name in self.ancestors}
        self.search(bound, self.problem.costs(view))

    def _fits(self, places: Places) -> bool:
        return all(name in self._axes and 0 <= place < self._axes[name][2] for name, place in places.items())

    def floor(self, child: str) -> Sequence[Number]:
        # The bounds in the child's table, and in a tighter table that is valid now.
        bounds = self._bounds_in(self.tables[child])
        tighter = self.tighter.get(child)
        if tighter is None or any(self.places[name] != place for name, place in tighter.context.items()):
            return bounds
        return [max(pair) for pair in zip(bounds, self._bounds_in(tighter.table), strict=True)]

    def _bounds_in(self, table: RobotTable) -> list[Number]:
        part = table.at(self.places)
        costs = [number_of(cost) for cost in part.costs.reshape(-1).tolist()]
        return costs if part.names else costs * len(self.problem.values)

    def request_bound(self, child: str) -> None:
        # No request is needed: the bound is known.
        self.descend(child)

    def explore(self, child: str, limit: Number) -> None:
        """Send the CPA to `child`."""
        util = self._from[child]
        places = {**self.places, self.problem.agent: self.present(child)}
        self.send(child, CPA(limit, {name: places[name] for name, _, _ in (*util.axes, *util.dropped)}))

    # Inference in a context

    def _ask_if_it_pays(self, child: str) -> None:
        """Request a new table from the child with the values that have stayed the same, if it lacks some."""
        dropped = [name for name, _, _ in self._from[child].dropped if name != self.problem.agent]
        context = {name: self.places[name] for name in dropped if self.stayed[name] > self.settings.t}
        under_way = any(one is not None for one in self.inferring[child])
        if context and not under_way and (child not in self.tighter or self.tighter[child].context != context):
            self._ask(child, context, context)

    def _ask(self, child: str, context: Places, purpose: Places | None) -> None:
        self.inferring[child].append(purpose)
        self.send(child, InferCtxt(dict(context)))

    def _infer(self, context: Places) -> None:
        """Compute this robot's table again for the parent; first ask the children whose tables lack a robot of it."""
        if len(self._asked) >= MOST_WAITING or not self._axes or not self._fits(context):
            raise ValueError(f"{self.problem.agent} cannot infer a table yet, or has too many open requests")
        self._asked.append(context)
        if len(self._asked) == 1:
            self._recompute(context)

    def _recompute(self, context: Places) -> None:
        self._made = dict(self.tables)
        for child, util in self._from.items():
            lacks = {name: context[name] for name, _, _ in util.dropped if name in context}
            if lacks:
                self._ask(child, lacks, None)
        self._answer_if_all_are_there()

    def _store_tighter(self, child: str, table: RobotTable) -> None:
        """Use a child's table, for this search or for the parent: answers arrive in the order of the requests."""
        if not self.inferring.get(child) or not self._is_below(child, table):
            raise ValueError(f"{child} sent an unexpected table, or a table over other robots")
        purpose = self.inferring[child].pop(0)
        if purpose is None:
            self._made[child] = table
            self._answer_if_all_are_there()
            return
        self.tighter[child] = Tighter(purpose, table)
        if self.searching:
            branch = self.branches[child]
            for index, bound in enumerate(self.floor(child)):
                if not branch.known[index]:
                    branch.lower[index] = max(branch.lower[index], bound)

    def _is_below(self, child: str, table: RobotTable) -> bool:
        """Return whether a table is over robots that matter to the child's subtree, with as many values."""
        sizes = {name: size for name, _, size in (*self._from[child].axes, *self._from[child].dropped)}
        return [sizes.get(name) for name in table.names] == [*table.costs.shape]

    def _answer_if_all_are_there(self) -> None:
        if self.parent is None or any(None in some for some in self.inferring.values()):
            return
        self.send(self.parent, CtxtUtil(*self._least(self._asked.pop(0), self._made)))
        if self._asked:
            self._recompute(self._asked[0])
