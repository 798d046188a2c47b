"""Messages of Asynchronous Weak-Commitment search; separate, because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import HasValue, Proof, Reception
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording, is_withdrawn
from robochoc.system.plain_text import listed


class Ok(Message, frozen=True):
    """The sender's value and current priority, sent to all neighbours (`ok?`)."""

    value: Value
    priority: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} from now on, with priority {self.priority}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasValue(reception.sender, self.value)]


class Nogood(Message, frozen=True):
    """Assignments, including the receiver's, that cannot all hold, with the last known priorities."""

    nogood: dict[str, tuple[Value, int]]

    act = acts.RULE_OUT
    backtracks = True
    # The nogood may follow from the constraints of any robot.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        values = {robot: value for robot, (value, _) in self.nogood.items() if not is_withdrawn(value)}
        facts = [fact for robot, value in values.items() for fact in words.facts(robot, value)]
        if len(facts) == 1:
            return f"{facts[0]} cannot stand, whatever the others do"
        return f"{listed(facts)} cannot {'both' if len(facts) == len('ab') else 'all'} stand"


class AddLink(Message, frozen=True):
    """A new link between sender and receiver because of a nogood: each sends its value to the other from now on."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return (
            f"from now on let us tell each other {words.variables(words.sender)} and {words.variables(words.receiver)}"
        )
