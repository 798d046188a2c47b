"""Asynchronous Backtracking with Dynamic Ordering, retroactive (ABT_DO-Retro).

Zivan, Meisels: "Dynamic ordering for asynchronous backtracking on DisCSPs", Constraints 11 (2006); Zivan, Zazone,
Meisels: "Min-domain retroactive ordering for asynchronous backtracking", Constraints 14 (2009). ABT, whose names the
methods bear (see `abt.py`), under an order of the robots that changes during search:

    Current_order   `order`      choose_new_order   `_choose_new_order`      received (order, ...)   `_adopt`

Complete, asynchronous, for satisfaction, in polynomial space. Whoever accepts a nogood makes a new order: the sender
moves up (the nogood-triggered heuristic), to right below the receiver, and from there past the receiver itself and
others for as long as they have more values left than the sender (min-domain), but never past a robot that the nogood
rests on: at the highest to right behind the second-last robot of the nogood, or to the top if there is none.

Orders bear counters, compared lexicographically, the larger newer. The counter of place i counts how often robots
from i on were reordered while those before i stayed; a new order raises one and drops those after it. It is told to
all from that place on; to those before it nothing has changed. Who adopts an order drops the nogoods that rest on
robots now lower, and tells its value to neighbours newly lower.

Why it ends: suppose the robots before place i have come to rest, with their values and counters, and all have heard
of it (so for i = 0). Counter i then rises only when a lower robot accepts a nogood that rests on them alone. That one
stays stored: what it rests on stands and stays above, and only a nogood that rests on robots as high may take its
place. So its value is not taken again, and counter i rises finitely often. Then it is settled who stands at place i,
and its value changes finitely often for the same reason; and so on downwards. Why it is right: when nobody speaks any
more, each robot knows who is higher in the newest order, and the values of those of them that it has to know, as who
has forgotten or never heard one is told it again; so no constraint is broken that any robot answers for.

What the papers leave open, or may have otherwise: the receiver makes the order for the place that the sender moves
to, as it keeps the nogood that the move rests on (so the moved robot does not have to keep it); as two may raise one
counter at a time, each counter also names who raised it last, which makes every order unique. Values left are those
without a stored nogood; a robot whose number is not known is not passed. A nogood that is not of the receiver's
present order is answered with `ok?`, not passed on: a newer order is under way to one of the two. As in ABT,
constraints may be n-ary (the lowest of the scope at present checks them, so all of it have to know them), messages
are read by packets, and a nogood names only the variables that matter. That a solution stands is for the runtime to
see.
"""

from __future__ import annotations

from typing import assert_never, cast

from robochoc.model.message import Message, Value
from robochoc.model.outcome import Verdict
from robochoc.model.wording import Wording, listed
from robochoc.protocols import acts
from robochoc.protocols.backtracking import Backtracking
from robochoc.protocols.nogood import contradicts
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem

Counters = tuple[tuple[int, str], ...]
"""For each place how often robots from there on were reordered, and who did so last; zeros at the end left out."""


class Ok(Message, frozen=True):
    """The sender's value and its number of remaining values, sent to lower-priority neighbours (`ok?`)."""

    value: Value
    left: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} from now on; {_not_ruled_out(self.left)}"


class Nogood(Message, frozen=True):
    """A nogood: the receiver cannot take `value` while all assignments in `lhs` hold.

    If the receiver changes its value, the sender has `left` values that no nogood rules out.
    """

    lhs: dict[str, Value]
    value: Value
    left: int

    act = acts.RULE_OUT
    backtracks = True

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.nogood(self.lhs, self.value)}; without that value, {_not_ruled_out(self.left)}"


class Order(Message, frozen=True):
    """A new order of all robots, highest priority first (`order`)."""

    names: tuple[str, ...]
    counters: Counters

    act = acts.TELL_ORDER

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"the order is now {listed(self.names)}"


class AddLink(Message, frozen=True):
    """A request to be sent the receiver's value from now on, while the receiver has higher priority."""

    act = acts.ADD_LINK

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"tell me {words.variables(words.receiver)} from now on, whenever you are above me"


