"""The message that AFC-tree adds to AFC-ng's: apart, as mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.disclosure import Hearing, Proof, can_take
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording
from robochoc.protocols import acts


class Accept(Message, frozen=True):
    """A message that the sender's whole subtree accepts the receiver's CPA (`accept`).

    `counters` are those of the CPA, from the root down to the receiver; `subtree` holds the values of the subtree.
    """

    counters: list[int]
    subtree: dict[str, Value]

    act = acts.ACCEPT

    def in_words(self, words: Wording) -> str:
        values = f", with {words.assigned(self.subtree.items())}" if self.subtree else ""
        return f"all below {words.receiver}, from me down, accept its partial assignment{values}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        return [can_take(robot, value) for robot, value in self.subtree.items()]
