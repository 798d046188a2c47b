"""Messages of Agile-ABT, separate from `agile_abt.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.message import Message, Value
from robochoc.protocols.satisfaction.agile_order import (
    TerminationVector,
)
from robochoc.protocols.wording import Wording
from robochoc.system.plain_text import counted, listed


class Ok(Message, frozen=True):
    """The sender's value and explanation: while `lhs` holds, it has `left` of its `size` values left (`ok?`)."""

    value: Value
    lhs: dict[str, Value]
    left: int
    size: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        left = f"I have {self.left} of {counted(self.size, 'value')} left"
        return f"{words.own_value(self.value)} from now on; {words.condition(self.lhs)}{left}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # Once the order has changed, the sender need not send its next value.
        return [can_take(reception.sender, self.value)]


class Order(Message, frozen=True):
    """A new order (`order`): the robots by their positions in the first order, and the termination vector."""

    places: tuple[int, ...]
    termination: TerminationVector

    act = acts.TELL_ORDER
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        if self.places and not 0 <= min(self.places) <= max(self.places) < len(words.order):
            numbers = listed([str(place + 1) for place in self.places])
            return f"the order is now, by the places of the first one, {numbers}"
        return f"the order is now {listed([words.order[place] for place in self.places])}"


class AddLink(Message, frozen=True):
    """A request to be sent the receiver's value from now on, while the receiver has higher priority (`adl`)."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"tell me {words.variables(words.receiver)} from now on, whenever I am below you"
