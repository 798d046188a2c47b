"""Message parts that ADOPT and BnB-ADOPT share; separate, because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robochoc.protocols import acts, message
from robochoc.protocols.disclosure import EveryValuePays, HasValue, Proof, Reception, SomeValuePays
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording, cost_text

Entry = tuple[message.Value, int]
"""A robot's value, and the number of its changes (the ID of BnB-ADOPT)."""


Context = dict[str, Entry]
"""The values of robots above, as far as these values are known."""


Number = int | float
"""Infinite if a hard constraint is broken, or if the cost is unknown; integers remain integers in messages."""


class Terminate(Message, frozen=True):
    """The end of the search above the receiver: all its ancestors have taken their values in `context` (TERMINATE)."""

    context: Context

    act = acts.TERMINATE

    def in_words(self, words: Wording) -> str:
        condition = words.context(self.context).removeprefix("as long as ").removesuffix(", ")
        return f"all above you have taken their last values{': ' if condition else ''}{condition}"

    def proves(self, _: Reception) -> Sequence[Proof]:
        return [HasValue(robot, value) for robot, (value, _) in self.context.items()]


def bounds_in_words(words: Wording, context: Context, lower: Number, upper: Number) -> str:
    """Return a robot's bounds in words: `as long as V1.1 = 2, my subtree costs at least 3`."""
    if math.isinf(lower):
        costs = "has no solution"
    elif lower == upper:
        costs = f"costs {cost_text(lower)}"
    elif math.isinf(upper):
        costs = f"costs at least {cost_text(lower)}"
    else:
        costs = f"costs between {cost_text(lower)} and {cost_text(upper)}"
    return f"{words.context(context)}my subtree {costs}"


def bounds_prove(context: Context, lower: Number, upper: Number, reception: Reception) -> Sequence[Proof]:
    """Return the proofs in bounds on the cost of the sender's subtree. Costs below the sender are at least 0.

    If all neighbours of the sender are in the context, no robot is below the sender, and the lower bound is on its own
    cost.
    """
    view = {robot: value for robot, (value, _) in context.items()}
    found: list[Proof] = [SomeValuePays(reception.sender, view, upper)]
    if view.keys() >= set(reception.neighbours(reception.sender)):
        found.append(EveryValuePays(reception.sender, view, lower))
    return found
