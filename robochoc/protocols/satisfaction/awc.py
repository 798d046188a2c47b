"""Asynchronous Weak-Commitment search (AWC).

Complete search for satisfaction with priorities that change. A robot obeys robots of higher priority, and takes the
value that has the fewest conflicts with all other robots. At a dead end it sends the nogood to all robots in it and
raises its priority above that of all its neighbours. So a bad choice above is undone without an exhaustive search
below. Priorities change only with a new nogood.

- **When to use**: for comparison. ABT with the max-degree order is faster here.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. **All nogoods are kept,
  which termination requires; space is exponential.**
- **Parameters**: none.
- **References**: Yokoo: "Asynchronous weak-commitment search for solving distributed constraint satisfaction
  problems", CP 1995; Yokoo, Durfee, Ishida, Kuwabara: "The distributed constraint satisfaction problem: formalization
  and algorithms", IEEE TKDE 10(5), 1998, Section 5.

The methods have the names of its procedures:

    check_agent_view   `_check_agent_view`     received (ok?, ...)      `_received_ok`
    backtrack          `_backtrack`            received (nogood, ...)   `_received_nogood`

Termination and correctness: there are finitely many nogoods, and each robot sends each nogood only once. So priorities
stop changing at some point, and then values settle from the highest priority downwards. Suppose a robot is at a dead
end at quiescence. It has sent its nogood before, so all robots in the nogood know it and each other's values. The
lowest of them is then at a dead end itself, at a higher priority. The highest such robot would have derived the empty
nogood.

Choices that the papers leave open:

- Constraints and nogoods may contain many robots. The robot that currently has the lowest priority among them checks
  them, so all robots in a scope must know the constraint and each other's values.
- A nogood is new if this robot has never sent it.
- Conflicts to minimise are violated constraints (each evaluation counts as a check) and nogoods that hold (not counted
  as checks). Ties go to the first value of the domain.
- For each value, the shortest nogood that holds is included in the new nogood, or else the first violated constraint.
- A nogood contains only the relevant variables of a robot.
- Messages are read in packets. The runtime detects quiescence, and so a solution.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(3), Options(protocol="awc", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar, NamedTuple, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.awc_messages import AddLink, Nogood, Ok
from robochoc.protocols.satisfaction.nogood import LeftSide, joined
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


class StoredNogood(NamedTuple):
    """A nogood as one of its robots stores it: the others' values, and its own value that is ruled out."""

    others: LeftSide
    own: Value


def agrees(value: Value, known: Value | None) -> bool:
    """Return whether `known` equals `value` in all components where `value` is not None."""
    return known is not None and all(part is None or part == other for part, other in zip(value, known, strict=True))


@mypyc_attr(allow_interpreted_subclasses=True)
class NogoodList:
    """All received nogoods. Each nogood is indexed by one of its assignments that does not hold (the "watched" one).

    A nogood is examined again only when its watched assignment holds.
    """

    def __init__(self) -> None:
        self._known: set[frozenset[tuple[str, Value]]] = set()
        self._waiting: dict[str, dict[Value, list[StoredNogood]]] = {}
        self._awake: list[StoredNogood] = []

    def __iter__(self) -> Iterator[Mapping[str, Value]]:
        return map(dict, self._known)

    def add(self, agent: str, nogood: dict[str, Value]) -> None:
        """Store `nogood`, which contains `agent`, the owner of this list."""
        key = frozenset(nogood.items())
        if key not in self._known:
            self._known.add(key)
            own = nogood.pop(agent)
            self._awake.append(StoredNogood(nogood, own))

    def update(self, agent: str, value: Value) -> None:
        """Re-examine the nogoods that watch the new value of `agent`."""
        waiting = self._waiting.get(agent, {})
        for part in [part for part in waiting if agrees(part, value)]:
            self._awake += waiting.pop(part)

    def applicable(self, view: LeftSide) -> list[StoredNogood]:
        """Return the nogoods that apply in `view`: their other assignments all hold."""
        awake = []
        for one in self._awake:
            missing = next((agent for agent, value in one.others.items() if not agrees(value, view.get(agent))), None)
            if missing is None:
                awake.append(one)
            else:
                self._waiting.setdefault(missing, {}).setdefault(one.others[missing], []).append(one)
        self._awake = awake
        return awake


