"""The nogood that ABT, AFC-ng, AFC-tree and Agile-ABT send; separate, as mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import INFINITE, NOTHING, Clash, EveryValuePays, Proof, Reception
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

    def proves(self, reception: Reception) -> Sequence[Proof]:
        broken = {**self.lhs, reception.receiver: self.value}
        if not reception.fixed_holders:
            return NOTHING
        if reception.order.index(reception.sender) < reception.order.index(reception.receiver):
            return [Clash(broken)]  # the sender's part of a partially known constraint
        # A nogood of any other robot may follow from constraints of robots below it, not from its own.
        return (
            [EveryValuePays(reception.sender, broken, INFINITE)] if reception.is_lowest(reception.sender) else NOTHING
        )
