"""Asynchronous Forward Checking (AFC).

Complete search for satisfaction with one current partial assignment (CPA), which goes from robot to robot in priority
order. A robot that adds a value sends copies to all lower robots, which filter their domains at the same time. A robot
whose domain becomes empty sends `Not_OK` to the others; the holder of the CPA then sends it back to the last robot of
the inconsistent part.

- **When to use**: for comparison with AFC-ng, which needs fewer messages.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Only forward checking is
  asynchronous.
- **Parameters**: none.
- **Reference**: Meisels, Zivan: "Asynchronous forward-checking for DisCSPs", Constraints 12(1), 2007, with a static
  order.

The methods have the names of the paper's procedures:

    receive_CPA    `_receive_cpa`      forward_check      `_forward_check`
    assign_CPA     `_assign_cpa`       process_Not_OK     `_process_not_ok`
    backtrack      `_backtrack`        update_AgentView   `_update_agent_view`

Correctness under delays: there is one CPA, and its step counter (SC) grows with every added value; it travels back with
the CPA. So no robot knows a later step than the CPA that reaches it, each step has a new CPA, and a CPA that
contradicts a later one never returns. The content of a `NotOk` stays true, however late it arrives.

Choices that the paper leaves open:

- Constraints may be n-ary. The lowest-priority robot in the scope checks them, once the CPA contains all others.
- Messages are read in packets. The view is updated with each message; the domain is filtered, or the CPA handled, when
  the inbox has been drained.
- `NotOk` goes to all robots that have no value in the inconsistent assignment.
- If one known inconsistent assignment is a prefix of another, the shorter one is kept.
- Filtering is incremental: a prefix that a new CPA shares with the last one is not checked again.
- A robot with an empty domain reports it at once.
- The last robot concludes with a solution, because all others still have the values in the CPA.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(4), Options(protocol="afc", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value, outcome.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.afc_messages import CPA, Assignments, BacktrackCPA, FcCPA, NotOk
from robochoc.protocols.traits import ENDS_WITH_EITHER, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class AFC(Protocol):
    """One agent of AFC. State: the AgentView (`view`, `sc` and `consistent`), and the filtered `domain`.

    If `consistent` is false, no solution extends `view`.
    """

    messages: ClassVar[Any] = CPA | FcCPA | NotOk | BacktrackCPA
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_EITHER,
        paper="Meisels & Zivan 2007",
        privacy="constraints of lower robots",
        use_when="to compare with AFC-ng, which needs fewer messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.view: Assignments = ()
        self.sc = 0
        self.consistent = True
        self.domain = FilteredDomain(problem, order)
        self._held: CPA | BacktrackCPA | None = None

    def start(self) -> None:
        """Create the CPA, as the first robot; other robots wait."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.rank == 0:
            self._assign_cpa(0)

    def receive(self, sender: str, message: Message) -> None:  # noqa: ARG002 - who speaks does not matter
        if self.verdict is not None:
            return
        match cast("CPA | FcCPA | NotOk | BacktrackCPA", message):
            case CPA() | BacktrackCPA() as held:
                self._held = held
            case FcCPA(assignments, sc):
                self._update_agent_view(assignments, sc)
            case NotOk(assignments, sc):
                self._process_not_ok(assignments, sc)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Process the CPA if this robot holds it; otherwise check forward."""
        if self.verdict is not None:
            return
        held, self._held = self._held, None
        if held is not None:
            self._receive_cpa(held)
        elif self.consistent:
            self._forward_check()

    # The holder of the CPA

    def _receive_cpa(self, held: CPA | BacktrackCPA) -> None:
        """Add a value to the CPA, unless it is known to be inconsistent."""
        self.sc = max(self.sc, held.sc)
        above = held.assignments[: self.rank]
        if not self.consistent and is_prefix(self.view, above):
            self._backtrack(self.view)
            return
        self.view, self.consistent = above, True
        self.domain.filter(above)
        inconsistent = self.domain.inconsistent()
        if inconsistent is not None:
            self._backtrack(inconsistent)
        elif isinstance(held, CPA) or self.value is None:
            self._assign_cpa(0)
        else:
            self._assign_cpa(self.value + 1)

    def _assign_cpa(self, first: int) -> None:
        """Add the first remaining value from index `first` on, and send the CPA to all lower robots."""
        self.value = self.domain.first(first)
        if self.value is None:
            self._backtrack(self.view)
            return
        self.sc += 1
        assignments = (*self.view, self.problem.values[self.value])
        below = self.order.names[self.rank + 1 :]
        if not below:
            self.conclude(Verdict.SOLUTION)
            return
        self.send(below[0], CPA(assignments, self.sc))
        for robot in below[1:]:
            self.send(robot, FcCPA(assignments, self.sc))

    def _backtrack(self, inconsistent: Assignments) -> None:
        """Send the CPA back to the last robot of the `inconsistent` assignment."""
        self.view, self.consistent, self.value = inconsistent, False, None
        if inconsistent:
            self.send(self.order.names[len(inconsistent) - 1], BacktrackCPA(inconsistent, self.sc))
        else:
            self.conclude(Verdict.NO_SOLUTION)

    # The other robots

    def _update_agent_view(self, assignments: Assignments, sc: int) -> None:
        """Replace the view by the CPA of a later step; it is inconsistent if it extends the known inconsistency."""
        if sc <= self.sc:
            return
        self.sc = sc
        self.value = None  # a robot above has taken another value in the meantime
        if self.consistent or not is_prefix(self.view, assignments):
            self.view, self.consistent = assignments, True

    def _forward_check(self) -> None:
        """Filter the domain; if it is empty, send `NotOk` to all robots that may hold the CPA later."""
        self.domain.filter(self.view)
        inconsistent = self.domain.inconsistent()
        if inconsistent is None:
            return
        self.view, self.consistent = inconsistent, False
        for robot in self.order.names[len(inconsistent) :]:
            if robot != self.problem.agent:
                self.send(robot, NotOk(inconsistent, self.sc))

    def _process_not_ok(self, inconsistent: Assignments, sc: int) -> None:
        """Accept a `NotOk` about the view or about a CPA of the same or a later step; all others are obsolete."""
        if self.consistent or not is_prefix(self.view, inconsistent):
            if sc < self.sc and not is_prefix(inconsistent, self.view):
                return
            self.view, self.consistent = inconsistent, False
        self.sc = max(self.sc, sc)

    def tried(self, index: int) -> bool:
        """Return whether the value at `index` has been tried: values are tried in order."""
        return self.value is not None and index < self.value


class FilteredDomain:
    """This robot's domain, filtered by a partial assignment, without repeated checks.

    For each value that is ruled out, the length of the shortest prefix that rules it out is stored. When a new partial
    assignment has a common prefix with the last one, values that this prefix rules out are not checked again. For the
    others, only constraints with robots after the prefix are checked.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self._problem = problem
        self._order = order
        self._assignments: Assignments = ()
        self._ruled_out: list[int | None] = [None] * len(problem.values)

    def filter(self, assignments: Assignments) -> None:
        """Filter the values by `assignments`."""
        if assignments == self._assignments:
            return
        common = common_length(assignments, self._assignments)
        self._assignments = assignments
        view = dict(zip(self._order.names, assignments, strict=False))
        for index, depth in enumerate(self._ruled_out):
            if depth is None or depth > common:
                conflict = self._problem.conflict(index, view, common)
                self._ruled_out[index] = None if conflict is None else self._order.depth(conflict) + 1

    def first(self, place: int) -> int | None:
        """Return the first remaining value from index `place` on; None if there is none."""
        return next((index for index in range(place, len(self._ruled_out)) if self._ruled_out[index] is None), None)

    def inconsistent(self) -> Assignments | None:
        """Return the shortest prefix of the assignments that rules out every value; None if a value is left."""
        depths = [depth for depth in self._ruled_out if depth is not None]
        return None if len(depths) < len(self._ruled_out) else self._assignments[: max(depths, default=0)]


def is_prefix(beginning: Assignments, assignments: Assignments) -> bool:
    """Return whether `assignments` begins with `beginning`."""
    return assignments[: len(beginning)] == beginning


def common_length(left: Assignments, right: Assignments) -> int:
    """Return the length of the common prefix of two partial assignments."""
    pairs = enumerate(zip(left, right, strict=False))
    return next((place for place, (one, other) in pairs if one != other), min(len(left), len(right)))
