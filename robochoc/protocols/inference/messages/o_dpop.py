"""The messages of O-DPOP (see `o_dpop`); others are DPOP's."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof, table_proves
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text, listed
from robochoc.protocols.inference.messages.dpop import Cost, axes_of


class Ask(Message, frozen=True):
    """A request for the receiver's next good."""

    act = Act(Performative.QUERY_REF, "the receiver is to send its next good")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "what is the next best for your subtree?"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Good(Message, frozen=True):
    """A combination of values of the sender's separator, as places in the order of its axes, and its least cost.

    No combination that the sender has not sent costs less.
    """

    assignment: list[int]
    cost: Cost

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's subtree costs at least from here on")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        places = listed([str(place + 1) for place in self.assignment])
        where = f", with the values {places} (by number) in my separator" if places else ""
        return f"the next best for my subtree costs {cost_text(self.cost)}{where}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: as much as the same cell of a table of DPOP."""
        axes = axes_of(hearing, hearing.receiver, hearing.sender)
        return NOTHING if axes is None else table_proves(axes, [(self.assignment, self.cost)], hearing)


class Done(Message, frozen=True):
    """The sender has no more goods: all other combinations break something hard."""

    act = Act(Performative.INFORM, "the receiver comes to know that no other combination is possible")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "nothing else is possible in my subtree"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
