"""The messages of P2-DPOP (see `p2_dpop`), besides those of the tree and of the circle."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, counted
from robochoc.protocols.private.messages.p_dpop import Shape, cells_of


class CostSum(Message, frozen=True):
    """Sums over the robots before the receiver in the circle, from a random start: `least` and `range` of costs."""

    least: int
    range: int

    act = Act(Performative.REQUEST, "the receiver is to add how far its costs may go")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "add to these two sums, which began with random numbers, how far your costs may go"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class CostRange(Message, frozen=True):
    """The costs of all robots together are at least `least`, and at most `range` more if no hard constraint breaks."""

    least: int
    range: int

    act = Act(Performative.INFORM, "the receiver comes to know what all costs may add up to")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"our costs add up to at least {cost_text(self.least)}, and to at most {cost_text(self.range)} more"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing about one robot, if there are three or more."""
        return NOTHING


class Plan(Message, frozen=True):
    """The axes of the table that the sender will send in this turn: codenames, and how many values each has."""

    turn: int
    axes: Shape

    act = Act(Performative.REQUEST, "the receiver is to plan its own table")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        axes, cells = counted(len(self.axes), "codename"), counted(cells_of(self.axes), "cell")
        return f"in turn {self.turn + 1} there will be a table over {axes} here, with {cells}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class AskAxis(Message, frozen=True):
    """Asks a neighbour for its axis in this turn, if it has not planned its own table yet."""

    turn: int

    act = Act(Performative.QUERY_REF, "the receiver is asked for the axis of its values")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"what are you called in turn {self.turn + 1}, if you are still to come?"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Axis(Message, frozen=True):
    """The sender is still to come in this turn. `values` are all that it was declared to have, in a random order."""

    turn: int
    codename: str
    values: list[Value]

    act = Act(Performative.INFORM, "the receiver comes to know the axis that it asked for")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"in turn {self.turn + 1} call me {self.codename[:4]}; as declared, {words.domain(self.values)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing, as the files declare these values."""
        return NOTHING


class Gone(Message, frozen=True):
    """The sender stands before the receiver in this turn: constraints between the two are in the table already."""

    turn: int

    act = Act(Performative.REFUSE, "the sender comes before the receiver")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"in turn {self.turn + 1} I come before you"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class EncryptedTable(Message, frozen=True):
    """The table that was planned: for each cell a cipher for each cost, of whether so much is enough.

    The last axis changes fastest, in the order of the plan, and costs within cells.
    """

    turn: int
    ciphers: bytes

    act = Act(Performative.REQUEST, "the receiver is to add its costs, without reading the table")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"the table of turn {self.turn + 1}, encrypted: {len(self.ciphers):,} bytes"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Opening(Message, frozen=True):
    """One cipher that the root wants to read, blinded by all robots before the receiver, and without their shares."""

    cipher: bytes

    act = Act(Performative.REQUEST, "the receiver is to blind it, and to take its share of the key off")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"blind this cipher ({self.cipher[:2].hex()}), and take your share of the key off"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


LinearMessage = CostSum | CostRange | Plan | AskAxis | Axis | Gone | EncryptedTable | Opening
"""The messages of the linear orders, one for each turn."""
