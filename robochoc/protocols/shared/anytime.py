"""The best cycle, found by the robots themselves (anytime local search).

Without this module, an outside observer collects the robots' trails and finds the cheapest cycle. With it (`--set
anytime=yes`), the robots first build a breadth-first tree. Then the costs of each step are sent up the tree, and the
number of the best step so far is sent down. At the end each robot has its value in the best step (Zivan, Okamoto,
Peled: "Explorative anytime local search for distributed constraint optimization", AIJ 212, 2014, Section 3). The search
itself does not change: cycles, values and random numbers are the same.

- A step is a cycle with all its values. After each step, a robot sends its value to its neighbours with lower priority
  (`Step`), because the lowest robot in a constraint computes the cost of the constraint.
- A robot adds the cost that it computes to the costs that its children have reported for the step, and reports the sum
  (`Paid`).
- The root compares the costs of the steps and sends the best step so far (`Best`), once for each step.
- A robot remembers its values in the best step, and in the steps for which no `Best` has arrived yet. Its memory is
  bounded: it waits if it would have to remember more steps than twice the tree's height plus 2.

In the paper, this information is part of the search's own messages. Here, it is sent in separate messages, so that it
can be combined with any protocol: one message for each edge and two for each edge of the tree, in each cycle.

The tree is built in rounds. In each round, robots send their neighbours the best root that they know, and their
distance to this root. A robot is complete when its neighbours have the same root and its children are complete. Once a
root is complete, it knows the height of the tree, which it then sends down. So the tree does not depend on delays, and
its paths are shortest paths.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.encoding import Cost
from robochoc.solver.local_problem import LocalProblem

Natural = Annotated[int, msgspec.Meta(ge=0)]


class Place(wire.Message, frozen=True):
    """The sender's position in the breadth-first tree, as far as the sender knows it.

    `parent` is None for a root. `below` is the height of the sender's subtree, once the subtree is complete. `height`
    is the height of the tree.
    """

    root: str
    distance: Natural
    parent: str | None
    below: Natural | None
    height: Natural | None

    act = Act(Performative.INFORM, "the receiver learns a root, and how far the sender is from it")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        parent = "I am a root" if self.parent is None else f"{self.parent} is my parent, {self.root} my root"
        if self.height is not None:
            return f"{parent}; the tree is complete, with a height of {self.height}"
        return f"{parent}, at a distance of {self.distance}"


class Step(wire.Message, frozen=True):
    """The sender's value in its next step (a cycle). The receiver may need the value to compute a constraint's cost."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} in the next step that is to be priced"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class Paid(wire.Message, frozen=True):
    """The cost of the next step in the sender's subtree."""

    cost: int | float

    act = Act(Performative.INFORM, "the receiver adds it to what it pays itself")
    proves_nothing = True  # the cost is a sum over many robots

    def in_words(self, _: Wording) -> str:
        return f"my subtree pays {cost_text(self.cost)} for the next step"


class Best(wire.Message, frozen=True):
    """The best step so far, `step`, sent after every step (None: every step so far violates a hard constraint)."""

    step: Natural | None

    act = Act(Performative.INFORM, "the receiver learns which of its values to remember")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        if self.step is None:
            return "all steps so far broke a hard constraint"
        return f"the best step so far is that of cycle {self.step}"


AnytimeMessage = Place | Step | Paid | Best
"""The messages that a `CycleProtocol` receives besides its own when the robots find the best cycle."""


Sent = list[tuple[str, wire.Message]]


class BreadthFirstTree:
    """One robot's position in the tree: `parent` (None: the root) and `children`, final once `height` is known.

    `height` is the height of the whole tree.
    """

    def __init__(self, agent: str, neighbours: Sequence[str], order: PriorityOrder) -> None:
        self.parent: str | None = None
        self.children: tuple[str, ...] = ()
        self.height: int | None = None
        self._agent = agent
        self._root = agent
        self._distance = 0
        self._rank = order.rank
        self._waiting: dict[str, deque[Place]] = {name: deque() for name in neighbours}

    def start(self) -> Sent:
        """Return the messages of the first round."""
        return self._place_messages(None)

    def receive(self, sender: str, place: Place) -> Sent:
        """Process a neighbour's position; return the messages of the next rounds, if there are any.

        Raises:
            ValueError: if the root is not a robot in the team, or the distance is too large.
        """
        if place.root not in self._rank or place.distance >= len(self._rank):
            raise ValueError(f"{sender} sent a place that is in no tree: root {place.root}, distance {place.distance}")
        self._waiting[sender].append(place)
        sent: Sent = []
        while self.height is None and all(self._waiting.values()):
            sent += self._round({name: places.popleft() for name, places in self._waiting.items()})
        return sent

    def _round(self, others: dict[str, Place]) -> Sent:
        """Process one round, with the positions of all neighbours."""
        heights = [place.height for place in others.values() if place.height is not None]
        if heights:
            self.height = heights[0]
        else:
            self._adopt(others)
        self.children = tuple(name for name, place in others.items() if self._is_child(place))
        below = self._depth_below(others)
        if self._root == self._agent and self.height is None:
            self.height = below
        return self._place_messages(below)

    def _adopt(self, others: dict[str, Place]) -> None:
        """Adopt the best known root, and the neighbour nearest to it as the parent."""
        name, place = min(
            others.items(), key=lambda one: (self._rank[one[1].root], one[1].distance, self._rank[one[0]])
        )
        if self._rank[place.root] < self._rank[self._root]:
            self._root, self._distance, self.parent = place.root, place.distance + 1, name

    def _is_child(self, place: Place) -> bool:
        return place.root == self._root and place.parent == self._agent

    def _depth_below(self, others: dict[str, Place]) -> int | None:
        """Return the height of this robot's subtree; None while it may still grow."""
        if any(place.root != self._root for place in others.values()):
            return None
        depths = [others[name].below for name in self.children]
        return 1 + max((depth for depth in depths if depth is not None), default=-1) if None not in depths else None

    def _place_messages(self, below: int | None) -> Sent:
        place = Place(self._root, self._distance, self.parent, below, self.height)
        return [(name, place) for name in self._waiting]


