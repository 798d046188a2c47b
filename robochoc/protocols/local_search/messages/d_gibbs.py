"""The messages of D-Gibbs (see `d_gibbs.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof, can_take
from robochoc.model.wording import Wording, cost_text, counted, listed
from robochoc.protocols import acts


def _record(kept: bool) -> str:  # noqa: FBT001 - a field of two messages
    return "the last sample was the best so far" if kept else "the last sample was not better than the best"


class Value(wire.Message, frozen=True):
    """The sender's value in a sample; `kept`: the sample before is the best so far (VALUE)."""

    value: wire.Value
    kept: bool

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} in this sample; {_record(self.kept)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [can_take(hearing.sender, self.value)]


class Difference(wire.Message, frozen=True):
    """The change of the subtree's cost since the last sample: broken hard constraints, and costs (BACKTRACK).

    Less is negative.
    """

    broken: int
    cost: int

    act = Act(Performative.INFORM, "the receiver comes to know what the sample changes in the sender's subtree")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        changes = [_change(self.broken, counted(abs(self.broken), "broken constraint"))] if self.broken else []
        changes += [_change(self.cost, f"{cost_text(abs(self.cost))} of cost")] if self.cost else []
        return f"by this sample my subtree has {listed(changes) or 'no other cost'}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing by itself, as it is a difference of sums."""
        return NOTHING


def _change(number: int, text: str) -> str:
    return f"{text} {'more' if number > 0 else 'less'}"


class Finish(wire.Message, frozen=True):
    """The end: all take their values of the best sample. `kept`: that is the last one."""

    kept: bool

    act = acts.TERMINATE

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"the search is over: take your value of the best sample; {_record(self.kept)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
