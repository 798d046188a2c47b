"""Synchronous Asymmetric Branch and Bound (SyncABB), with one phase or two.

Branch and bound for asymmetric costs: each robot in a constraint pays its own part, which no other robot knows. The
values of the robots so far (the CPA) go from robot to robot in priority order, as in SyncBB. The holder of the CPA
knows only its own side. So the CPA also goes back, and the robots before the holder add the costs of their own sides
for the new value. Only the sum is sent. Once it reaches the bound, the holder takes its next value.

With one phase (`phases=1`), the cost of each new value is computed at once. With two phases, the CPA is first completed
with the sides of lower robots only. Then it goes back once, and each robot adds its sides towards all lower robots.

- **When to use**: asymmetric costs, few robots, and robots should disclose little about their costs.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Space is linear.
- **Parameters (`--set`)**: `phases` (1 or 2, default 1).
- **Reference**: Grinshpoun, Grubshtein, Zivan, Netzer, Meisels: "Asymmetric distributed constraint optimization
  problems", JAIR 47, 2013 (SyncABB-1ph and SyncABB-2ph).

The methods:

    extend the CPA    `_extend` (of SyncBB)      the first phase, or a step of one phase   `_pass_on`
    CPA on its way back                          `_add_side`, `_add_all_sides`
    it has come back, with its cost              `_hand_on`

Information disclosed: robots after a robot learn its values, and the total cost of the CPA. A robot before it learns
the cost of the CPA without its own side. Entries of a part that no CPA requires do not affect any message.

Choices that the paper leaves open, and differences:

- With one phase, a CPA goes back only to robots that share a partially known constraint with its holder, and its cost
  then returns to the holder. In the paper it visits all robots before the holder, and the first one sends it on.
- Totally known constraints are paid by their lowest robot, when it takes a value; they may be n-ary.
- Every message that goes down contains the best path, so no bound is broadcast.
- A robot with an empty domain reports it at once.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.random_csp import random_csp
>>> team = random_csp(5, 3, 0.6, 0, max_cost=9, asymmetric=True)
>>> result = Simulation(team, SyncABB, Concurrent(seed=0)).run()
>>> result.verdict.value, result.assignments["Robot1"]
('solution', {'V1': 1})
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal, assert_never, cast

from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import NOTHING, Proof, Reception, Total, can_take
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.syncbb import Backtrack, BestPath, Cost, SyncBB, Terminate, best_proves
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text, incumbent_text
from robochoc.solver.local_problem import LocalProblem


class SyncABBSettings(Settings, frozen=True):
    """`phases`: 1, the robots before add their costs for each new value at once; 2, only for a complete CPA."""

    phases: Literal[1, 2] = 1


ASK = Act(Performative.QUERY_REF, "the sender asks for the cost that the receiver's side of constraints adds")


class CPA(Message, frozen=True):
    """The current partial assignment: the values of all robots before the receiver, and their cost (`CPA`)."""

    values: list[Value]
    paid: Cost
    best: BestPath

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        values, known = words.partial(self.values), incumbent_text(self.best.bound)
        return f"so far {values}, which costs {cost_text(self.paid)}; {known}; it is {words.receiver}'s turn"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        values = [can_take(*chosen) for chosen in zip(reception.order, self.values, strict=False)]
        return [*values, *best_proves(self.best, reception)]


class CPABack(Message, frozen=True):
    """The CPA on its way back: the new value of `robot`, so that the receiver can add its own side (`CPA_BACK`).

    `left` are the robots that the message must reach after the receiver; `bound` is the cost at which it returns at
    once.
    """

    robot: str
    value: Value
    paid: Cost
    bound: Cost
    left: list[str]

    act = ASK

    def in_words(self, words: Wording) -> str:
        values = words.assigned([(self.robot, self.value)])
        return f"with {values} it costs {cost_text(self.paid)} so far; what does your side of it add?"

    def proves(self, _: Reception) -> Sequence[Proof]:
        return [can_take(self.robot, self.value)]


class FullBack(Message, frozen=True):
    """A complete CPA on its way back, so that the receiver can add its own side towards all robots after it.

    `bound` is the cost at which it returns to the last robot at once.
    """

    values: list[Value]
    paid: Cost
    bound: Cost

    act = ASK

    def in_words(self, words: Wording) -> str:
        values = words.partial(self.values)
        return f"all have values: {values}, which costs {cost_text(self.paid)} so far; what does your side add?"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(*chosen) for chosen in zip(reception.order, self.values, strict=False)]


class Priced(Message, frozen=True):
    """The cost of the CPA with the receiver's value, after all robots before it have added their own sides."""

    paid: Cost

    act = Act(Performative.INFORM, "the answer to `CPABack` or `FullBack`: the cost of the CPA")

    def in_words(self, words: Wording) -> str:
        return f"with {words.receiver}'s value it costs {cost_text(self.paid)} in all"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The cost of the CPA that the receiver has sent back.
        above = reception.order[: reception.order.index(reception.receiver)]
        if not above:
            return NOTHING
        complete = reception.last(FullBack, reception.receiver, above[-1])
        if complete is not None:
            return [Total(dict(zip(reception.order, complete.values, strict=False)), self.paid)]
        taken_up = reception.last(CPA, above[-1], reception.receiver)
        asked = next((one for name in above[::-1] if (one := reception.last(CPABack, reception.receiver, name))), None)
        if taken_up is None or asked is None or asked.robot != reception.receiver:
            return NOTHING
        view = dict(zip(above, taken_up.values, strict=False))
        return [Total({**view, reception.receiver: asked.value}, self.paid)]