def _not_ruled_out(left: int) -> str:
    return f"{left:,} of my values {'is' if left == 1 else 'are'} not ruled out"


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
        """Return a newer order, made by robot `by`: `agent` moves up to `place`; robots before it stay."""
        names = [name for name in self.names if name != agent]
        names.insert(place, agent)
        kept = self.counters[:place] + ((0, ""),) * (place - len(self.counters))
        count = self.counters[place][0] if place < len(self.counters) else 0
        return Order(tuple(names), (*kept, (count + 1, by)))


class ABTDORetro(Backtracking):
    """One agent of ABT_DO-Retro. State: `view` (Agent_view), `store`, `order`, and `left`.

    - `left`: the numbers of remaining values that other robots sent.
    - `higher`: robots that send this one their values while they have higher priority.
    - `tells`: robots that this one sends its value to while they have lower priority.
    - `owed`: robots that must be sent the value after the packet, even if it has not changed.
    """

    messages = Ok | Nogood | Order | AddLink
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Zivan & Meisels 2006; Zivan et al. 2009",
        shared_scopes=True,
        privacy="none",
        use_when="no costs, and no good static order is known",
    )
    order: CurrentOrder

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, CurrentOrder(order.names))
        self.left: dict[str, int] = {}
        self.higher = set(problem.neighbours)
        self.tells = list(problem.neighbours)
        self.owed: set[str] = set()
        self._checked: dict[str, Value] | None = None

    def start(self) -> None:
        """Choose a first value and send it."""
        self.settle()

    def receive(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type."""
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
            self._tell()

    # What the messages do

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        """Accept a nogood about the current value that agrees with view and order; others are obsolete."""
        current = self._current()
        if current is not None and contradicts(nogood.value, current):
            return
        if current is None or not self._coherent(nogood):
            self.owed.add(sender)  # it has forgotten the value
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
            order = self.order.moved(sender, place, self.problem.agent)
            self._adopt(order)
            for name in order.names[place:]:
                if name != self.problem.agent:
                    self.send(name, order)

    def _adopt(self, order: Order) -> None:
        """Adopt `order` if it is newer; drop nogoods with robots that are now lower, and inform new lower robots."""
        if order.counters <= self.order.counters:
            return
        lower = set(self._lower())
        self.order.adopt(order)
        self.owed.update(name for name in self._lower() if name not in lower)
        for name in {name for lhs in self.store for name in lhs if not self._is_higher(name)}:
            self.store.forget(name)

    def _set_link(self, sender: str) -> None:
        if sender not in self.tells:
            self.tells.append(sender)
        self.owed.add(sender)

    # The search

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another, or backtrack until there is one."""
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
        """Resolve the stored nogoods, one for each value, and send the result to its lowest-priority robot."""
        lhs = self.store.resolve()
        if not lhs:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self.order.lowest(lhs)
        value = lhs.pop(culprit)
        self._update(culprit, None)
        self.send(culprit, Nogood(lhs, value, self._left()))

    def _tell(self) -> None:
        """Send the value to all robots that need it."""
        current = self._current()
        if current is None:
            return  # the search is over
        ok = Ok(current, self._left())
        for name in self.tells:
            if name in self.owed:
                self.send(name, ok)
        self.owed.clear()

    # The view

    def _coherent(self, nogood: Nogood) -> bool:
        """Return whether all robots of the left side are higher and the view does not contradict it."""
        return all(
            self._is_higher(agent)
            and (agent not in self.higher or (agent in self.view and not contradicts(value, self.view[agent])))
            for agent, value in nogood.lhs.items()
        )

    def _check_add_link(self, nogood: Nogood) -> None:
        """Request links to robots of the nogood that send no values yet; assume its values for now."""
        for agent in self._believe(nogood.lhs):
            self.send(agent, AddLink())

    def _is_higher(self, agent: str) -> bool:
        return self.order.rank[agent] < self.order.rank[self.problem.agent]

    def _lower(self) -> list[str]:
        """Return the robots that are sent the value under the current order."""
        return [name for name in self.tells if not self._is_higher(name)]

    def _left(self) -> int:
        """Return the number of own values that no stored nogood rules out."""
        return sum(self.store[index] is None for index in range(len(self.problem.values)))
