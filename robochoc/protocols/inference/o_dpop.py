"""Open DPOP (O-DPOP): DPOP that sends entries of tables instead of tables, best first and on request.

DPOP (see `dpop.py`) in which a parent asks (`Ask`), and its child answers with one *good*: a combination of values in
its separator, with the least cost of its subtree for this combination. Goods come in the order of their costs. So a
parent knows a lower bound on all other combinations, and often needs only a few goods.

- **When to use**: costs, if few combinations are good. The number of messages may be exponential in the induced width,
  but each message is short; a table is never sent as a whole.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution.
- **Parameters (`--set`)**: `memory`, the maximum number of bytes in a robot's tables (default 1 GiB).
- **Reference**: Petcu, Faltings: "O-DPOP: an algorithm for open/distributed constraint optimization", AAAI 2006.

Its rules are these methods:

    ASK / GOOD propagation    `_ask_or_answer`, `_receive_good`     valuation-sufficient good    `_is_complete`
    VALUE propagation         as in DPOP

A robot joins its children's goods. For a combination without a good, the cost of the child's last good is a lower
bound. The robot's cheapest combination is a good once all children have sent their matching goods for it. Until then
the robot asks the children whose goods are missing.

Choices that the paper leaves open, and differences:

- Domains and sizes are sent as in DPOP, so all combinations are known from the beginning. In the paper, an open problem
  reveals values as they are asked for.
- A robot asks all children whose goods are missing at the same time, each once.
- A robot stores its costs as a table with eight bytes per cell, and so needs as much memory as DPOP.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> solve(queens3d(3), Options(protocol="o-dpop", runtime=Runtime.SIMULATOR)).verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, assert_never, cast

import numpy as np

from robochoc.model.outcome import Verdict
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import NOTHING, Proof, Reception, table_proves
from robochoc.protocols.inference.dpop import (
    DPOP,
    VALUE,
    Cost,
    Dimensions,
    Domain,
    Proceed,
    TableSettings,
    axes_of,
    costs_of,
)
from robochoc.protocols.inference.dpop_tables import Array, Codes, Extent, expanded
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import listed


class Ask(Message, frozen=True):
    """A request for the receiver's next good."""

    act = Act(Performative.QUERY_REF, "the receiver sends its next good")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "what is the next best for your subtree?"


class Good(Message, frozen=True):
    """A combination of values in the sender's separator, as indices in the order of its axes, and its least cost.

    All combinations that the sender has not sent yet cost at least as much.
    """

    assignment: list[int]
    cost: Cost

    act = Act(Performative.INFORM, "the receiver learns the least remaining cost of the sender's subtree")

    def in_words(self, _: Wording) -> str:
        places = listed([str(place + 1) for place in self.assignment])
        where = f", with the values {places} (by number) in my separator" if places else ""
        return f"the next best for my subtree costs {cost_text(self.cost)}{where}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the same proofs as for this cell of DPOP's table."""
        axes = axes_of(reception, reception.receiver, reception.sender)
        return NOTHING if axes is None else table_proves(axes, [(self.assignment, self.cost)], reception)


class Done(Message, frozen=True):
    """The sender has no more goods: all other combinations break a hard constraint."""

    act = Act(Performative.INFORM, "the receiver learns that no other combination is possible")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "nothing else is possible in my subtree"


