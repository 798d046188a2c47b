"""The messages of NCBB, besides those of all protocols that ask for bounds (see `ncbb.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof, can_take
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording
from robochoc.protocols import acts
from robochoc.protocols.optimization.messages.branching import Number, allowance


class Greedy(Message, frozen=True):
    """The value of the sender in the greedy assignment of the first phase (VALUE)."""

    value: Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} in the first assignment"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [can_take(hearing.sender, self.value)]


class Search(Message, frozen=True):
    """A request to search the receiver's subtree for less than `bound`, with the values that were told (SEARCH)."""

    bound: Number

    act = Act(Performative.REQUEST, "the receiver is to search its subtree")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"search your subtree {allowance(self.bound)}"
