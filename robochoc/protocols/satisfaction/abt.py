"""Asynchronous Backtracking (ABT).

Complete search for satisfaction, in which all robots act at the same time. A robot sends its value to lower-priority
neighbours. A robot without a value left sends a nogood to the lowest-priority robot that caused it.

- **When to use**: no costs; easy problems, or hundreds of robots with few neighbours.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial: one
  nogood for each value.
- **Parameters**: none.
- **References**: Yokoo, Durfee, Ishida, Kuwabara: "Distributed constraint satisfaction for formalizing distributed
  problem solving", ICDCS 1992. This is the ABT kernel that adds links during search, from Bessiere, Maestre, Brito,
  Meseguer: "Asynchronous backtracking without adding links: a new member in the ABT family", AIJ 161 (2005), Figure 1.

The methods have the names of the paper's procedures:

    CheckAgentView   `_check_agent_view`     ProcessInfo      `_process_info`
    ChooseValue      `_choose_value`         ResolveConflict  `_resolve_conflict`
    Backtrack        `_backtrack`            SetLink          `_set_link`
    CheckAddLink     `_check_add_link`       Update           `_update`

`_choose_value` and `_update` are in `backtracking.py`, because ABT's variants also use them.

Choices that the paper leaves open:

- Constraints may be n-ary. The lowest-priority robot in the scope checks them, once it knows the values of all others.
- Of several nogoods for a value, the one with the highest possible lowest variable is kept (Hirayama and Yokoo 2000).
- Messages are read in packets; the view is checked when the inbox has been drained.
- A nogood contains only the relevant variables. So it rules out all values of a robot that are interchangeable in these
  variables (neighbourhood partial interchangeability).
- The runtime detects quiescence, and so a solution (`communication/quiescence.py`).

Partially known constraints (PKC): each robot has a part of the constraint that it never reveals. This is the
single-phase ABT of Brito, Meisels, Meseguer, Zivan: "Distributed constraint satisfaction with partially known
constraints", Constraints 14 (2009). The lower-priority robot also sends its value up; the higher one sends a nogood
against pairs that its own part forbids (`_refuse_below`). It then forgets that value, because a new `ok?` is sure to
follow. Without a PKC nothing changes.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(4), Options(protocol="abt", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value, outcome.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.backtracking import Backtracking
from robochoc.protocols.satisfaction.nogood import contradicts
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class ABT(Backtracking):
    """One agent of ABT. State: `view` (myAgentView), `store` (myNogoodStore), Gamma- and Gamma+.

    `below` contains the values sent by lower-priority robots that share a PKC with this robot. `allowed` contains, for
    each of these robots, the value of this robot with which its part of the PKC was last found to allow that value.
    """

    messages: ClassVar[Any] = Ok | Nogood | AddLink
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Yokoo et al. 1992; Bessiere et al. 2005; PKC: Brito et al. 2009",
        partially_known=True,
        privacy="constraints of lower robots; of PKCs every robot's part, but for the pairs that were asked about",
        use_when="no costs: easy, or hundreds of robots with few neighbours",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.lower = list(problem.children)
        self.below: dict[str, Value] = {}
        self.allowed: dict[str, int] = {}

    def start(self) -> None:
        """Choose a first value and send it."""
        self._check_agent_view()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Ok | Nogood | AddLink", message):
            case Ok(value):
                self._process_info(sender, value)
            case Nogood() as nogood:
                self._resolve_conflict(sender, nogood)
            case AddLink():
                self._set_link(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Check the view, then check the values of lower-priority robots against this robot's parts of PKCs."""
        if self.verdict is None:
            self._check_agent_view()
            self._refuse_below()

    # Messages

    def _process_info(self, sender: str, value: Value) -> None:
        if sender in self.problem.children:
            self.below[sender] = value
            self.allowed.pop(sender, None)
        else:
            self._update(sender, value)

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        """Accept a nogood about the current value that agrees with the view; all other nogoods are obsolete."""
        current = self._current()
        if current is None or contradicts(nogood.value, current):
            return
        if self._coherent(nogood):
            self._check_add_link(nogood)
            self._learn(nogood)
            self.value = None
        else:
            # The sender's view was outdated, and the sender has forgotten this robot's value: send it again.
            self.send(sender, Ok(current))

    def _set_link(self, sender: str) -> None:
        if sender not in self.lower:
            self.lower.append(sender)
        current = self._current()
        if current is not None:
            self.send(sender, Ok(current))

    # The search

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another value, or backtrack until there is one."""
        while self.verdict is None:
            if self.value is not None and self._consistent(self.value, self.view):
                return
            self.value = self._choose_value(self.view)
            if self.value is None:
                self._backtrack()
                continue
            self._send_value(self.problem.values[self.value])
            return

    def _send_value(self, value: Value) -> None:
        """Send the value to all robots that depend on it."""
        ok = Ok(value)
        for neighbour in (*self.lower, *self.problem.pkc_parents):
            self.send(neighbour, ok)

    def _backtrack(self) -> None:
        """Resolve the stored nogoods, one for each value, and send the result to the lowest-priority robot in it."""
        lhs = self.store.resolve()
        if not lhs:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self.order.lowest(lhs)
        value = lhs.pop(culprit)
        self.send(culprit, self._nogood(lhs, value))
        self._after_backtrack(culprit)

    def _after_backtrack(self, culprit: str) -> None:
        """Continue after a nogood to `culprit`, which is expected to change its value: forget the old value."""
        self._update(culprit, None)

    def _nogood(self, lhs: dict[str, Value], value: Value) -> Nogood:
        return Nogood(lhs, value)

    def _learn(self, nogood: Nogood) -> None:
        """Store a received nogood for all values that are interchangeable with respect to it."""
        for index in self.problem.interchangeable(nogood.value):
            self.store.add(index, nogood.lhs)

    def _refuse_below(self) -> None:
        """Send nogoods for lower robots' values that this robot's parts of PKCs forbid; check each pair once."""
        if self.value is None or not self.below:
            return
        for child, theirs in list(self.below.items()):
            if self.allowed.get(child) == self.value:
                continue
            refused = self.problem.part_conflict(self.value, child, theirs)
            if refused is None:
                self.allowed[child] = self.value
            else:
                lhs = dict(refused)
                value = lhs.pop(child)
                self.send(child, Nogood(lhs, value))
                del self.below[child]

    # The view

    def _coherent(self, nogood: Nogood) -> bool:
        return all(
            agent in self.view and not contradicts(value, self.view[agent])
            for agent, value in nogood.lhs.items()
            if agent in self.higher
        )

    def _check_add_link(self, nogood: Nogood) -> None:
        """Request links to robots in the nogood that send no values yet; assume the nogood's values for now."""
        for agent in self._assume(nogood.lhs):
            self.send(agent, AddLink())
