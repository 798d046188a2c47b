"""Pseudo-tree Forward Bounding (PT-FB).

Complete search for minimum cost on a pseudo-tree, in linear memory, with bounds that are handed down. Before a robot
lets the subtree of a child be searched for one of its values, it asks all robots there that it shares a constraint with
for lower bounds. They go with the request (CPA) to the child, and on, so that the bound of a subtree has a part of
every robot in it that shares a constraint with anyone above. Different subtrees are searched at the same time, also
for different values. When one of them finds a better solution, or its cost comes to be known, the others have to be
cheaper (REDUCE_UB).

- **When to use**: costs, a pseudo-tree with branches, little memory; fewer messages than NCBB on dense graphs.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Each robot
  remembers a bound and an assignment for each child and own value.
- **Parameters**: none.
- **Reference**: Litov, Meisels: "Forward bounding on pseudo-trees for DCOPs and ADCOPs", AIJ 252, 2017.

The messages have the names of the paper, or these:

    CPA                     `CPA`                  LB_REQUEST   `Request`
    CPA (back) and UBs      `Result`               LB_REPORT    `Report`
    REDUCE_UB               `Reduce`               PCB, ECA     `Members`
    assign CPA              `_advance`, `look`     STOP         `Terminate`

The frame of the search is in `branching`, bounds are in `forward_bounding`: NCBB has both, too.

Choices that the paper leaves open, and differences:

- Constraints may be n-ary: the lowest robot of the scope pays them. There may be several trees.
- The CPA holds no values: whom they concern has been asked with them.
- Every robot reduces the bounds of its children; in the paper, those with more than one child. A leaf answers its
  parent with its cost and value.
- A bound that is reduced is one for the last CPA to that child, as no message overtakes another; so searches need no
  numbers. A child that has answered ignores it.
- Results hold the best assignment of the subtree, so nothing is searched again.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), PTFB, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never, cast

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof, SomeValuePays
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text, listed
from robochoc.protocols import acts
from robochoc.protocols.optimization.branching import Members, Number, Report, Request, Result, Terminate, allowance
from robochoc.protocols.optimization.forward_bounding import ForwardBoundingProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits


class CPA(Message, frozen=True):
    """A request to search the receiver's subtree for less than `bound`, with the values that were told (CPA).

    `reports`: for robots of the subtree, what each of them costs alone at least, where that is more than 0.
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

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver, which may not know the values that the bounds go with."""
        return [SomeValuePays(robot, {}, bound) for robot, bound in self.reports.items()]


class Reduce(Message, frozen=True):
    """A lower bound for the search that is going on (REDUCE_UB)."""

    bound: Number

    act = Act(Performative.INFORM, "the receiver comes to know a lower bound for its search")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"search on, {allowance(self.bound)}" if self.bound else "search no further"


class PTFB(ForwardBoundingProtocol):
    """One agent of PT-FB."""

    messages = TreeMessage | Members | Request | Report | CPA | Reduce | Result | Terminate
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Litov & Meisels 2017",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, pseudo-tree with branches, little memory",
    )

    def begin_search(self) -> None:
        """Begin the search without a bound, as the root."""
        self.search(self.limit, self.above.alone)

    def handle(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type."""
        match cast("Members | Request | Report | CPA | Reduce | Result | Terminate", message):
            case Members(linked):
                self.take_members(sender, linked)
            case Request(value):
                self.take_request(sender, value)
            case Report(bound):
                self.take_report(sender, bound)
            case CPA(bound, reports):
                self._search(bound, reports)
            case Reduce(bound):
                self._reduce(bound)
            case Result() as result:
                self.take_result(sender, result)
            case Terminate(values):
                self.finish(values)
            case never:
                assert_never(never)

    def _search(self, bound: Number, reports: Mapping[str, Number]) -> None:
        """Search the own subtree with the bounds that were handed down."""
        if self.parent not in self.above.totals or self.searching:
            raise ValueError(f"{self.problem.agent} does not know the value of its parent, or is searching")
        self.handed = dict(reports)
        self.search_subtree(bound)

    def search_subtree(self, bound: Number) -> None:
        """Search the own subtree, with the values of the robots above."""
        assert self.parent is not None  # noqa: S101 - for mypy: the root begins by itself
        self.search(bound, self.above.totals[self.parent])

    def _reduce(self, bound: Number) -> None:
        """Take over a lower bound, unless the search that it is for has ended."""
        if self.searching:
            self.limit = min(self.limit, bound)
            self.tell_lower_limits()

    def explore(self, child: str, limit: Number) -> None:
        """Send the CPA to `child`, with the bounds of the robots below it."""
        known = self.reports
        self.send(child, CPA(limit, {n: known[n] for n in self.members[child] if n != child and known.get(n)}))

    def tighten(self, child: str, limit: Number) -> None:
        """Tell `child` that its search has a lower bound now."""
        self.send(child, Reduce(limit))
