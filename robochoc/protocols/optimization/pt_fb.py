"""Pseudo-tree Forward Bounding (PT-FB).

Complete search for minimum cost on a pseudo-tree, in linear memory, with bounds that are handed down. Before a robot
has the subtree of a child searched for one of its values, it asks all robots in that subtree with which it shares a
constraint for lower bounds. These bounds travel with the request (CPA) to the child and further down, so that the bound
on a subtree has a part for every robot in it that shares a constraint with a robot above. Different subtrees are
searched at the same time, also for different values. When a search finds a better solution, or the cost of its subtree
is known, the limits of the other searches are reduced (REDUCE_UB).

- **When to use**: costs, a pseudo-tree with branches, little memory; fewer messages than NCBB on dense graphs.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Each robot
  remembers a bound and an assignment for each child and value.
- **Parameters**: none.
- **Reference**: Litov, Meisels: "Forward bounding on pseudo-trees for DCOPs and ADCOPs", AIJ 252, 2017.

The messages have the names in the paper, or these:

    CPA                     `CPA`                  LB_REQUEST   `Request`
    CPA (back) and UBs      `Result`               LB_REPORT    `Report`
    REDUCE_UB               `Reduce`               PCB, ECA     `Members`
    assign CPA              `_advance`, `request_bound`     STOP         `Terminate`

The framework of the search is in `branching`, the bounds are in `forward_bounding`; NCBB uses both, too.

Choices that the paper leaves open, and differences:

- Constraints may be n-ary: the lowest robot in the scope pays them. There may be several trees.
- The CPA contains no values: the requests for bounds have already sent them to the robots concerned.
- Every robot reduces the bounds of its children; in the paper, only robots with more than one child do. A leaf answers
  its parent with its cost and value.
- A reduced bound always applies to the last CPA sent to that child, because no message overtakes another; so searches
  need no numbers. A child that has already answered ignores the reduced bound.
- Results contain the best assignment of the subtree, so nothing is searched again.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), PTFB, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, assert_never, cast

from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Proof, Reception, SomeValuePays
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.branching import Members, Number, Report, Request, Result, Terminate, allowance
from robochoc.protocols.optimization.forward_bounding import ForwardBoundingProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import listed


class CPA(Message, frozen=True):
    """A request to search the receiver's subtree for a cost below `bound`, with the values sent before (CPA).

    `reports`: for robots in the subtree, a lower bound on the robot's own cost, if it is more than 0.
    """

    bound: Number
    reports: dict[str, Number]

    act = acts.PROPOSE_CPA

    def in_words(self, _: Wording) -> str:
        asked = f"search your subtree {allowance(self.bound)}"
        if not self.reports:
            return asked
        least = cost_text(sum(self.reports.values()))
        return f"{asked}; at least {least} of it is paid by {listed(self.reports)}"

    def proves(self, _: Reception) -> Sequence[Proof]:
        # The receiver may not know the values on which the bounds depend.
        return [SomeValuePays(robot, {}, bound) for robot, bound in self.reports.items()]


class Reduce(Message, frozen=True):
    """A lower limit for the current search (REDUCE_UB)."""

    bound: Number

    act = Act(Performative.INFORM, "the receiver learns a lower bound for its search")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"search on, {allowance(self.bound)}" if self.bound else "search no further"


@mypyc_attr(allow_interpreted_subclasses=True)
class PTFB(ForwardBoundingProtocol):
    """One agent of PT-FB."""

    messages: ClassVar[Any] = TreeMessage | Members | Request | Report | CPA | Reduce | Result | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Litov & Meisels 2017",
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, pseudo-tree with branches, little memory",
    )

    def begin_search(self) -> None:
        """Start the search without a bound, as the root."""
        self.search(self.limit, self.above.alone)

    def handle(self, sender: str, message: Message) -> None:
        match cast("Members | Request | Report | CPA | Reduce | Result | Terminate", message):
            case Members(linked):
                self.store_members(sender, linked)
            case Request(value):
                self.answer_request(sender, value)
            case Report(bound):
                self.store_report(sender, bound)
            case CPA(bound, reports):
                self._search(bound, reports)
            case Reduce(bound):
                self._reduce(bound)
            case Result() as result:
                self.store_result(sender, result)
            case Terminate(values):
                self.finish(values)
            case never:
                assert_never(never)

    def _search(self, bound: Number, reports: Mapping[str, Number]) -> None:
        """Search the subtree, using the bounds that were handed down."""
        if self.parent not in self.above.totals or self.searching:
            raise ValueError(f"{self.problem.agent} does not know the value of its parent, or is already searching")
        self.handed = dict(reports)
        self.search_subtree(bound)

    def search_subtree(self, bound: Number) -> None:
        """Search the subtree, with the values of the robots above."""
        assert self.parent is not None  # noqa: S101 - for mypy: the root begins by itself
        self.search(bound, self.above.totals[self.parent])

    def _reduce(self, bound: Number) -> None:
        """Adopt a lower limit, unless the search that it applies to has ended."""
        if self.searching:
            self.limit = min(self.limit, bound)
            self.send_lower_limits()

    def explore(self, child: str, limit: Number) -> None:
        """Send the CPA to `child`, with the bounds on the robots below it."""
        known = self.reports
        self.send(child, CPA(limit, {n: known[n] for n in self.members[child] if n != child and known.get(n)}))

    def tighten(self, child: str, limit: Number) -> None:
        """Send `child` a lower limit for its search."""
        self.send(child, Reduce(limit))
