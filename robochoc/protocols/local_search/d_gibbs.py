"""Distributed Gibbs (D-Gibbs).

Sampling on a pseudo-tree. In each cycle the robots draw new values, from the root down: a cheap value has a high
probability, given the values of all neighbours. Neighbours never draw at the same time. From the leaves up, the robots
add up the changes in cost caused by the sample. So the root knows which sample was the best, though no robot knows its
cost, and in the end all robots choose their values in that sample.

- **When to use**: costs, and little memory: good results where local search is stuck, because more expensive values are
  drawn too.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The values at the end are
  those in the best sample of each pseudo-tree. Memory is linear in the number of neighbours. A robot with an empty
  domain proves that there is no solution.
- **Parameters (`--set`)**: `temperature` (default 1: as in the paper), `cooling` (the factor that multiplies it after
  each cycle; default 1), `hard` (default 4), `cycles` (default 100).
- **Reference**: Nguyen, Yeoh, Lau: "Distributed Gibbs: a memory-bounded sampling-based DCOP algorithm", AAMAS 2013.

The parts of the algorithm:

    build the pseudo-tree       `dfs.TreeProtocol`    BACKTRACK, from the leaves up    `_send_difference`
    VALUE, from the root down   `_sample`             the root keeps the best          `_record_sample`

A value is drawn with a probability proportional to exp(-cost / temperature), where the cost is that of all constraints
between the robot and its neighbours, given their present values. Robots above have already drawn in this cycle, robots
below have not. So the samples are those of robots that draw one after the other, and the change in cost is exactly the
sum of the robots' changes. In the paper, the temperature is 1.

Choices that the paper leaves open, and differences:

- The first value is chosen at random. Robots send it to the neighbours above before the first cycle.
- In the record, a value that breaks more hard constraints than another is never better, whatever its cost; for each
  additional broken constraint it is drawn e^`hard` times less often.
- The next VALUE from the root reports whether the last sample was the best. Then robots store their values in this
  sample.
- The paper also records what the best value of each robot would have saved. Here only samples are recorded.
- Constraints may be n-ary, because all robots in a scope are on one branch. Unconnected parts of the team have a
  separate tree and record each.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), DGibbs, Concurrent(seed=0)).search()
>>> result.metrics.messages["Value"], result.metrics.messages["Difference"], result.metrics.messages["Finish"]
(5628, 800, 8)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import ClassVar, assert_never, cast

import msgspec

from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.findings import Findings, Trail
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import NO_GAIN, CycleCount, gain
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.plain_text import counted, listed


class DGibbsSettings(CycleCount, frozen=True):
    """`temperature`: the additional cost of a value with which it is drawn e times less often.

    `cooling`: the factor that multiplies it after each cycle. `hard`: for each additional broken hard constraint, a
    value is drawn e^hard times less often. `cycles`: the number of samples.
    """

    temperature: float = 1.0
    cooling: float = 1.0
    hard: float = 4.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.temperature < math.inf:
            raise ValueError(f"temperature is {self.temperature:g}; it must be more than 0, and finite")
        if not 0 < self.cooling <= 1:
            raise ValueError(f"cooling is {self.cooling:g}; it must be more than 0 and at most 1")
        if not 0 <= self.hard < math.inf:
            raise ValueError(f"hard is {self.hard:g}; it must be 0 or more, and finite")


def _record(kept: bool) -> str:  # noqa: FBT001 - a field of two messages
    return "the last sample was the best so far" if kept else "the last sample was not better than the best"


class Value(wire.Message, frozen=True):
    """The sender's value in a sample; `kept`: the previous sample is the best so far (VALUE)."""

    value: wire.Value
    kept: bool

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} in this sample; {_record(self.kept)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class Difference(wire.Message, frozen=True):
    """The change in the subtree's cost since the last sample: broken hard constraints, and costs (BACKTRACK).

    A reduction is negative.
    """

    broken: int
    cost: int

    act = Act(
        Performative.INFORM, "the receiver learns by how much the sample changes the cost of the sender's subtree"
    )
    proves_nothing = True  # it is a difference of sums

    def in_words(self, _: Wording) -> str:
        changes = [_change(self.broken, counted(abs(self.broken), "broken constraint"))] if self.broken else []
        changes += [_change(self.cost, f"{cost_text(abs(self.cost))} of cost")] if self.cost else []
        return f"by this sample my subtree has {listed(changes) or 'no other cost'}"


def _change(number: int, text: str) -> str:
    return f"{text} {'more' if number > 0 else 'less'}"


class Finish(wire.Message, frozen=True):
    """The end: all robots choose their values in the best sample. `kept`: the last sample is the best."""

    kept: bool

    act = acts.TERMINATE
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"the search is over: take your value of the best sample; {_record(self.kept)}"


COLDEST = 1e-9
"""Below this temperature only the cheapest values are drawn."""


class DGibbs(TreeProtocol):
    """One agent of D-Gibbs.

    State: `cycle`, this robot's value in it, the `view` of the neighbours' values, `best` (its value in the best
    sample), and the sums of changes: `change` in this cycle, and (at the root) `total` and `record` since the start.
    """

    messages = TreeMessage | Value | Difference | Finish
    settings: ClassVar[DGibbsSettings] = DGibbsSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Nguyen, Yeoh, Lau 2013",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, little memory: samples that leave local optima",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.cycle = -1
        self.view: dict[str, wire.Value] = {}
        self.best = 0
        self.change: LexicographicCost = NO_GAIN
        self.total: LexicographicCost = NO_GAIN
        self.record: LexicographicCost = NO_GAIN
        self._kept = self._sent_difference = True
        self._trail: list[tuple[int, int]] = []
        self._received = dict.fromkeys(problem.neighbours, 0)
        """The number of values received from each neighbour."""
        self._changes: dict[str, LexicographicCost] = {}
        """The change in the cost of each child's subtree in this cycle."""

    def start_in_tree(self) -> None:
        """Choose the start value or a random value, and send it to the neighbours above.

        A robot without neighbours chooses the cheapest value.
        """
        size = len(self.problem.values)
        if not self.problem.neighbours:
            costs = self.problem.lexicographic_costs({})
            self.cycle = self.settings.cycles
            self._choose(costs.index(min(costs)))
            return
        start = self.problem.start
        self._choose(int(self.chance() * size) if start is None else start)
        self.best = self._present
        self._send_value(self.ancestors)

    def handle(self, sender: str, message: wire.Message) -> None:
        match cast("Value | Difference | Finish", message):
            case Value(value, kept):
                self.problem.refuse_value(sender, value)
                self.view[sender] = value
                self._received[sender] += 1
                self._kept = kept if sender == self.parent else self._kept
            case Difference(broken, cost):
                if sender not in self.children or sender in self._changes:
                    raise ValueError(f"{sender} sent an unexpected or repeated Difference")
                self._changes[sender] = broken, cost
            case Finish(kept):
                if sender != self.parent:
                    raise ValueError(f"{sender} ended the search, but is not the parent of {self.problem.agent}")
                self._kept = kept
                self._finish()
            case never:
                assert_never(never)

    def decide(self) -> None:
        """Draw a value, or add up the changes, as soon as all necessary messages have arrived."""
        going = True
        while going and self.cycle <= self.settings.cycles:
            going = False
            if not self._sent_difference and len(self._changes) == len(self.children):
                self._send_difference()
                going = True
            if self._may_sample():
                self._sample()
                going = True

    def _may_sample(self) -> bool:
        """Return whether all robots above have drawn in this cycle, and all robots below in the previous cycle."""
        if not self.problem.neighbours or self.cycle >= self.settings.cycles:
            return False
        below = all(self._received[name] == self.cycle + 1 for name in self.descendants)
        return below and self._sent_difference and all(self._received[name] > self.cycle for name in self.ancestors)

    def _sample(self) -> None:
        """Draw the next value, given all neighbours' values, and send it."""
        if self._kept:
            self.best = self._present
        costs = self.problem.lexicographic_costs(self.view)
        before = costs[self._present]
        self._choose(self._draw(costs))
        self.change = gain(costs[self._present], before)
        self._changes.clear()
        self._sent_difference = False
        self._send_value(self.problem.neighbours)

    def _draw(self, costs: list[LexicographicCost]) -> int:
        """Return the index of a random value, drawn with the probabilities given by its costs."""
        broken, cost = min(costs)
        temperature = max(COLDEST, self.settings.temperature * self.settings.cooling**self.cycle)
        weights = [
            math.exp(-max(0, paid - cost) / temperature - self.settings.hard * (more - broken)) for more, paid in costs
        ]
        sums = list(accumulate(weights))
        point = self.chance() * sums[-1]
        return next((place for place, end in enumerate(sums) if point < end), len(sums) - 1)

    def _send_difference(self) -> None:
        """Send the parent the change in this subtree in this cycle; the root compares the sample with the best one."""
        self._sent_difference = True
        for broken, cost in self._changes.values():
            self.change = self.change[0] + broken, self.change[1] + cost
        if self.parent is None:
            self._record_sample()
        else:
            self.send(self.parent, Difference(*map(int, self.change)))

    def _record_sample(self) -> None:
        """Decide whether the sample is the best so far; after the last one, end the search."""
        self.total = self.total[0] + self.change[0], self.total[1] + self.change[1]
        self._kept = self.total < self.record
        self.record = min(self.record, self.total)
        if self.cycle >= self.settings.cycles:
            self._finish()

    def _finish(self) -> None:
        """Choose the value in the best sample, and make all robots below do the same."""
        for child in self.children:
            self.send(child, Finish(self._kept))
        self._choose(self._present if self._kept else self.best)

    def _send_value(self, names: tuple[str, ...]) -> None:
        value = Value(self.problem.values[self._present], self._kept)
        for name in names:
            self.send(name, value)

    def _choose(self, index: int) -> None:
        """Set this robot's value for the next cycle."""
        self.cycle += 1
        if index != self.value:
            self.value = index
            self._trail.append((self.cycle, index))

    @property
    def _present(self) -> int:
        assert self.value is not None  # noqa: S101 - for mypy: `start_in_tree` chooses one
        return self.value

    @property
    def findings(self) -> Findings:
        """The position in the tree, and this robot's value in every cycle."""
        return msgspec.structs.replace(super().findings, trail=Trail(list(self._trail), self.cycle))
