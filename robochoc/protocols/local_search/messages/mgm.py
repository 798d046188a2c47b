"""The message of MGM that is not common to all local search (see `mgm.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.wording import Wording, cost_text, counted, listed


def saving_in_words(broken: int, cost: float) -> str:
    """Return the gain of a move in words: `1 broken constraint and 3 of cost`, or `nothing`."""
    saved = [counted(broken, "broken constraint")] if broken else []
    return listed([*saved, f"{cost_text(cost)} of cost"] if cost else saved) or "nothing"


class Gain(wire.Message, frozen=True):
    """The gain of the sender's best move: broken hard constraints, and costs (`gain`)."""

    broken: int
    cost: int | float

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's move would save")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"my move would save {saving_in_words(self.broken, self.cost)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing by itself.

        A gain may be one of two that move together (MGM-2), weighed (GDBA), or have costs in it that were handed over
        (MCS-MGM). So it does not bound what the sender pays.
        """
        return NOTHING
