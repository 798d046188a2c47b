"""The message of GRAPE (see `grape.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof
from robochoc.model.wording import Wording, listed
from robochoc.protocols.auctions.messages.lots import Lot, does_proves, lot_in_words


class Partition(wire.Message, frozen=True):
    """A partition of the robots into coalitions, and how new it is (`Pi`, `r`, `s`).

    `evolution` counts the moves that have led to it, `stamp` is the random number of the last one, which `mover` has
    made. `coalitions` has each robot that does a task, with that robot's name for it.
    """

    evolution: int
    stamp: int
    mover: str
    coalitions: dict[str, Lot]

    act = Act(Performative.INFORM, "the receiver comes to know who does what as far as the sender knows")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        who = [f"{robot} does {lot_in_words(words, robot, lot)}" for robot, lot in self.coalitions.items()]
        return f"after move {self.evolution:,}, which was {self.mover}'s, {listed(who) or 'nobody does anything'}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what each robot can do that does something."""
        return [proof for robot, lot in self.coalitions.items() for proof in does_proves(robot, lot, hearing)]
