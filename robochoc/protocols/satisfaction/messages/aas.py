"""The messages of Asynchronous Aggregation Search (see `aas.py`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import INFINITE, NOTHING, EveryValuePays, Hearing, Proof, StandsAt
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, listed
from robochoc.protocols import acts

MOST_PROVEN = 256
"""Of more combinations than these a nogood's proof is left out."""


class Ok(Message, frozen=True):
    """The sender's aggregate: any of these values, which all go with what it has heard from above (`ok?`)."""

    values: tuple[Value, ...]

    act = acts.TELL_VALUE
    shareable = True

    def in_words(self, words: Wording) -> str:
        return f"{_one_of(words, words.sender, self.values)} from now on"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender stands at the first value of its aggregate."""
        return [StandsAt(hearing.sender, self.values[0])] if self.values else NOTHING


class Nogood(Message, frozen=True):
    """No solution has a value of `values` while all in `lhs` have one of theirs: a nogood over sets (`nogood`)."""

    lhs: dict[str, tuple[Value, ...]]
    values: tuple[Value, ...]

    act = acts.RULE_OUT
    backtracks = True

    def in_words(self, words: Wording) -> str:
        while_they = listed([_one_of(words, robot, values) for robot, values in self.lhs.items()])
        condition = f"as long as {while_they}, " if while_they else ""
        rest = "" if while_they else ", whatever the others do"
        return f"{condition}it cannot be that {_one_of(words, words.receiver, self.values)}{rest}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        # A nogood of any but the lowest robot may follow from constraints of those below it.
        if not hearing.fixed_holders or not hearing.is_lowest(hearing.sender):
            return NOTHING
        broken: Mapping[str, tuple[Value, ...]] = {**self.lhs, hearing.receiver: self.values}
        if math.prod(map(len, broken.values())) > MOST_PROVEN:
            return NOTHING
        chosen = product(*broken.values())
        return [EveryValuePays(hearing.sender, dict(zip(broken, one, strict=True)), INFINITE) for one in chosen]


class Narrow(Message, frozen=True):
    """A request to keep no more than these values in the receiver's aggregate: the others do not go with the sender."""

    values: tuple[Value, ...]

    act = Act(
        Performative.REQUEST, "with all of the receiver's aggregate no value of the sender goes, with a part some"
    )
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"please keep to this: {_one_of(words, words.receiver, self.values)}"


class AddLink(Message, frozen=True):
    """A request of a lower-priority robot to be sent the receiver's aggregates from now on (`add-link`)."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"tell me {words.variables(words.receiver)} from now on"


def _one_of(words: Wording, robot: str, values: Sequence[Value]) -> str:
    """Return an aggregate: `V1.1 is 1, 2 or 3`, `(A, B) is (1, 2) or (1, 3)`, without variables that do not matter."""
    parts = [words.parts(robot, value) for value in values]
    names = [name for name, _ in parts[0]] if parts else []
    if len(names) == 1:
        return f"{names[0]} is {listed([part for value in parts for _, part in value], 'or')}"
    shown = listed([f"({', '.join(part for _, part in value)})" for value in parts], "or")
    return f"({', '.join(names)}) is {shown}" if names else f"{robot} has any value"
