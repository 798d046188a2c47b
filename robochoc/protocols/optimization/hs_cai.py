"""HS-CAI: search with context-based inference.

Complete search for minimum cost on a pseudo-tree, with lower bounds from tables. Before the search each robot sends its
parent a table of its subtree's least costs (PREUTIL), as in DPOP, but over at most k robots: others above are left
out, so it is a lower bound. Then subtrees are searched side by side, and values tried by increasing bound; nobody is
asked. When values of robots that were left out stay the same for more than t searches, a robot has its children's
tables made again with these values (INFERCTXT, CTXTUTIL). These bounds are tighter while the values last. The search
goes on meanwhile.

- **When to use**: costs, few but larger messages, a pseudo-tree too wide for DPOP.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. No table is over
  more than k robots, or has more than 131,072 cells.
- **Parameters (`--set`)**: `k`, the most robots that a table is over (default 4), and `t`, how long values stay before
  bounds are inferred with them (default 1).
- **Reference**: Chen, Zhang, Deng, Chen, Li: "HS-CAI: a hybrid DCOP algorithm via combining search with context-based
  inference", AAAI 2020.

The messages have the names of the paper, but for these: BACKTRACK is `Result`. The frame of the search is in
`branching`.

Choices that the paper leaves open, and differences:

- Constraints may be n-ary: the lowest robot of the scope pays them. There may be several trees.
- The highest robots are left out of a table. Each part of a sum is minimised over them by itself.
- Robots tell those below their domain and depth before (`Domain`). A CPA holds the values that matter to the subtree.
- A robot infers with all values that have stayed long enough, for one table of a child at a time.
- Constraints are checked once for the tables, and again with each CPA. Sums and minima of tables are no checks.
- Costs are integers, added in float64. If they could reach 2^53, they would not be exact, and the run ends.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), HSCAI, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple, assert_never, cast

from robochoc.model.message import Message, Value
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.branching import BranchingProtocol
from robochoc.protocols.optimization.hs_cai_tables import Table, kept_axes, least_over, number_of, table_of
from robochoc.protocols.optimization.messages.branching import Number, Result, Terminate
from robochoc.protocols.optimization.messages.hs_cai import CPA, Axis, CtxtUtil, Domain, InferCtxt, PreUtil
from robochoc.protocols.optimization.settings.hs_cai import HSCAISettings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.exact_costs import EXACT, check_exact

Places = Mapping[str, int]

MOST_WAITING = 2
"""Requests for a tighter table that a robot may have: one for its parent's own search, one for its parent's parent."""


class Tighter(NamedTuple):
    """A child's table in a context."""

    context: Places
    table: Table


