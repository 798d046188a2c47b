"""Max-Sum.

Local message passing on the factor graph; here it minimises costs, so it is a min-sum algorithm. Each robot's variable
is a node, and so is each function, the sum of all constraints over the same robots. R, from function to variable, is
the minimum cost of each value in that function, given the other variables' messages. Q, from variable to function, is
the cost of each value in all other functions. A robot chooses the value with the lowest sum.

- **When to use**: costs, a large team, a graph with few cycles.
- **Guarantees**: incomplete; it stops after `cycles` cycles. On a graph without cycles the result is optimal (without
  `split`); elsewhere it is an estimate that need not converge. The result is the best cycle (anytime). A robot whose
  values all cost `inf` proves that there is no solution.
- **Parameters (`--set`)**: `damping` (the weight of the last Q in a new one; default 0.5), `preference` (the maximum
  random charge of a value; default 0.01), `split` (each function becomes two; default 0: no splitting), `reweight` (the
  weight of functions in tree-reweighted Max-Sum; default 1: plain Max-Sum), `diffusion` (`yes`: max-sum diffusion, with
  a lower bound; default `no`), `cycles` (default 100).
- **References**: Farinelli, Rogers, Petcu, Jennings: "Decentralised coordination of low-power embedded devices using
  the max-sum algorithm", AAMAS 2008, Section 4; for damping and splitting: Cohen, Galiki, Zivan: "Governing convergence
  of Max-sum on DCOPs through damping and splitting", AIJ 279, 2020; for reweighting: Wainwright, Jaakkola, Willsky:
  "MAP estimation via agreement on trees: message-passing and linear programming", IEEE Transactions on Information
  Theory 51(11), 2005; for diffusion: Werner: "A linear programming approach to max-sum problem: a review", IEEE
  Transactions on Pattern Analysis and Machine Intelligence 29(7), 2007, which attributes it to Kovalevsky and Koval.

The methods correspond to the first paper's equations:

    Q, from variable to function (1)   `_q`
    R, from function to variable (2)   `Factor.r`
    Z, and the value (3)               `_z`, `_decide`
    preferences gamma                  `preferred`
    split constraint factor graph      `_split`
    edge appearance probability        `reweight`
    max-sum diffusion                  `maxsum_diffusion.py`

The lowest-priority robot in the scope of a function holds it, because only this robot knows the constraint. Messages
between nodes of the same robot are not sent. In a cycle all functions send R, then all variables send Q. All messages
between two robots in a phase form one message, with a row for each function that contains both. At the start, robots
send their domains to the holders of their functions.

Ties: if values are interchangeable, such as colours, all their costs would stay equal. So each value of each robot gets
a small random charge, its preference (the paper's gamma).

With `split`, each function becomes two: the first has a share of each entry, drawn from `split` to 1 - `split`, and the
second has the rest. 0.5 makes equal halves; below 0.5 they differ a little. Both are nodes in the graph, so a robot's Q
to one of them contains the other's R. That works like damping: the search settles sooner. The halves form a cycle, so
on a tree the result is no longer sure to be optimal.

With `reweight` below 1, Max-Sum is tree-reweighted: the tables of functions are divided by this weight; R counts in Z
with this weight, and a robot's Q to a function is Z without the whole R of this function. In the paper, a weight is the
probability that a random spanning tree contains the function, so each function has its own weight, which no robot
knows. Here all functions have the same weight: in a graph with n robots and m functions, the mean is (n - 1) / m. On a
tree it is 1, and other weights may miss the optimum. On most graphs with cycles, weights below 1 make answers more
expensive. No bound is reported, although the paper's messages yield one.

With `diffusion=yes`, a robot's Q to a function is Z / (d + 1) without R, where d is the number of its functions. The
least cost of a value then becomes the same in the robot's variable and in all its functions, and the sum of all minima
is a lower bound, which the result contains (`maxsum_diffusion.py`). If the best cost equals the bound, it is proven
optimal, on trees after enough cycles. With `damping` 0.5 or more the bound does not fall, if functions have two robots;
preferences and rounding change it a little. Elsewhere the relaxation has a gap, which further cycles do not close, and
answers cost more than those of plain Max-Sum. In the paper, one variable and one function are averaged at a time; here
all robots act in the same cycle, and each knows only the messages of its neighbours. The robots send nothing in
addition: each reports its share of the bound at the end. If a message is lost, there is no bound.

Choices that the paper leaves open, and differences:

- Q is damped.
- Q is normalised to a minimum of 0 (in the paper: to a sum of 0), because entries may be infinite: a value that always
  violates a hard constraint costs `inf`. Nothing is subtracted from `inf`, so such a value remains excluded.
- Constraints may be n-ary, up to a maximum size of their tables.
- If messages are lost, the last R and Q are used. If a domain is lost, its functions are left out; instead of R their
  holder sends its own domain, to request the missing domain again.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), MaxSum, Concurrent(seed=0)).search()
>>> result.verdict.value, result.metrics.messages
('no-solution', {'Domain': 6, 'R': 3})
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.maxsum_diffusion import divided, rounded, share_of_bound
from robochoc.protocols.inference.maxsum_factor import Factor, Row, cheapest, from_zero, total, weighted, without_each
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleProtocol, CycleSettings, Domain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, costs_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr

MAX_SPLIT = 0.5
"""With this share, both halves of a function are equal."""

LEAST_WEIGHT = 0.001
"""The minimum weight of functions: with lower ones, a division of costs would lose the last digits of others."""


class MaxSumSettings(CycleSettings, frozen=True):
    """`damping`: the weight of the last Q. `preference`: its maximum for a value. `cycles`: the number of cycles.

    `split`: each function becomes two, and the share of each entry is drawn from `split` to 1 - `split`. 0: no split.
    `reweight`: the weight of functions in tree-reweighted Max-Sum. 1: plain Max-Sum.
    `diffusion`: `yes` for max-sum diffusion, which has a lower bound; not with `split` or `reweight`.
    """

    damping: float = 0.5
    preference: float = 0.01
    split: float = 0.0
    reweight: float = 1.0
    diffusion: Literal["no", "yes"] = "no"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.damping < 1:
            raise ValueError(f"damping is {self.damping:g}; it must be from 0 to below 1")
        if not 0 <= self.preference < INFINITE:
            raise ValueError(f"preference is {self.preference:g}; it must be a number, 0 or more")
        if not 0 <= self.split <= MAX_SPLIT:
            raise ValueError(f"split is {self.split:g}; it must be from 0 (none) to {MAX_SPLIT:g} (halves)")
        if not LEAST_WEIGHT <= self.reweight <= 1:
            raise ValueError(f"reweight is {self.reweight:g}; it must be from {LEAST_WEIGHT:g} to 1 (plain Max-Sum)")
        if self.diffusion == "yes" and (self.split or self.reweight != 1):
            raise ValueError("diffusion cannot be combined with split or reweight: leave them out")


class R(wire.Message, frozen=True):
    """Messages from functions to a variable, with a row for each of the sender's functions that includes the receiver.

    A row contains the minimum cost of the function for each of the receiver's values.
    """

    rows: list[Row]

    act = Act(Performative.INFORM, "the receiver learns the cost of each of its values")
    # Costs are sums over many robots, and may be split, damped or shifted to a minimum of 0.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        many = len(self.rows)
        by = "our function" if many == 1 else f"our {many:,} functions, one after the other"
        return f"by {by}, {words.receiver}'s values cost {_rows_in_words(self.rows)}"


class Q(wire.Message, frozen=True):
    """Messages from a variable to functions, with a row for each of the receiver's functions, in the order of R.

    A row contains the cost of each of the sender's values in all its other functions.
    """

    rows: list[Row]

    act = Act(Performative.INFORM, "the receiver learns the cost of each of the sender's values elsewhere")
    # Costs are sums over many robots, and may be split, damped or shifted to a minimum of 0.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        many = len(self.rows)
        by = "our function" if many == 1 else f"each of our {many:,} functions in turn"
        return f"without {by}, {words.sender}'s values cost {_rows_in_words(self.rows)}"


def _rows_in_words(rows: Sequence[Row]) -> str:
    return "; ".join(map(costs_text, rows[:4]))


@mypyc_attr(allow_interpreted_subclasses=True)
class FactorGraphProtocol(CycleProtocol):
    """The common base of Max-Sum and Max-Sum_AD: a variable, and the functions whose lowest robot is this one.

    Robots in `above` receive R from this robot and send Q to it; robots in `below` send R and receive Q. `preferred`
    are the private costs of the values, including their preferences.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        place = order.rank[problem.agent]
        self.above = tuple(name for name in problem.neighbours if order.rank[name] < place)
        self.below = tuple(name for name in problem.neighbours if order.rank[name] > place)
        self.preferred: Row = []
        self._domains: dict[str, list[wire.Value]] = {}

    @abstractmethod
    def _receive_domains(self, messages: Mapping[str, wire.Message]) -> None:
        """Start the first cycle, once the domains above are known."""

    def start_with(self, preference: float) -> None:
        """Choose the value with the lowest private cost, and send the domain to the holders of its functions."""
        self.preferred = [cost + preference * self.chance() for cost in self.problem.costs({})]
        self.choose(cheapest(self.preferred))
        self.multicast(self.below, Domain(list(self.problem.values)))
        self.listen(self.above, self._receive_domains)


