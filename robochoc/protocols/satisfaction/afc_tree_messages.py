"""The message that AFC-tree adds to AFC-ng; separate, because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording


class Accept(Message, frozen=True):
    """The sender's whole subtree accepts the receiver's CPA (`accept`).

    `counters` are those in the CPA, from the root down to the receiver; `subtree` contains the values in the subtree.
    """

    counters: list[int]
    subtree: dict[str, Value]

    act = acts.ACCEPT

    def in_words(self, words: Wording) -> str:
        values = f", with {words.assigned(self.subtree.items())}" if self.subtree else ""
        return f"all below {words.receiver}, from me down, accept its partial assignment{values}"

    def proves(self, _: Reception) -> Sequence[Proof]:
        return [can_take(robot, value) for robot, value in self.subtree.items()]
