"""The messages of Max-Sum (see `maxsum.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.wording import Wording, costs_text
from robochoc.protocols.inference.maxsum_factor import Row


class R(wire.Message, frozen=True):
    """Messages from functions to a variable, a row for each of the sender's functions with the receiver in it.

    A row holds the minimum cost of the function for each of the receiver's values.
    """

    rows: list[Row]

    act = Act(Performative.INFORM, "the receiver comes to know what each of its values costs")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        many = len(self.rows)
        by = "our function" if many == 1 else f"our {many:,} functions, one after the other"
        return f"by {by}, {words.receiver}'s values cost {_rows_in_words(self.rows)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver.

        Nothing by itself: costs are sums over many robots, and may be split, damped, or from zero.
        """
        return NOTHING


class Q(wire.Message, frozen=True):
    """Messages from a variable to functions, a row for each of the receiver's functions, in the order of R.

    A row holds the cost of each of the sender's values by all its other functions.
    """

    rows: list[Row]

    act = Act(Performative.INFORM, "the receiver comes to know what each value costs elsewhere")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        many = len(self.rows)
        by = "our function" if many == 1 else f"each of our {many:,} functions in turn"
        return f"without {by}, {words.sender}'s values cost {_rows_in_words(self.rows)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver.

        Nothing by itself: costs are sums over many robots, and may be split, damped, or from zero.
        """
        return NOTHING


def _rows_in_words(rows: Sequence[Row]) -> str:
    return "; ".join(map(costs_text, rows[:4]))