class Anytime:
    """One robot's part in finding the best step. `best` is its value in the best step that it knows.

    `news` is the last step for which a `Best` has arrived, `last` the last step of the search.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder, last: int) -> None:
        own = order.rank[problem.agent]
        self.tree = BreadthFirstTree(problem.agent, problem.neighbours, order)
        self.best: int | None = None
        self.news = -1
        self.last = last
        self._problem = problem
        self._below = [name for name in problem.neighbours if order.rank[name] > own]
        self._values_above: dict[str, deque[wire.Value]] = {
            name: deque() for name in problem.neighbours if order.rank[name] < own
        }
        self._paid: dict[str, deque[Cost]] = {name: deque() for name in problem.neighbours}
        self._values: dict[int, int] = {}
        self._priced = -1
        self._least: Cost = INFINITE
        self._best_step: int | None = None

    def record(self, step: int, index: int) -> Sent:
        """Record this robot's value in a step; return the messages with this value."""
        self._values[step] = index
        message = Step(self._problem.values[index])
        return [*((name, message) for name in self._below), *self._report()]

    def receive(self, sender: str, message: AnytimeMessage) -> Sent:
        """Process a message; return the answers.

        Raises:
            ValueError: if `sender` cannot have sent this message.
        """
        if isinstance(message, Place):
            return self.tree.receive(sender, message)
        if isinstance(message, Step) and sender in self._values_above:
            self._values_above[sender].append(message.value)
            return self._report()
        if isinstance(message, Paid) and message.cost >= 0:
            self._paid[sender].append(message.cost)
            return self._report()
        if isinstance(message, Best) and sender == self.tree.parent and self.news < self._priced:
            return self._record_best(message.step)
        raise ValueError(f"{sender} sent an unexpected or invalid {type(message).__name__}")

    @property
    def remembered(self) -> int:
        """The number of steps whose values are remembered."""
        return len(self._values)

    def is_ahead(self, cycle: int) -> bool:
        """Return whether a robot in `cycle` has to wait for a `Best`, so that it need not remember more values."""
        return self.tree.height is None or cycle - self.news > 2 * self.tree.height + 2

    def _report(self) -> Sent:
        """Compute the costs of all steps for which the values and the children's reports have arrived."""
        sent: Sent = []
        while (
            self.tree.height is not None
            and self._priced + 1 in self._values
            and all(self._values_above.values())
            and all(self._paid[name] for name in self.tree.children)
        ):
            self._priced += 1
            view = {name: values.popleft() for name, values in self._values_above.items()}
            cost = self._problem.cost(self._values[self._priced], view)
            for name in self.tree.children:
                cost += self._paid[name].popleft()
            sent += self._compare(cost) if self.tree.parent is None else [(self.tree.parent, Paid(cost))]
        return sent

    def _compare(self, cost: Cost) -> Sent:
        """As the root: compare the `cost` of the latest step with the best cost; return the resulting messages."""
        if cost < self._least:
            self._least, self._best_step = cost, self._priced
        return self._record_best(self._best_step)

    def _record_best(self, step: int | None) -> Sent:
        """Record that the best step is now `step`; return the messages that pass it to the children."""
        self.news += 1
        if step is not None and step != self._best_step:
            if step != self.news:
                raise ValueError(f"the best step so far is {step}, neither the latest one nor the one before")
            self._best_step = step
        if step == self.news:
            self.best = self._values[step]
        del self._values[self.news]
        return [(name, Best(step)) for name in self.tree.children]
