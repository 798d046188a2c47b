"""Nogood-based Asynchronous Forward Checking (AFC-ng).

Complete search for satisfaction. A current partial assignment (CPA) grows along the priority order, and lower robots
check forward with its copies. A robot without a value left sends a nogood to the lowest-priority robot among the
causes, wherever the CPA is. So several robots may backtrack at once; the strongest of the resulting CPAs wins.

- **When to use**: no costs, a hard problem: few messages and checks.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial: one
  nogood for each value.
- **Parameters**: none.
- **References**: Ezzahir, Bessiere, Wahbi, Benelallam, Bouyakhf: "Asynchronous inter-level forward-checking for
  DisCSPs", CP 2009; Wahbi, Ezzahir, Bessiere, Bouyakhf: "Nogood-based asynchronous forward checking algorithms",
  Constraints 18(3), 2013, Section 3.

The methods have the names of the paper's procedures:

    Assign          `_assign`              Revise       `_revise`
    SendCPA         `_send_cpa`            Backtrack    `_backtrack`
    ProcessCPA      `_process_cpa`         Compatible   `_compatible`
    ProcessNogood   `_process_nogood`      CheckAssign  `_check_assign`
    UpdateAgentView `_update_agent_view`

Choices that the paper leaves open, and differences:

- In the paper a CPA goes to all lower robots. Here it goes to the next robot and to those that share a constraint with
  its sender, which saves more than half of all messages if there are few constraints. This is sufficient: no other
  robot can check anything with it; its values of higher robots are also in later CPAs, which are compared by all
  counters; and the next robot, the only one that may continue, receives every CPA.
- Messages are read in packets; the view is revised when the inbox has been drained, so weak CPAs in a packet cost no
  checks.
- A CPA with exactly the counters in the view is not stronger: otherwise a late copy would erase later assignments.
- A value with a nogood is not checked again; a constraint whose robots are all above the first changed value is not
  checked again either.
- Constraints may be n-ary, and a nogood contains only the variables that matter (see `abt`).
- A robot with an empty domain reports it at the start.

Correctness: the last robot's CPA is a solution, and all robots have its values at that moment. The first robot changes
its value only for a nogood without a left side, which no value in a solution can get; the second robot only for such a
nogood or a new CPA from the first, and so on. `Solved` ends the search.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), AFCng, Concurrent(seed=0)).run()
>>> result.verdict.value, result.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.afc_ng_messages import CPA, Assignment, Solved
from robochoc.protocols.satisfaction.afc_ng_view import AgentView
from robochoc.protocols.satisfaction.nogood import NogoodStore, contradicts
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr

_NEVER: Final = sys.maxsize
"""Less than all ranks in the order."""
_FEW: Final = 32
"""The maximum number of assignments that are compared one by one; longer ranges are halved."""


@mypyc_attr(allow_interpreted_subclasses=True)
class AFCng(Protocol):
    """One agent of AFC-ng. State: `view` (AgentView), `store` (NogoodStore), `counter` (t_i).

    - `view`: the values of the robots whose values a CPA contains, or of the highest of them.
    - `successors`: the robots that may assign a value after this one.
    - `cpa_receivers`: all robots that receive its CPAs.
    - `checked`: for each value of this robot, the rank up to which all constraints were known to hold in the view when
      the values were last checked.
    - `_known`: the content of `view`, as received.
    - `_changed`: the rank of the highest robot that has changed in the view since then.
    - `_forgotten`: the counters of robots that are no longer in the view.
    - `_seen`: the part of the view in the scopes of constraints; `_near`: the robots in it, with their positions in a
      CPA.
    """

    messages: ClassVar[Any] = CPA | Nogood | Solved
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Ezzahir et al. 2009; Wahbi, Ezzahir, Bessiere, Bouyakhf 2013",
        privacy="constraints of lower robots",
        use_when="no costs, hard problem: few messages and checks",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self._rank = order.rank[problem.agent]
        self._line, self._places, self._above = self._cpa_order()
        self._near = [(place, name) for name in problem.neighbours if (place := self._place_above(name)) is not None]
        self.successors = self._successors()
        self.cpa_receivers = [*self.successors, *(child for child in problem.children if child not in self.successors)]
        self.view = AgentView(self._line, self._places)
        self._known: tuple[Assignment, ...] = ()
        self.counter = 0
        self.store = NogoodStore(order, len(problem.values))
        self.checked = [0] * len(problem.values)
        self._seen: dict[str, Value] = {}
        self._forgotten: list[int] = []
        self._changed = 0
        self.solved = False

    def start(self) -> None:
        """Assign a value, as the first robot; a robot with an empty domain ends the search."""
        self.settle()

    def receive(self, sender: str, message: Message) -> None:  # noqa: ARG002 - a CPA says itself who has sent it
        if self.solved or self.verdict is not None:
            return
        if isinstance(message, CPA):  # checked before `match`, which is slower: most messages are CPAs
            self._process_cpa(message.assignments)
            return
        match cast("Nogood | Solved", message):
            case Nogood() as nogood:
                self._process_nogood(nogood)
            case Solved(solution):
                self._process_solved(solution)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Check forward, then backtrack or assign a value."""
        if not self.solved and self.verdict is None:
            self._revise()
            self._check_assign()

    @property
    def over(self) -> bool:
        """True if this robot knows the result of the search, and so sends no more messages."""
        return self.solved or self.verdict is not None

    @property
    def counters(self) -> list[int]:
        """The last known counters of the robots above, the highest robot's first."""
        return [*_counters(self._known), *self._forgotten]

    # Messages

    def _process_cpa(self, assignments: tuple[Assignment, ...]) -> None:
        """Accept a CPA that is stronger than the view: the first counter that differs is larger."""
        known = self._known
        first, size, common = first_difference(known, assignments), len(assignments), len(known)
        if first < size and first < common:
            if assignments[first][1] <= known[first][1]:
                return
        else:
            counters = _counters(assignments[first:])
            if counters <= self._forgotten[: len(counters)]:
                return
        if size < common:
            self._forgotten[:0] = _counters(known[size:])
        else:
            del self._forgotten[: size - common]
        self._update_agent_view(assignments, first)
        self.value = None

    def _process_nogood(self, nogood: Nogood) -> None:
        """Accept a nogood that agrees with the view; all other nogoods are obsolete."""
        if not self._compatible(nogood.lhs):
            return
        for index in self.problem.interchangeable(nogood.value):
            self.store.add(index, nogood.lhs)
        if self.value is not None and self.store[self.value] is not None:
            self.value = None

    def _process_solved(self, solution: Mapping[str, Value]) -> None:
        (self.value,) = self.problem.interchangeable(solution[self.problem.agent])
        self.solved = True

    # The search

    def _check_assign(self) -> None:
        """Backtrack if no value is left; assign a value if this robot holds the CPA and has no value."""
        if not self.store.open:
            self._backtrack()
        elif self.value is None and len(self._known) == self._above:
            self._assign()

    def _assign(self) -> None:
        """Choose the start value, or the first remaining value if there is none, and send the CPA on."""
        start = self.problem.start
        index = start if start is not None and self.store[start] is None else self.store.first_open()
        assert index is not None  # noqa: S101 - for mypy: a value is left
        self.value = index
        self.counter += 1
        self._send_cpa((self.problem.values[index], self.counter))
        self._detect_solution()

    def _send_cpa(self, own: Assignment) -> None:
        cpa = CPA((*self._known, own))
        for robot in self.cpa_receivers:
            self.send(robot, cpa)

    def _detect_solution(self) -> None:
        """Report a solution once the lowest-priority robot has a value."""
        if not self.successors and self.value is not None:
            self._stop({**self.view, self.problem.agent: self.problem.values[self.value]})

    def _stop(self, solution: dict[str, Value]) -> None:
        """Send `Solved` to all robots in `solution`."""
        self.solved = True
        solved = Solved(solution)
        for robot in solution:
            if robot != self.problem.agent:
                self.send(robot, solved)

    def _backtrack(self) -> None:
        """Resolve the stored nogoods, send the result to the lowest-priority robot in it, and wait for that robot."""
        lhs = self.store.resolve()
        if not lhs:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self.order.lowest(lhs)
        value = lhs.pop(culprit)
        self.send(culprit, Nogood(lhs, value))
        known, place = self._known, self._places[culprit]
        self._forgotten[:0] = _counters(known[place:])
        self._update_agent_view(known[:place], place)
        self.value = None

    def _revise(self) -> None:
        """Store a nogood for each value that the view forbids; its lowest robot is as high as possible.

        Values that were checked against the same part of the view are processed together.
        """
        changed = self._changed
        if changed == _NEVER:
            return
        self._changed = _NEVER
        depth, values = self._depth(), self.store.all_open()
        checked = self.checked = [place if place < changed else changed for place in self.checked]  # noqa: FURB136 - faster
        for place, indices in _grouped(values, checked):
            if place == depth:
                break
            for index in indices:
                checked[index] = depth
            for conflict, ruled_out in self.problem.conflicts_of(indices, self._seen, place):
                lowest = self.order.depth(conflict)
                self.store.rule_out(ruled_out, conflict)
                for index in ruled_out:
                    checked[index] = lowest

    # The view

    def _update_agent_view(self, assignments: tuple[Assignment, ...], first: int) -> None:
        """Replace the view by `assignments`, which differ from index `first` on; drop nogoods with other values."""
        known = self._known
        self._known = self.view.assignments = assignments
        known_size, size = len(known), len(assignments)
        while first < known_size and first < size and known[first][0] == assignments[first][0]:
            first += 1
        if first == known_size == size:
            return
        self._seen = {name: assignments[place][0] for place, name in self._near if place < size}
        self.store.forget_others(assignments, self._places, first)
        place = self.order.rank[self._line[first]]
        if place < self._changed:  # noqa: PLR1730 - faster
            self._changed = place

    def _compatible(self, lhs: Mapping[str, Value]) -> bool:
        known, places = self._known, self._places
        for agent, value in lhs.items():
            place = places.get(agent, _NEVER)
            if place >= len(known) or contradicts(value, known[place][0]):
                return False
        return True

    def _depth(self) -> int:
        """Return the rank of the first robot outside the view; this robot's rank if the view is complete."""
        known = len(self._known)
        return self.order.rank[self._line[known]] if known < self._above else self._rank

    def _place_above(self, name: str) -> int | None:
        """Return the position of `name` in a CPA; None if the robot is below this one."""
        place = self._places.get(name)
        return None if place is None or place >= self._above else place

    def _cpa_order(self) -> tuple[Sequence[str], Mapping[str, int], int]:
        """Return a sequence of robots, their positions, and how many of its first robots have values in a CPA."""
        return self.order.names, self.order.rank, self._rank

    def _successors(self) -> Sequence[str]:
        return self.order.names[self._rank + 1 : self._rank + 2]


def first_difference(left: tuple[object, ...], right: tuple[object, ...]) -> int:
    """Return the first index at which two partial assignments differ; the shorter length if there is none."""
    first, last = 0, min(len(left), len(right))
    while last - first > _FEW:  # slices are compared faster than their items
        middle = (first + last) // 2
        if left[first:middle] == right[first:middle]:
            first = middle
        else:
            last = middle
    while first < last:
        one, other = left[first], right[first]
        if one is not other and one != other:
            break
        first += 1
    return first


def _counters(assignments: tuple[Assignment, ...]) -> list[int]:
    return [counter for _, counter in assignments]


def _grouped(indices: list[int], places: Sequence[int]) -> list[tuple[int, list[int]]]:
    """Return `indices`, grouped by their `places`, in ascending order of these."""
    found = {places[index] for index in indices}
    if len(found) == 1:  # the most common case
        return [(found.pop(), indices)]
    return [(place, [index for index in indices if places[index] == place]) for place in sorted(found)]
