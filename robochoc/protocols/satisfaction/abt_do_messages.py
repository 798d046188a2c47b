"""Messages of ABT with dynamic ordering, separate from `abt_do.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording
from robochoc.system.plain_text import listed

Counters = tuple[tuple[int, str], ...]
"""For each position: how often the robots from there on were reordered, and who did it last; no trailing zeros."""


class Ok(Message, frozen=True):
    """The sender's value and its number of remaining values, sent to lower-priority neighbours (`ok?`)."""

    value: Value
    left: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} from now on; {_not_ruled_out(self.left)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # Once the order has changed, the sender need not send its next value.
        return [can_take(reception.sender, self.value)]


class Nogood(Message, frozen=True):
    """A nogood: the receiver cannot take `value` while all assignments in `lhs` hold.

    If the receiver changes its value, the sender has `left` values that no nogood rules out.
    """

    lhs: dict[str, Value]
    value: Value
    left: int

    act = acts.RULE_OUT
    backtracks = True
    # The nogood may follow from the constraints of any robot.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"{words.nogood(self.lhs, self.value)}; without that value, {_not_ruled_out(self.left)}"


class Order(Message, frozen=True):
    """A new order of all robots, highest priority first (`order`)."""

    names: tuple[str, ...]
    counters: Counters

    act = acts.TELL_ORDER
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"the order is now {listed(self.names)}"


class AddLink(Message, frozen=True):
    """A request to be sent the receiver's value from now on, while the receiver has higher priority."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"tell me {words.variables(words.receiver)} from now on, whenever you are above me"


def _not_ruled_out(left: int) -> str:
    return f"{left:,} of my values {'is' if left == 1 else 'are'} not ruled out"