class TooCostly(Message, frozen=True):
    """The CPA with the receiver's value costs at least the bound, including the sides of robots before it."""

    act = acts.REJECT_VALUE
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"with {words.receiver}'s value it costs too much"


TWO_PHASES = 2


class SyncABB(SyncBB):
    """One agent of SyncABB. State: as in SyncBB; `values` are those of the robots before it, which cost `paid`."""

    messages = CPA | CPABack | FullBack | Priced | TooCostly | Backtrack | Terminate
    settings: ClassVar[SyncABBSettings] = SyncABBSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Grinshpoun, Grubshtein, Zivan, Netzer & Meisels 2013",
        synchronous=True,
        costs=True,
        upper_bound=True,
        partially_known=True,
        asymmetric=True,
        privacy="parts of PKC but in sums, constraints of lower robots",
        use_when="asymmetric costs, few robots",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.values: list[Value] = []

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("CPA | CPABack | FullBack | Priced | TooCostly | Backtrack | Terminate", message):
            case CPA() as cpa:
                self._start_cpa(cpa)
            case CPABack() as back:
                self._add_side(back)
            case FullBack() as back:
                self._add_all_sides(back)
            case Priced(paid):
                if not self._hand_on(paid):
                    self._extend(self._next)
            case TooCostly():
                self._extend(self._next)
            case Backtrack() | Terminate():
                super().receive(sender, message)
            case never:
                assert_never(never)

    # The holder

    def _start_cpa(self, cpa: CPA) -> None:
        """Choose the first value with a CPA of all robots before, if its values are possible."""
        if len(cpa.values) != self.rank:
            raise ValueError(f"a CPA for {self.problem.agent} has {self.rank} values, not {len(cpa.values)}")
        self._view = dict(zip(self.order.names, cpa.values, strict=False))
        for robot, value in self._view.items():
            self.problem.refuse_value(robot, value)
        self.values, self.paid, self.best = cpa.values, cpa.paid, cpa.best
        self._extend(0)

    def _pass_on(self, cost: Cost) -> bool:
        """Send the CPA back for its cost if robots before this one have a side in it; otherwise pass it on."""
        paid = self.paid + cost
        if self.settings.phases == TWO_PHASES:
            if not self.rank or self.rank + 1 < len(self.order.names):
                return self._hand_on(paid)
            self.send(self.order.names[self.rank - 1], FullBack(self._all_values, paid, self.best.bound))
            return True
        if not self.problem.pkc_parents:
            return self._hand_on(paid)
        *others, lowest = self.problem.pkc_parents
        self.send(lowest, CPABack(self.problem.agent, self._all_values[-1], paid, self.best.bound, others))
        return True

    def _hand_on(self, paid: Cost) -> bool:
        """Send the CPA to the next robot. Return False if it is complete, and so the best one."""
        if self.rank + 1 < len(self.order.names):
            self.send(self.order.names[self.rank + 1], CPA(self._all_values, paid, self.best))
            return True
        self.best = BestPath(paid, tuple(self._all_values))
        return False

    @property
    def _all_values(self) -> list[Value]:
        """The CPA with this robot's value."""
        assert self.value is not None  # noqa: S101 - for mypy: the holder has one
        return [*self.values, self.problem.values[self.value]]

    @property
    def _next(self) -> int:
        """The index of this robot's next value."""
        return 0 if self.value is None else self.value + 1

    # The robots before

    def _add_side(self, back: CPABack) -> None:
        """Add this robot's side of constraints with the CPA's holder; send the CPA further back, or to its holder."""
        above = self.order.names[: self.rank]
        if back.robot not in self.problem.children or not {*back.left} <= {*above}:
            raise ValueError(f"unexpected returning CPA of {back.robot}")
        paid = back.paid + self._side(back.robot, back.value)
        if paid >= back.bound:
            self.send(back.robot, TooCostly())
        elif back.left:
            *others, lowest = back.left
            self.send(lowest, CPABack(back.robot, back.value, paid, back.bound, others))
        else:
            self.send(back.robot, Priced(paid))

    def _add_all_sides(self, back: FullBack) -> None:
        """Add this robot's side of constraints with all robots after it, and send the complete CPA further back."""
        names = self.order.names
        if len(back.values) != len(names):
            raise ValueError(f"a complete CPA has {len(names)} values, not {len(back.values)}")
        values = dict(zip(names, back.values, strict=True))
        paid = back.paid + sum(self._side(child, values[child]) for child in self.problem.children)
        if paid >= back.bound:
            self.send(names[-1], TooCostly())
        elif self.rank:
            self.send(names[self.rank - 1], FullBack(back.values, paid, back.bound))
        else:
            self.send(names[-1], Priced(paid))

    def _side(self, robot: str, value: Value) -> Cost:
        """Return the cost of this robot's side of constraints with `robot`, for its `value` and this robot's value."""
        if self.value is None:
            raise ValueError(f"unexpected returning CPA of {robot}: {self.problem.agent} has no value in it")
        broken, cost = self.problem.own_side(self.value, robot, value)
        return INFINITE if broken else cost