class HSCAI(BranchingProtocol):
    """One agent of HS-CAI.

    - `domains` and `level`: the values of the linked robots above; how many robots are above at all.
    - `tables`: the children's tables from before the search; `tighter`: those of a context.
    - `places`: of the robots above that matter to the subtree, the places of their values in the last CPA.
    - `stayed`: for how many CPAs in a row each of them has stayed.
    - `inferring`: for each child, the contexts of the tables that are under way; None: a table for the parent.
    """

    messages = TreeMessage | Domain | PreUtil | CPA | InferCtxt | CtxtUtil | Result | Terminate
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Chen, Zhang, Deng, Chen & Li 2020",
        costs=True,
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
        self.tables: dict[str, Table] = {}
        self.tighter: dict[str, Tighter] = {}
        self.places: dict[str, int] = {}
        self.stayed: dict[str, int] = {}
        self.inferring: dict[str, list[Places | None]] = {}
        self._levels: dict[str, int] = {}
        self._from: dict[str, PreUtil] = {}
        self._axes: dict[str, Axis] = {}
        self._own_tables: list[Table] = []
        self._asked: list[Places] = []
        self._made: dict[str, Table] = {}

    def begin(self) -> None:
        """Tell the own domain to those below, as the root."""
        if self.parent is None:
            self._tell_domain()

    def handle(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type."""
        match cast("Domain | PreUtil | CPA | InferCtxt | CtxtUtil | Result | Terminate", message):
            case Domain(values, level):
                self._take_domain(sender, values, level)
            case PreUtil() as util:
                self._take_util(sender, util)
            case CPA(bound, places):
                self._search(bound, places)
            case InferCtxt(places):
                self._infer(places)
            case CtxtUtil(axes, costs):
                self._take_tighter(sender, table_of(axes, costs))
            case Result() as result:
                self.take_result(sender, result)
            case Terminate(values):
                self.finish(values)
            case never:
                assert_never(never)

    # Before the search

    def _tell_domain(self) -> None:
        for name in self.descendants:
            self.send(name, Domain(list(self.problem.values), self.level))
        self._pre_infer()

    def _take_domain(self, sender: str, values: list[Value], level: int) -> None:
        """Note the values of a robot above; the parent's depth tells the own one."""
        if sender not in self.ancestors or sender in self.domains or not values or level < 0:
            raise ValueError(f"{sender} has no domain to tell")
        self.domains[sender] = values
        self._levels[sender] = level
        if sender == self.parent:
            self.level = level + 1
            self._tell_domain()
        else:
            self._pre_infer()

    def _take_util(self, child: str, util: PreUtil) -> None:
        """Note a child's table."""
        if child not in self.children or child in self.tables or util.dearest < 0:
            raise ValueError(f"{child} has no table to tell")
        self._from[child] = util
        self.tables[child] = table_of(util.axes, util.costs)
        self.inferring[child] = []
        self._pre_infer()

    def _pre_infer(self) -> None:
        """Send the own table to the parent once all is known, or begin the search as the root."""
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
        self._own_tables = [Table((*table.agents, self.problem.agent), table.charges) for table in made]
        axes, costs = self._least({}, self.tables)
        dropped = [axis for name, axis in self._axes.items() if axis not in axes]
        self.send(self.parent, PreUtil(axes, dropped, dearest, costs))

    def _separator(self) -> dict[str, Axis]:
        """Return the robots above that matter to the subtree.

        Raises:
            ValueError: if a child tells of values that they have not.
        """
        axes = {name: (name, self._levels[name], len(self.domains[name])) for name in self.ancestors}
        own = (self.problem.agent, self.level, len(self.problem.values))
        for child, util in self._from.items():
            for axis in (*util.axes, *util.dropped):
                if axis != (own if axis[0] == own[0] else axes.setdefault(axis[0], axis)):
                    raise ValueError(f"{child} has {axis[0]} elsewhere, or with other values")
        return axes

    def _least(self, context: Places, tables: Mapping[str, Table]) -> tuple[list[Axis], list[Number]]:
        """Return the axes and costs of the own table, with the values of `context`."""
        axes = kept_axes([axis for name, axis in self._axes.items() if name not in context], self.settings.k)
        parts = [table.at(context) for table in (*self._own_tables, *tables.values())]
        return axes, least_over(axes, self.problem.agent, self.problem.charges, parts)

    # The search

    def _search(self, bound: Number, places: Places) -> None:
        """Search the own subtree with the values above."""
        if self.searching or not self._axes or places.keys() != self._axes.keys() or not self._fits(places):
            raise ValueError(f"{self.problem.agent} is searching, or is told no values of the robots above")
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
        """Return the bounds of the child's table, and of a tighter one that holds now."""
        bounds = self._bounds_in(self.tables[child])
        tighter = self.tighter.get(child)
        if tighter is None or any(self.places[name] != place for name, place in tighter.context.items()):
            return bounds
        return [max(pair) for pair in zip(bounds, self._bounds_in(tighter.table), strict=True)]

    def _bounds_in(self, table: Table) -> list[Number]:
        part = table.at(self.places)
        costs = [number_of(cost) for cost in part.costs.reshape(-1).tolist()]
        return costs if part.names else costs * len(self.problem.values)

    def look(self, child: str) -> None:
        """Nobody need be asked: the bound is there."""
        self.descend(child)

    def explore(self, child: str, limit: Number) -> None:
        """Send the CPA to `child`."""
        util = self._from[child]
        places = {**self.places, self.problem.agent: self.present(child)}
        self.send(child, CPA(limit, {name: places[name] for name, _, _ in (*util.axes, *util.dropped)}))

    # Inference in a context

    def _ask_if_it_pays(self, child: str) -> None:
        """Have the child's table made again with the values that have stayed, if some that it lacks are among them."""
        dropped = [name for name, _, _ in self._from[child].dropped if name != self.problem.agent]
        context = {name: self.places[name] for name in dropped if self.stayed[name] > self.settings.t}
        under_way = any(one is not None for one in self.inferring[child])
        if context and not under_way and (child not in self.tighter or self.tighter[child].context != context):
            self._ask(child, context, context)

    def _ask(self, child: str, context: Places, purpose: Places | None) -> None:
        self.inferring[child].append(purpose)
        self.send(child, InferCtxt(dict(context)))

    def _infer(self, context: Places) -> None:
        """Make the own table again for the parent; children are asked first whose tables lack robots of the context."""
        if len(self._asked) >= MOST_WAITING or not self._axes or not self._fits(context):
            raise ValueError(f"{self.problem.agent} cannot infer, or was asked too often")
        self._asked.append(context)
        if len(self._asked) == 1:
            self._make_again(context)

    def _make_again(self, context: Places) -> None:
        self._made = dict(self.tables)
        for child, util in self._from.items():
            lacks = {name: context[name] for name, _, _ in util.dropped if name in context}
            if lacks:
                self._ask(child, lacks, None)
        self._answer_if_all_are_there()

    def _take_tighter(self, child: str, table: Table) -> None:
        """Use a child's table, for the own search or for the parent: answers come in the order of the requests."""
        if not self.inferring.get(child) or not self._is_below(child, table):
            raise ValueError(f"{child} was asked for no table, or has another one")
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

    def _is_below(self, child: str, table: Table) -> bool:
        """Return whether a table is over robots that matter to the child's subtree, with as many values."""
        sizes = {name: size for name, _, size in (*self._from[child].axes, *self._from[child].dropped)}
        return [sizes.get(name) for name in table.names] == [*table.costs.shape]

    def _answer_if_all_are_there(self) -> None:
        if self.parent is None or any(None in some for some in self.inferring.values()):
            return
        self.send(self.parent, CtxtUtil(*self._least(self._asked.pop(0), self._made)))
        if self._asked:
            self._make_again(self._asked[0])
