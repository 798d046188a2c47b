"""The messages of games in rounds, in which programs and people play robots (`robochoc play`).

In each round, all robots choose a value at the same time, and announce a value to their neighbours. They may also send
texts, and claim the private costs of their values. The robots are played by `robochoc/seats`; this class only defines
the messages, so that journals of games can be read, shown and measured like those of other runs.

- **When to use**: never by itself; it cannot be chosen for a run.
- **Guarantees**: none.
- **Parameters**: none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from robochoc.protocols import acts
from robochoc.protocols.disclosure import Pays, Proof, Reception, can_take
from robochoc.protocols.message import Message, Value
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.protocols.wording import Wording, cost_text


class Announced(Message, frozen=True):
    """The value that the sender announces for this round. It is one of its possible values, but may be a lie."""

    value: Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} in this round"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class Said(Message, frozen=True):
    """A text to a neighbour. It counts as proving nothing, since no rule can say what a text discloses."""

    text: str

    proves_nothing = True

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - a text needs no names
        return self.text


class Claimed(Message, frozen=True):
    """The claim that `value` has the private cost `cost`. `holds`: it is true; the receiver does not see this field."""

    value: Value
    cost: int
    holds: bool

    def in_words(self, words: Wording) -> str:
        return f"my private cost is {cost_text(self.cost)} if {words.own_value(self.value)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [Pays(reception.sender, self.value, {}, self.cost, self.cost)] if self.holds else []


class Rounds(Protocol):
    """A robot of a recorded game. It has its problem, and never acts."""

    messages: ClassVar[Any] = Announced | Said | Claimed
    traits: ClassVar[Traits] = Traits(
        concludes=(),
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        no_replay="the players of a game (robochoc play) are not in its journal",
    )

    def start(self) -> None:
        """Do nothing."""

    def receive(self, sender: str, message: Message) -> None:
        """Do nothing."""
