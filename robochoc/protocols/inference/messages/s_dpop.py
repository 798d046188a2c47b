"""The messages of S-DPOP (see `s_dpop`); others are DPOP's."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording, listed


class Check(Message, frozen=True):
    """The tree stands; `changed` are the robots above the receiver whose domains have changed.

    Those of them that share a constraint with the receiver send it their domains themselves.
    """

    changed: list[str]

    act = Act(Performative.REQUEST, "the receiver is to tell whether its table has changed")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        news = f"the values of {listed(self.changed)} have changed" if self.changed else "no values have changed"
        return f"our tree stands, and above you {news}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Reuse(Message, frozen=True):
    """The sender's table is the one that the receiver has."""

    act = Act(Performative.CONFIRM, "the receiver may go on with the sender's table that it has")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "my table is still the one that you have"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
