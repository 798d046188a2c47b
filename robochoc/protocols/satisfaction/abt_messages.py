"""Messages of Asynchronous Backtracking, separate from `abt.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import HasValue, Proof, Reception
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording


class Ok(Message, frozen=True):
    """The sender's value, sent to lower-priority neighbours and to robots that share a PKC with it (`ok?`)."""

    value: Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} from now on"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasValue(reception.sender, self.value)]


class AddLink(Message, frozen=True):
    """A lower-priority robot's request to be sent the receiver's value from now on (`adl`)."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"tell me {words.variables(words.receiver)} from now on"