@mypyc_attr(allow_interpreted_subclasses=True)
class AWC(Protocol):
    """One agent of AWC. State: `view` (agent_view) and `priorities` of others, `nogoods`, its own `priority`."""

    messages: ClassVar[Any] = Ok | Nogood | AddLink
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Yokoo 1995; Yokoo et al. 1998",
        shared_scopes=True,
        privacy="none",
        use_when="to compare: ABT with max-degree order is faster here",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.view: dict[str, Value] = {}
        self.priorities: dict[str, int] = {}
        self.priority = 0
        self.neighbours = list(problem.neighbours)
        self.nogoods = NogoodList()
        self.sent: set[frozenset[tuple[str, Value]]] = set()
        self._alike: dict[Value, list[int]] = {}
        self._higher: dict[str, Value] = {}
        self._applicable: list[list[LeftSide]] = []
        self._conflicts: dict[int, LeftSide | None] = {}

    def start(self) -> None:
        """Choose a first value and send it."""
        self._check_agent_view()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Ok | Nogood | AddLink", message):
            case Ok(value, priority):
                self._received_ok(sender, value, priority)
            case Nogood(nogood):
                self._received_nogood(nogood)
            case AddLink():
                self._add_neighbour(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        if self.verdict is None:
            self._check_agent_view()

    # Messages

    def _received_ok(self, agent: str, value: Value, priority: int) -> None:
        self.view[agent] = value
        self.priorities[agent] = priority
        self.nogoods.update(agent, value)

    def _received_nogood(self, nogood: dict[str, tuple[Value, int]]) -> None:
        """Store a nogood; request links to its robots that are not neighbours, and assume its values for now."""
        for agent, (value, priority) in nogood.items():
            if agent != self.problem.agent and agent not in self.neighbours:
                self.send(agent, AddLink())
                self._add_neighbour(agent)
                self._received_ok(agent, value, priority)
        self.nogoods.add(self.problem.agent, {agent: value for agent, (value, _) in nogood.items()})

    def _add_neighbour(self, agent: str) -> None:
        if agent not in self.neighbours:
            self.neighbours.append(agent)
        self.send(agent, self._ok())

    # The search

    def _check_agent_view(self) -> None:
        """Keep the value if all higher robots allow it; otherwise choose another allowed value, or backtrack."""
        self._recompute()
        if self.value is not None and self._reason(self.value) is None:
            return
        allowed = self._allowed()
        if allowed:
            self._choose_value(allowed)
        else:
            self._backtrack()

    def _backtrack(self) -> None:
        """Send a new nogood to the robots that rule out every value; then raise the priority above all neighbours."""
        nogood: dict[str, Value] = {}
        for index in range(len(self.problem.values)):
            for agent, value in (self._reason(index) or {}).items():
                nogood[agent] = joined(nogood.get(agent), value)
        if not nogood:
            self.conclude(Verdict.NO_SOLUTION)
            return
        key = frozenset(nogood.items())
        if key in self.sent:
            return
        self.sent.add(key)
        message = Nogood({agent: (value, self.priorities[agent]) for agent, value in nogood.items()})
        for agent in nogood:
            self.send(agent, message)
        self.priority = 1 + max(self.priorities.values())
        self._recompute()
        self._choose_value(self._allowed())

    def _choose_value(self, allowed: list[int]) -> None:
        """Choose the value with the fewest conflicts (the first in case of ties) and send it to all neighbours."""
        self.value = allowed[0] if len(allowed) == 1 else min(allowed, key=self._violations)
        for agent in self.neighbours:
            self.send(agent, self._ok())

    def _violations(self, index: int) -> int:
        """Return the number of constraints and nogoods that the value at `index` violates, at any priority."""
        return self.problem.violation_count(index, self.view) + len(self._applicable[index])

    def _allowed(self) -> list[int]:
        return [index for index in range(len(self.problem.values)) if self._reason(index) is None]

    def _reason(self, index: int) -> LeftSide | None:
        """Return the higher robots' values that rule out `index`: the shortest nogood, or a violated constraint."""
        against = [others for others in self._applicable[index] if others.keys() <= self._higher.keys()]
        if against:
            return min(against, key=len)
        if index not in self._conflicts:
            self._conflicts[index] = self.problem.conflict(index, self._higher)
        return self._conflicts[index]

    # For replays

    @property
    def checked_against(self) -> Mapping[str, Value]:
        """The values of robots with higher priority."""
        return self._higher

    @property
    def kept_nogoods(self) -> Iterable[Mapping[str, Value]]:
        """All received nogoods."""
        return self.nogoods

    # The view

    def _recompute(self) -> None:
        """Recompute the higher robots and the nogoods that hold; drop conflict counts that may have changed."""
        higher = {agent: value for agent, value in self.view.items() if self._is_higher(agent)}
        if higher != self._higher:
            self._conflicts = {
                index: conflict
                for index, conflict in self._conflicts.items()
                if conflict is not None and all(higher.get(agent) == self._higher[agent] for agent in conflict)
            }
            self._higher = higher
        self._applicable = [[] for _ in self.problem.values]
        for others, own in self.nogoods.applicable(self.view):
            if own not in self._alike:
                self._alike[own] = list(self.problem.interchangeable(own))
            for index in self._alike[own]:
                self._applicable[index].append(others)

    def _is_higher(self, agent: str) -> bool:
        """Return whether `agent` has higher priority than this robot; ties are broken by the static order."""
        other = (-self.priorities[agent], self.order.rank[agent])
        return other < (-self.priority, self.order.rank[self.problem.agent])

    def _ok(self) -> Ok:
        assert self.value is not None  # noqa: S101 - chosen at the start, and only ever exchanged for another
        return Ok(self.problem.values[self.value], self.priority)
