"""Self-stabilizing DPOP (S-DPOP): DPOP that reuses its results when the problem changes.

DPOP (see `dpop.py`) whose robots store their position in the pseudo-tree, their children's tables and their choices.
After a change, only robots whose separator, constraint, or child's table has changed compute again. All others send an
empty message (`Reuse`) instead of a table.

- **When to use**: costs, a pseudo-tree with a small induced width, and a problem that changes during the run.
- **Guarantees**: complete; each epoch terminates with an optimum, or with a proof that there is no solution. Reused
  results depend on nothing that a change has invalidated.
- **Parameters (`--set`)**: `memory` and `disk` as in DPOP.
- **Reference**: Petcu, Faltings: "S-DPOP: superstabilizing, fault-containing multiagent combinatorial optimization",
  AAAI 2005.

The three parts of the paper are these methods:

    self-stabilizing tree   `change`, `resume`, `_start_new_tree`
    UTIL propagation        `_measure`, `_receive_reuse`, `_send_or_choose`
    VALUE propagation       `_choose_optimal`

An epoch on the tree of the previous epoch runs as follows. The root starts the epoch (`Check`), so all robots learn
which domains above them have changed. From the leaves up, each robot reports whether its table can have changed: by
`Reuse`, or by DPOP's `Dimensions`. Then the root lets the robots with `Dimensions` proceed. If a recomputed table is
the same after all, `Reuse` is sent instead of it. VALUE is sent to children that have computed, or whose separator has
other values.

Choices that the paper leaves open, and differences:

- The runtime propagates the changes to all robots before any robot continues.
- A robot that has a new neighbour, or has lost its parent, starts a new tree for all connected robots, by the first
  wave of an election (see `shared/dfs.py`). The loss of a child or another neighbour does not require a new tree. In
  the paper, a new link needs no new tree if one end is above the other; here that is not known, and tables are reused
  on the new tree as well.
- A wave ends the epoch's work on the old tree. Messages that neighbours sent before their first wave are dropped; a
  robot that has already computed computes again.
- After an epoch in which messages were lost (it was interrupted, or had no solution), all robots start again.
- A proof of no solution remains valid if constraints are added or values removed.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> solve(queens3d(3), Options(protocol="s-dpop", runtime=Runtime.SIMULATOR)).verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import assert_never, cast

import numpy as np

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.dynamic import DynamicProtocol
from robochoc.protocols.inference.dpop import DPOP, UTIL, VALUE, Dimensions, Domain, Proceed, costs_of, store_once
from robochoc.protocols.inference.dpop_tables import (
    CoarseTable,
    Codes,
    Extent,
    IncomingTable,
    IncomingTables,
    Table,
    Width,
    project,
    width_of,
)
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage, Wave
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import listed


class Check(Message, frozen=True):
    """The tree is unchanged; `changed` are the robots above the receiver whose domains have changed.

    If a changed robot shares a constraint with the receiver, it sends the receiver its domain itself.
    """

    changed: list[str]

    act = Act(Performative.REQUEST, "the receiver reports whether its table has changed")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        news = f"the values of {listed(self.changed)} have changed" if self.changed else "no values have changed"
        return f"our tree stands, and above you {news}"


class Reuse(Message, frozen=True):
    """The sender's table is unchanged: the receiver already has it."""

    act = Act(Performative.CONFIRM, "the receiver may use the sender's last table again")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "my table is still the one that you have"


