"""The nogood that Asynchronous Backtracking, AFC-ng, AFC-tree and Agile-ABT send alike; DynABT adds to it."""

from __future__ import annotations

from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording
from robochoc.protocols import acts


class Nogood(Message, frozen=True):
    """A nogood: the receiver cannot take `value` while all assignments in `lhs` hold (`ngd`)."""

    lhs: dict[str, Value]
    value: Value

    act = acts.RULE_OUT
    backtracks = True

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.nogood(self.lhs, self.value)
