"""Asynchronous Backtracking with Dynamic Ordering, retroactive (ABT_DO-Retro).

ABT (see `abt.py`) with an order of the robots that changes during search.

- **When to use**: no costs, and no good static order is known.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial.
- **Parameters**: none.
- **References**: Zivan, Meisels: "Dynamic ordering for asynchronous backtracking on DisCSPs", Constraints 11 (2006);
  Zivan, Zazone, Meisels: "Min-domain retroactive ordering for asynchronous backtracking", Constraints 14 (2009).

The methods have the names of ABT's procedures, and these:

    Current_order   `order`      choose_new_order   `_choose_new_order`      received (order, ...)   `_adopt`

The order: a robot that accepts a nogood makes a new order, in which the nogood's sender moves up to just below the
receiver (the nogood-triggered heuristic). The sender moves further, past the receiver and other robots, while these
have more values left than the sender (min-domain), but never past another robot in the nogood. So it stops at the
latest right behind the second-last robot in the nogood, or at the top if there is none.

Orders have counters, which are compared lexicographically; the larger order is newer. The counter of position i is the
number of times that robots from i on were reordered while those before i stayed. A new order increments one counter and
resets those after it. It is sent to all robots from that position on; for robots before it nothing has changed. A robot
that adopts an order drops the nogoods with robots that are now lower, and sends its value to neighbours that are newly
lower.

Termination: suppose the robots before position i have settled, with their values and counters, and all robots know this
(true for i = 0). Counter i then rises only when a lower robot accepts a nogood with these robots alone. That nogood
stays stored, because its left side holds and stays higher, and only a nogood with robots as high may replace it. So its
value is not taken again, and counter i rises finitely often. Then the robot at position i is fixed, and its value
changes finitely often for the same reason; and so on downwards.

Correctness: at quiescence each robot knows the robots above it in the newest order, and all their values that it needs,
because a robot that forgot or never received a value is sent it again. So no constraint is violated.

Choices that the papers leave open, and differences:

- The receiver makes the order for the position that the sender moves to, and stores the nogood. So the moved robot need
  not store it.
- Two robots may increment the same counter at the same time, so each counter also names the robot that did it last.
  Every order is unique.
- Remaining values are those without a stored nogood. A robot is never moved past a robot whose number of remaining
  values is unknown.
- A nogood that does not match the receiver's order is answered with `ok?`, not passed on: one of the two robots will
  receive a newer order.
- As in ABT, constraints may be n-ary (the robot in the scope that is lowest at present checks them, so all must know
  them), messages are read in packets, nogoods contain only the relevant variables, and the runtime detects the
  solution.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(4), Options(protocol="abt-do-retro", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value
'no-solution'
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt_do_messages import AddLink, Counters, Nogood, Ok, Order
from robochoc.protocols.satisfaction.backtracking import Backtracking
from robochoc.protocols.satisfaction.nogood import contradicts
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class CurrentOrder(PriorityOrder):
    """The newest order that a robot knows."""

    def __init__(self, names: tuple[str, ...]) -> None:
        super().__init__(names)
        self.counters: Counters = ()

    def adopt(self, order: Order) -> None:
        """Replace the current order by `order`."""
        self.names = order.names
        self.rank = {name: rank for rank, name in enumerate(order.names)}
        self.counters = order.counters

    def moved(self, agent: str, place: int, by: str) -> Order:
        """Return a newer order, made by robot `by`: `agent` moves up to `place`; robots before this position stay."""
        names = [name for name in self.names if name != agent]
        names.insert(place, agent)
        kept = self.counters[:place] + ((0, ""),) * (place - len(self.counters))
        count = self.counters[place][0] if place < len(self.counters) else 0
        return Order(tuple(names), (*kept, (count + 1, by)))


@mypyc_attr(allow_interpreted_subclasses=True)
class ABTDORetro(Backtracking):
    """One agent of ABT_DO-Retro. State: `view` (Agent_view), `store`, `order`, and `left`.

    - `left`: the numbers of remaining values that other robots have sent.
    - `higher`: robots that send their values to this one while they have higher priority.
    - `listeners`: robots to which this one sends its value while they have lower priority.
    - `owed`: robots that must be sent the value after the current packet of messages, even if it has not changed.
    """

    messages: ClassVar[Any] = Ok | Nogood | Order | AddLink
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Zivan & Meisels 2006; Zivan et al. 2009",
        shared_scopes=True,
        privacy="none",
        use_when="no costs, and no good static order is known",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self._newest = CurrentOrder(order.names)
        super().__init__(problem, self._newest)
        self.left: dict[str, int] = {}
        self.higher = set(problem.neighbours)
        self.listeners = list(problem.neighbours)
        self.owed: set[str] = set()
        self._checked: dict[str, Value] | None = None

    def start(self) -> None:
        """Choose a first value and send it."""
        self.settle()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Ok | Nogood | Order | AddLink", message):
            case Ok(value, left):
                self.left[sender] = left
                self._update(sender, value)
            case Nogood() as nogood:
                self._resolve_conflict(sender, nogood)
            case Order() as order:
                self._adopt(order)
            case AddLink():
                self._set_link(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Check the view, then send the value to the robots that need it."""
        if self.verdict is None:
            self._check_agent_view()
            self._send_value()

    # Messages

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        """Accept a nogood about the current value that agrees with view and order; all other nogoods are obsolete."""
        current = self._current()
        if current is not None and contradicts(nogood.value, current):
            return
        if current is None or not self._coherent(nogood):
            self.owed.add(sender)  # the sender has forgotten this robot's value
            return
        self._check_add_link(nogood)
        for index in self.problem.interchangeable(nogood.value):
            self.store.add(index, nogood.lhs)
        self.value = None
        self._choose_new_order(sender, nogood)

    def _choose_new_order(self, sender: str, nogood: Nogood) -> None:
        """Move the nogood's sender up, and send the new order to all robots whose part of it changed."""
        names = self.order.names
        place = self.order.rank[self.problem.agent] + 1
        self.left[self.problem.agent] = self._left()
        while place > self.order.depth(nogood.lhs) + 1 and self.left.get(names[place - 1], 0) > nogood.left:
            place -= 1
        if place < self.order.rank[sender]:
            order = self._newest.moved(sender, place, self.problem.agent)
            self._adopt(order)
            for name in order.names[place:]:
                if name != self.problem.agent:
                    self.send(name, order)

    def _adopt(self, order: Order) -> None:
        """Adopt `order` if it is newer; drop nogoods with robots that are now lower, and inform new lower robots."""
        if order.counters <= self._newest.counters:
            return
        lower = set(self._lower())
        self._newest.adopt(order)
        self.owed.update(name for name in self._lower() if name not in lower)
        for name in {name for lhs in self.store for name in lhs if not self._is_higher(name)}:
            self.store.forget(name)

    def _set_link(self, sender: str) -> None:
        if sender not in self.listeners:
            self.listeners.append(sender)
        self.owed.add(sender)

    # The search

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another value, or backtrack until there is one."""
        while self.verdict is None:
            higher = {agent: value for agent, value in self.view.items() if self._is_higher(agent)}
            if self.value is not None and (higher == self._checked or self._consistent(self.value, higher)):
                self._checked = higher
                return
            self.value = self._choose_value(higher)
            if self.value is None:
                self._backtrack()
                continue
            self._checked = higher
            self.owed.update(self._lower())
            return

    def _backtrack(self) -> None:
        """Resolve the stored nogoods, one for each value, and send the result to the lowest-priority robot in it."""
        lhs = self.store.resolve()
        if not lhs:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self.order.lowest(lhs)
        value = lhs.pop(culprit)
        self._update(culprit, None)
        self.send(culprit, Nogood(lhs, value, self._left()))

    def _send_value(self) -> None:
        """Send the value to all robots that need it."""
        current = self._current()
        if current is None:
            return  # the search is over
        ok = Ok(current, self._left())
        for name in self.listeners:
            if name in self.owed:
                self.send(name, ok)
        self.owed.clear()

    # The view

    def _coherent(self, nogood: Nogood) -> bool:
        """Return whether all robots in the left side are higher and the view does not contradict it."""
        return all(
            self._is_higher(agent)
            and (agent not in self.higher or (agent in self.view and not contradicts(value, self.view[agent])))
            for agent, value in nogood.lhs.items()
        )

    def _check_add_link(self, nogood: Nogood) -> None:
        """Request links to robots in the nogood that send no values yet; assume the nogood's values for now."""
        for agent in self._assume(nogood.lhs):
            self.send(agent, AddLink())

    def _is_higher(self, agent: str) -> bool:
        return self.order.rank[agent] < self.order.rank[self.problem.agent]

    def _lower(self) -> list[str]:
        """Return the robots that must receive the value under the current order."""
        return [name for name in self.listeners if not self._is_higher(name)]

    def _left(self) -> int:
        """Return the number of this robot's values that no stored nogood rules out."""
        return self.store.open
