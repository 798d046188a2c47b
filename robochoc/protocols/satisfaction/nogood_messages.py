"""The nogood that ABT, AFC-ng, AFC-tree and Agile-ABT send; apart, as mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import INFINITE, NOTHING, Clash, EveryValuePays, Hearing, Proof
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording


class Nogood(Message, frozen=True):
    """A nogood: the receiver cannot take `value` while all assignments in `lhs` hold (`ngd`)."""

    lhs: dict[str, Value]
    value: Value

    act = acts.RULE_OUT
    backtracks = True

    def in_words(self, words: Wording) -> str:
        return words.nogood(self.lhs, self.value)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        broken = {**self.lhs, hearing.receiver: self.value}
        if not hearing.fixed_holders:
            return NOTHING
        if hearing.order.index(hearing.sender) < hearing.order.index(hearing.receiver):
            return [Clash(broken)]  # the sender's part of a partially known constraint
        # A nogood of any other robot may follow from constraints of robots below it, not from its own.
        return [EveryValuePays(hearing.sender, broken, INFINITE)] if hearing.is_lowest(hearing.sender) else NOTHING