class SDPOP(DPOP, DynamicProtocol):
    """One agent of S-DPOP.

    State besides that of DPOP, kept from epoch to epoch:

    - `basis`: the inputs to this robot's table, except the children's tables;
    - `sent`: this robot's table, if the parent has it;
    - `sent_values`: for each child, the values that it received last.
    """

    messages = TreeMessage | Check | Domain | Dimensions | Reuse | Proceed | UTIL | VALUE
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2005",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        dynamic=True,
        tables=True,
        wide_tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs that change, small induced width: keeps tables",
    )

    divides = False

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.basis: tuple[object, ...] | None = None
        self.sent: Codes | None = None
        self.sent_values: dict[str, list[int]] = {}
        self.known_values: list[Value] = []
        """The domain as robots below know it."""
        self._own_tables: list[tuple[Table | CoarseTable, tuple[str, ...]]] = []
        self._tabulated: tuple[object, ...] = ()
        """The inputs to the tables of this robot's constraints."""
        self._has_new_values = False
        self._is_old_tree = False
        """True if the tree is that of the previous epoch."""
        self._needs_tree = False
        self._before_wave: set[str] = set()
        """Neighbours whose first wave has not arrived yet; their earlier messages belong to an old tree."""
        self._last_parent: str | None = None
        self._last_optimum: int | None = None
        self._start_epoch()

    def _start_epoch(self) -> None:
        """Reset the state that belongs to one epoch or one tree."""
        self._expected: set[str] | None = None
        """Robots above that send their domains; None if not known yet."""
        self._new_domains: dict[str, list[Value]] = {}
        self._reports: set[str] = set()
        self._renewed: set[str] = set()
        """Children whose tables may have changed."""
        self._waiting: set[str] = set()
        self._incoming: dict[str, IncomingTables] = {}
        self._inputs: tuple[object, ...] = ()
        self._computes = self._proceeding = self._tables_changed = self._axes_changed = False

    # The tree

    def start(self) -> None:
        """Start a tree with the current neighbours."""
        self.leave_tree()
        self._before_wave = {*self.problem.neighbours}
        super().start()

    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        """Adopt the changed problem: the propagation phase."""
        old, gone, around = self.problem, invalidated.agents, {*problem.neighbours}
        if invalidated.keys:
            self.verdict = None
        if problem.values != old.values or problem.agent in gone:
            self.value = None
        self.optimum = None
        self._needs_tree |= not around <= {*old.neighbours} or not around.isdisjoint(gone) or problem.agent in gone
        self._needs_tree |= self.parent is not None and self.parent not in around
        if problem.agent in gone or not gone.isdisjoint(old.neighbours):
            self.basis = self.sent = None
        for name in gone:
            self._forget_child(name)
        self.problem, self.order = problem, order

    def resume(self, *, lossless: bool) -> None:
        """Continue on the old tree, if possible; otherwise start a new one."""
        if self.verdict is not None:
            return
        self._start_epoch()
        if not lossless:
            self._forget_all()
        if not lossless or self._needs_tree or not self.placed or not self.problem.values:
            self._start_new_tree()
            return
        self._is_old_tree = True
        around = self.problem.neighbours
        for name in self.children:
            if name not in around:
                self._forget_child(name)
        self.children, self.pseudo_parents, self.pseudo_children = (
            self._sorted(name for name in names if name in around)
            for names in (self.children, self.pseudo_parents, self.pseudo_children)
        )
        self._has_new_values = self.known_values != list(self.problem.values)
        if self._has_new_values:
            self._send_domain()
        if self.parent is None:
            self._check_subtree([])

    def receive(self, sender: str, message: Message) -> None:
        """Process a message; a wave ends the work on the old tree."""
        if self.verdict is not None:
            return
        if isinstance(message, Wave):
            if self._is_old_tree:
                self.sent_values = {}
                self._start_new_tree()
            self._before_wave.discard(sender)
        elif sender in self._before_wave:
            return
        super().receive(sender, message)

    def _start_new_tree(self) -> None:
        """Start a new tree. The unfinished work of this epoch is done again."""
        if self._computes:
            self.basis = self.sent = None
        self._is_old_tree = self._needs_tree = False
        self._start_epoch()
        self.start()

    def start_in_tree(self) -> None:
        """Reuse the tables of robots that are still children, and send the domain to the neighbours below."""
        if self.parent != self._last_parent:
            self.basis = self.sent = None
        self._last_parent = self.parent
        for name in [*self.utils, *self.dimensions]:
            if name not in self.children:
                self._forget_child(name)
        self._expected = {*self.ancestors}
        self._send_domain()
        self._measure()

    def _send_domain(self) -> None:
        self.known_values = list(self.problem.values)
        for name in self.descendants:
            self.send(name, Domain(self.known_values))

    def _forget_child(self, name: str) -> None:
        self.utils.pop(name, None)
        self.dimensions.pop(name, None)
        self._axes.pop(name, None)
        self.sent_values.pop(name, None)

    def _forget_all(self) -> None:
        self.basis = self.sent = self.choices = None
        for name in [*self.utils, *self.dimensions, *self._axes, *self.sent_values]:
            self._forget_child(name)

    # Messages

    def handle(self, sender: str, message: Message) -> None:
        match cast("Check | Domain | Dimensions | Reuse | Proceed | UTIL | VALUE", message):
            case Check(changed):
                self._check_subtree(changed)
            case Domain(values):
                store_once(sender, values, self._new_domains, self.ancestors)
                self._measure()
            case Dimensions() as dimensions:
                self._store_dimensions(sender, dimensions)
                self._measure()
            case Reuse():
                self._receive_reuse(sender)
            case Proceed() | UTIL() | VALUE() as others:
                super().handle(sender, others)
            case never:
                assert_never(never)

    def _check_subtree(self, changed: Sequence[str]) -> None:
        """Start the epoch on the old tree; send the children the robots whose domains have changed."""
        if not self._is_old_tree or self._expected is not None:
            raise ValueError(f"{self.problem.agent} has already started this epoch")
        self._expected = {*changed} & {*self.ancestors}
        own = [self.problem.agent] if self._has_new_values else []
        for child in self.children:
            self.send(child, Check([*changed, *own]))
        self._measure()

    # The sizes of tables, and whether tables are unchanged

    def _store_dimensions(self, child: str, dimensions: Dimensions) -> None:
        """Store the dimensions of a table that may have changed."""
        self._check_dimensions(child, dimensions)
        if child not in self.children or child in self._reports:
            raise ValueError(f"{child} sent unexpected or repeated Dimensions")
        self.dimensions[child] = dimensions
        self._reports.add(child)
        self._renewed.add(child)

    def _receive_reuse(self, child: str) -> None:
        """Reuse a child's table: it did not have to be computed, or it is the same after all."""
        if child not in self.utils or child not in self.children or child in self._incoming:
            raise ValueError(f"{child} sent Reuse, but {self.problem.agent} has no table of it")
        if child not in self._reports:
            self._reports.add(child)
            self._measure()
        elif child in self._waiting:
            self._waiting.discard(child)
            self._compute_if_complete()
        else:
            raise ValueError(f"{child} sent an unexpected or repeated Reuse")

    def _measure(self) -> None:
        """Once all inputs to this robot's table are known, send Reuse, or the table's dimensions."""
        if self._expected is None or not self._expected <= self._new_domains.keys():
            return
        if len(self._reports) < len(self.children) or self._inputs:
            return
        known = {**self.domains, **self._new_domains} if self._is_old_tree else self._new_domains
        self.domains = {name: known[name] for name in self.ancestors}
        self._inputs = self._own_inputs()
        if self._renewed or self._inputs != self.basis:
            self._computes = True
            self._compute_dimensions()
        elif self.parent is not None:
            self.send(self.parent, Reuse())
        else:
            self.optimum = self._last_optimum

    def _own_inputs(self) -> tuple[object, ...]:
        """Return the inputs to this robot's table, except the children's tables."""
        seen = {name for scope, _ in self.problem.scopes(self.ancestors) for name in scope}
        domains = {name: self.domains[name] for name in seen}
        return self.problem.table_inputs(self.ancestors), domains, {*self.children}

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes of stored tables: the children's, also while new ones arrive, and this robot's as sent."""
        tables = sum(table.cells * table.width for table in inputs)
        return 2 * (tables + math.prod(self._own_sizes()) * width_of(self._dearest))

    def _proceed(self, separator: Sequence[str]) -> None:
        """Let those children proceed whose tables may have changed, and wait for their tables."""
        self._check_axes(separator, expected=self._computes and not self._proceeding)
        self._proceeding = True
        self._axes_changed = self.separator != tuple(separator)
        self.separator = tuple(separator)
        self._waiting = {*self._renewed}
        for child in self.children:
            if child in self._renewed:
                self._let_proceed(child)
        if self._inputs != self._tabulated:
            tables = self.problem.tables({name: self.domains[name] for name in self.ancestors})
            self._own_tables = [(costs_of(table), (*table.agents, self.problem.agent)) for table in tables]
            self._tabulated = self._inputs
        self._compute_if_complete()

    # UTIL, from the leaves up

    def _util_message_handler(self, child: str, width: Width, costs: bytes) -> None:
        """Store a piece of a child's new table."""
        if child not in self._waiting:
            raise ValueError(f"{child} sent a table without a request")
        if child not in self._incoming:
            dimensions = self.dimensions[child]
            shape = [dimensions.separator[name] for name in self._axes[child]]
            table = IncomingTable(shape, dimensions.dearest, on_disk=self._on_disk)
            self._incoming[child] = IncomingTables([table])
        incoming = self._incoming[child]
        incoming.add(width, costs)
        if incoming.complete:
            self.utils[child] = self._incoming.pop(child)
            self._tables_changed = True
            self._waiting.discard(child)
            self._compute_if_complete()

    def _compute_if_complete(self) -> None:
        """Compute once all children's tables have arrived, unless nothing has changed after all."""
        if self._waiting:
            return
        if self._inputs == self.basis and not self._tables_changed and not self._axes_changed:
            if self.parent is None:
                self.optimum = self._last_optimum
                self._choose_optimal([])
            else:
                self.send(self.parent, Reuse())
            return
        joined = [self._aligned(table, axes) for table, axes in self._own_tables]
        joined += [self._aligned(table.costs, self._axes[name]) for name, table in self.utils.items()]
        shape = [self._sizes[name] for name in self.separator or ()]
        costs, choices = project(shape, self.problem.charges, joined, self._dearest, on_disk=self._on_disk)
        self.choices = [choices]
        self.basis = self._inputs
        self._send_or_choose(costs)
        self._last_optimum = self.optimum

    def _send_table(self, costs: Codes) -> None:
        """Send the parent this robot's table, unless the parent has the same one."""
        same = self.sent is not None and not self._axes_changed and self.sent.dtype == costs.dtype
        if same and np.array_equal(cast("Codes", self.sent), costs):
            self.send(self.parent or "", Reuse())
            return
        self.sent = costs
        super()._send_table(costs)

    # VALUE, from the root down

    def _choose_optimal(self, assignment: Sequence[int]) -> None:
        """Choose the cheapest value; send VALUE to children that have computed, or whose separator has other values."""
        if self.choices is None:
            raise ValueError(f"{self.problem.agent} has no table yet")
        self.value = self._best_value(self.choices, assignment)
        view = dict(zip((self.problem.agent, *(self.separator or ())), (self.value, *assignment), strict=True))
        for child in self.children:
            places = [view[name] for name in self._axes[child]]
            if child in self._renewed or self.sent_values.get(child) != places:
                self.sent_values[child] = places
                self.send(child, VALUE(places))
