"""The messages of PT-FB, besides those of all protocols that ask for bounds (see `pt_fb.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof, SomeValuePays
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text, listed
from robochoc.protocols import acts
from robochoc.protocols.optimization.messages.branching import Number, allowance


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