@mypyc_attr(allow_interpreted_subclasses=True)
class MaxSum(FactorGraphProtocol):
    """One agent of Max-Sum.

    `factors` are its functions. `edges` contains the last Q to each function: first to its own functions, then to those
    of each robot below.
    """

    messages: ClassVar[Any] = Domain | R | Q | AnytimeMessage
    settings: ClassVar[MaxSumSettings] = MaxSumSettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Farinelli, Rogers, Petcu, Jennings 2008",
        complete=False,
        costs=True,
        writes_to_non_neighbours=False,
        arrays=True,
        bears_loss=True,
        privacy="constraints among others",
        use_when="costs, large team, graph with few cycles; no proof",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.factors: list[Factor] = []
        self.edges: list[Row] = []
        self._own: list[Row] = []
        self._last_q: dict[str, Sequence[Row]] = {}
        """The last Q from each robot above."""
        self._last_r: dict[str, Sequence[Row]] = {}
        """The last R from each robot below that has sent one."""
        self._made = False
        self._shape: list[tuple[str, int]] = []
        """The number of `edges` of each robot."""
        self._has_all = True
        """False after a phase without all its messages: then the robots' shares of the bound do not belong together."""
        self._share: float | None = None

    @property
    def findings(self) -> Findings:
        """This robot's value in every cycle, and with `diffusion` its share of the bound, after the last cycle."""
        found = super().findings
        return found if self._share is None else msgspec.structs.replace(found, share=self._share)

    def start(self) -> None:
        super().start()
        if not self.problem.neighbours:
            self._record_share()

    def start_cycles(self) -> None:
        self.start_with(self.settings.preference)

    def _receive_domains(self, messages: Mapping[str, wire.Message]) -> None:
        self._domains = self.checked_domains(messages)
        self._has_all &= len(messages) == len(self.above)
        self._send_r()

    def _make_functions(self) -> None:
        """Create the functions whose robots' domains are known. All Q are 0 at first."""
        domains = self._domains
        self._made = True
        self._shape = []
        factors = self._split(Factor.joined(self.problem.tables(domains), of_values=self.settings.split > 0))
        weight = self.settings.reweight
        self.factors = factors if weight == 1 else [factor.divided(weight) for factor in factors]
        self.edges = [[0.0] * len(self.preferred) for _ in self.factors]
        self._last_q = {name: [[0.0] * len(values)] * len(self._with(name)) for name, values in domains.items()}

    def _split(self, factors: list[Factor]) -> list[Factor]:
        """Return two functions for each of `factors`, if the setting `split` is not 0."""
        least = self.settings.split
        if not least:
            return factors
        import numpy as np  # noqa: PLC0415 - the tables have been made with it already

        halves: list[Factor] = []
        for factor in factors:
            spread = 1 - 2 * least
            drawn = [least + spread * self.chance() if spread else least for _ in range(factor.charges.size)]
            halves += factor.split(np.reshape(drawn, factor.charges.shape))
        return halves

    def _receive_q(self, messages: Mapping[str, wire.Message]) -> None:
        """Process all Q received in the cycle."""
        self._has_all &= len(messages) == len(self.above)
        for name, message in messages.items():
            self._record(name, message)
        self._send_r()

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Store the new information in a message whose phase is over."""
        self._record(sender, message)

    def _record(self, name: str, message: wire.Message) -> None:
        """Store the last R, Q or domain from a robot; ignore Q for functions that have changed since."""
        if isinstance(message, R):
            self._last_r[name] = message.rows
        elif isinstance(message, Domain) and name in self.above:
            self._domains.update(self.checked_domains({name: message}))
            self._made = False
        elif isinstance(message, Domain):
            self._last_r.pop(name, None)
        elif isinstance(message, Q) and len(message.rows) == len(self._last_q.get(name, message.rows)):
            self._last_q[name] = message.rows

    def _send_r(self) -> None:
        """Send R from this robot's functions to their variables; its own variable needs no message.

        If a robot's domain is lost, there is no R yet: this robot's domain requests it.
        """
        if not self._made:
            self._make_functions()
        rows = {name: iter(q) for name, q in self._last_q.items()}
        r: dict[str, list[Row]] = {name: [] for name in self.above}
        self._own = []
        for factor, own in zip(self.factors, self.edges, strict=False):
            answers = factor.r([*[next(rows[name]) for name in factor.agents], own])
            self._own.append(answers.pop())
            for name, row in zip(factor.agents, answers, strict=True):
                r[name].append(row)
        for name in self.above:
            self.send(name, R(r[name]) if name in self._domains else Domain(list(self.problem.values)))
        self.listen(self.below, self._decide)

    def _decide(self, messages: Mapping[str, wire.Message]) -> None:
        """Choose the value with the lowest cost in all R, and send Q."""
        self._has_all &= len(messages) == len(self.below)
        for name, message in messages.items():
            self._record(name, message)
        received = {name: self._last_r[name] for name in self.below if name in self._last_r}
        rows = [*self._own, *(row for r in received.values() for row in r)]
        before, self._shape = self._shape, [("", len(self._own)), *((name, len(received[name])) for name in received)]
        z = self._z(rows)
        if min(z) == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.choose(cheapest(z))
        if self.finished:
            self._record_share()
            return
        self.edges = self._q(rows, z, damped=before == self._shape)
        done = len(self.factors)
        for name, answered in received.items():
            self.send(name, Q(self.edges[done : done + len(answered)]))
            done += len(answered)
        for name in self.below:
            if name not in received:
                self.send(name, Domain(list(self.problem.values)))
        self.listen(self.above, self._receive_q)

    def _z(self, rows: Sequence[Row]) -> Row:
        """Return the cost of each value: its preference and the weighted sum of all `rows` (Z)."""
        return total(self.preferred, weighted(rows, self.settings.reweight))

    def _q(self, rows: Sequence[Row], z: Row, *, damped: bool) -> list[Row]:
        """Return, for each of `rows`, the cost of each value without that row (Q)."""
        if self.settings.diffusion == "yes":
            before = self.edges if damped else [[0.0] * len(z) for _ in rows]
            return [rounded(row) for row in self._damped(before, divided(rows, z))]
        fresh = without_each(self.preferred, rows, z, weight=self.settings.reweight)
        return self._damped(self.edges, fresh) if damped else [from_zero(row) for row in fresh]

    def _damped(self, before: Sequence[Row], fresh: Sequence[Row]) -> list[Row]:
        """Return the weighted means of the last Q and new ones, which are shifted to a minimum of 0."""
        damping = self.settings.damping
        if not damping:
            return [from_zero(row) for row in fresh]
        rest = 1 - damping
        return [
            [damping * old + rest * new for old, new in zip(last, from_zero(row), strict=True)]
            for last, row in zip(before, fresh, strict=True)
        ]

    def _record_share(self) -> None:
        """Compute this robot's share of the lower bound, if no message is missing."""
        if self.settings.diffusion == "yes" and self._has_all and self.problem.values:
            self._share = share_of_bound(self.problem.costs({}), self.edges, self._own)

    def _with(self, name: str) -> list[Factor]:
        return [factor for factor in self.factors if name in factor.agents]