@mypyc_attr(allow_interpreted_subclasses=True)
class ODPOP(DPOP):
    """One agent of O-DPOP.

    State besides that of DPOP:

    - `goods`: for each child the costs of its goods, by its separator (NaN: not sent);
    - `last`: for each child the cost of its last good; `inf` if it has no more;
    - `optimum`: at the root, a lower bound on the cost of its tree; at the end, the optimum.
    """

    messages: ClassVar[Any] = TreeMessage | Domain | Dimensions | Proceed | Ask | Good | Done | VALUE
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2006",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        wide_tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs, few good combinations: short messages",
    )
    settings: ClassVar[TableSettings] = TableSettings()
    divides = False

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.goods: dict[str, Array] = {}
        self.last: dict[str, float] = {}
        self._local: Array = np.zeros(())
        self._unsent = np.ones((), bool)
        self._asked = False
        self._waiting: set[str] = set()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | Dimensions | Proceed | Ask | Good | Done | VALUE", message):
            case Ask():
                self._receive_ask(sender)
            case Good(assignment, cost):
                self._receive_good(sender, assignment, cost)
            case Done():
                self._receive_bound(sender, math.inf)
            case Domain() | Dimensions() | Proceed() | VALUE() as others:
                super().handle(sender, others)
            case never:
                assert_never(never)

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes of costs as floats, which are added up for each good."""
        cells = len(self.problem.values) * math.prod(self._own_sizes())
        return 40 * cells + sum(10 * table.cells for table in inputs)

    # Goods, from the leaves up

    def _start_utils(self) -> None:
        """Add up the costs of this robot's constraints; a root asks itself."""
        shape = [self._sizes[name] for name in self.separator or ()]
        self._local = np.zeros((len(self.problem.values), *shape))
        self._local += np.array(self.problem.charges, np.float64).reshape(-1, *(1 for _ in shape))
        for table in self.problem.tables({name: self.domains[name] for name in self.ancestors}):
            self._local += expanded(self._aligned(costs_of(table), (*table.agents, self.problem.agent)))
        for child in self.children:
            sizes = self.dimensions[child].separator
            self.goods[child] = np.full([sizes[name] for name in self._axes[child]], np.nan)
            self.last[child] = 0
        self._unsent = np.ones(shape, bool)
        self.choices = [cast("Codes", np.zeros(shape, np.min_scalar_type(len(self.problem.values))))]
        if self.parent is None:
            self._asked = True
            self._ask_or_answer()

    def _receive_ask(self, sender: str) -> None:
        if sender != self.parent or self.separator is None or self._asked:
            raise ValueError(f"{sender} sent an unexpected or repeated Ask to {self.problem.agent}")
        self._asked = True
        self._ask_or_answer()

    def _receive_good(self, child: str, assignment: Sequence[int], cost: int) -> None:
        """Store a child's next good. Raises `ValueError` if it is invalid, or out of order."""
        shape = self.goods[child].shape if child in self.goods else ()
        if len(assignment) != len(shape) or not all(
            0 <= place < size for place, size in zip(assignment, shape, strict=True)
        ):
            raise ValueError(f"{assignment} are not values of {child}'s separator")
        if child in self._waiting:
            if cost < self.last[child] or not np.isnan(self.goods[child][tuple(assignment)]):
                raise ValueError(f"{child} sent a good that costs less than its previous good, or repeats one")
            self.goods[child][tuple(assignment)] = cost
        self._receive_bound(child, cost)

    def _receive_bound(self, child: str, cost: float) -> None:
        """Record that all remaining combinations of `child` cost at least `cost`."""
        if child not in self._waiting:
            raise ValueError(f"{child} sent a good without a request")
        self._waiting.discard(child)
        self.last[child] = cost
        self._ask_or_answer()

    def _ask_or_answer(self) -> None:
        """Send the requested next good if it is known; otherwise ask the children whose goods are missing."""
        if not self._asked or self._waiting:
            return
        costs = self._lower_bounds()
        least = np.where(self._unsent, costs.min(axis=0), np.inf)
        flat = int(least.argmin())
        cell = tuple(map(int, np.unravel_index(flat, least.shape)))
        cost = float(least[cell])
        if cost == math.inf:
            self._send_end()
            return
        if self.parent is None:
            self.optimum = int(cost)
        own = int(costs.reshape(len(costs), -1)[:, flat].argmin())
        missing = [child for child in self.children if not self._is_complete(child, (own, *cell))]
        if missing:
            self._waiting = {*missing}
            for child in missing:
                self.send(child, Ask())
            return
        self._asked = False
        self._unsent[cell] = False
        cast("list[Codes]", self.choices)[0][cell] = own
        if self.parent is None:
            self._choose_optimal([])
        else:
            self.send(self.parent, Good(list(cell), int(cost)))

    def _send_end(self) -> None:
        """Report that there are no more goods; if there was none at all, there is no solution."""
        if self._unsent.all():
            self.conclude(Verdict.NO_SOLUTION)
        elif self.parent is not None:
            self._asked = False
            self.send(self.parent, Done())

    def _lower_bounds(self) -> Array:
        """Return lower bounds on the subtree's cost for each of this robot's values and each combination."""
        costs = self._local
        for child, goods in self.goods.items():
            bounds = np.where(np.isnan(goods), self.last[child], goods)
            costs = costs + cast("Array", self._aligned(bounds, self._axes[child]))
        return costs

    def _is_complete(self, child: str, places: Sequence[int]) -> bool:
        """Return whether `child` has sent its good for these indices of this robot's and the separator's values."""
        view = dict(zip((self.problem.agent, *(self.separator or ())), places, strict=True))
        return not np.isnan(self.goods[child][tuple(view[name] for name in self._axes[child])])

    # VALUE, from the root down

    def _best_value(self, choices: Sequence[Codes], assignment: Sequence[int]) -> int:
        """Return the index of this robot's value in the good that it sent for `assignment`."""
        if self._unsent[tuple(assignment)]:
            raise ValueError(f"{self.problem.agent} has sent no good for {list(assignment)}")
        return super()._best_value(choices, assignment)
