"""Messages of DisFC, separate from `disfc.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import HasCompatibleValue, Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording
from robochoc.system.plain_text import counted, listed


class Ok(Message, frozen=True):
    """A new assignment of the sender, named `counter`; `allowed` is the receiver's domain, filtered by it (`ok?`)."""

    counter: int
    allowed: bytes

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        left = counted(sum(byte.bit_count() for byte in self.allowed), "value")
        return (
            f"my assignment number {self.counter} stands from now on; it leaves {words.receiver} {left} of its domain"
        )

    def proves(self, reception: Reception) -> Sequence[Proof]:
        upwards = reception.order.index(reception.sender) > reception.order.index(reception.receiver)
        return [HasCompatibleValue(reception.sender, reception.receiver, self.allowed, parts_only=upwards)]


class Nogood(Message, frozen=True):
    """A nogood over counters: the receiver's assignment `counter` is ruled out while all in `lhs` hold (`ngd`)."""

    lhs: dict[str, int]
    counter: int

    act = acts.RULE_OUT
    backtracks = True
    # Only the senders of these counters know the values that the counters stand for.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        named = [f"{robot} keeps its assignment number {counter}" for robot, counter in self.lhs.items()]
        condition = f"as long as {listed(named)}, " if named else ""
        rest = "" if named else ", whatever the others do"
        return f"{condition}{words.receiver} cannot keep its assignment number {self.counter}{rest}"


class AddLink(Message, frozen=True):
    """A lower-priority robot's request to be sent the receiver's assignments from now on (`adl`)."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "tell me of each new assignment of yours from now on"
