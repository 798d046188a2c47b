"""The states of a whole team, the steps between them, and the result of their exploration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from robochoc.exploration.changes import Change

Channel = tuple[int, int]
"""The places of a receiver and a sender in the order of the robots."""

LOST = -1
"""The number of a lost message in a queue, which its receiver will notice at the next message of the channel."""


class TeamState(NamedTuple):
    """A state of the team.

    Attributes:
        robots: The number of each robot's state.
        queues: The numbers of the messages on each channel, the oldest first.
        losses: The number of messages that may still be lost.
        stage: The number of the stage.
        lossless: None while the robots search. Before they start in this stage: True if no message of the previous
            stage was lost.
    """

    robots: tuple[int, ...]
    queues: tuple[tuple[Channel, tuple[int, ...]], ...]
    losses: int = 0
    stage: int = 0
    lossless: bool | None = None


class Delivery(NamedTuple):
    """A step of the team: `receiver` receives the next messages of `senders` as a packet.

    `lost`: the message is lost instead. `change`: the problem changes instead; `lossless`: when the search was known to
    be quiescent. `starts`: the robots start on the changed problem instead. Otherwise, without a receiver, the robots
    continue without the messages that they lack.
    """

    receiver: str = ""
    senders: tuple[str, ...] = ()
    lost: bool = False
    change: Change | None = None
    starts: bool = False
    lossless: bool = False

    @property
    def in_words(self) -> str:
        """The step as a sentence."""
        if self.change is not None:
            end = "no message is in transit" if self.lossless else "messages in transit are dropped"
            return f"the search ends, {end}, and the problem changes: {self.change.in_words}"
        if self.starts:
            return "the robots start on the changed problem"
        if not self.receiver:
            return "the robots continue without the messages that they lack"
        messages = " and ".join(f"the next message of {sender}" for sender in self.senders)
        return f"{messages} to {self.receiver} is lost" if self.lost else f"{self.receiver} receives {messages}"

    def as_dict(self) -> dict[str, object]:
        """Return the step for JSON."""
        change = None if self.change is None else self.change.in_words
        return {**self._replace(change=None)._asdict(), "change": change}


class Explanation(NamedTuple):
    """A fault in words: a paragraph, and the deliveries that lead to it, with their messages."""

    text: str = ""
    steps: tuple[str, ...] = ()


NO_EXPLANATION = Explanation()


@dataclass
class Exploration:
    """The result of an exploration.

    Attributes:
        states: The number of the team's states.
        steps: The number of steps between them.
        ends: The number of states in which the search is over.
        local_states: The number of the robots' states, for all robots together.
        is_complete: True if nothing is left to explore.
        is_cyclic: True if there is an order of deliveries in which the robots continue forever although each message
            arrives. None: unknown.
        random_runs: The number of runs in random orders, played because something is left to explore.
        fault: The fault that ended it; empty if there is none.
        path: The deliveries from the start to the fault. If the robots may continue forever: to the first state that
            they reach again.
        cycle: The deliveries from this state back to it; empty for other faults.
        explanation: The fault in words.
    """

    states: int = 0
    steps: int = 0
    ends: int = 0
    local_states: int = 0
    is_complete: bool = False
    is_cyclic: bool | None = None
    random_runs: int = 0
    fault: str = ""
    path: Sequence[Delivery] = ()
    cycle: Sequence[Delivery] = ()
    explanation: Explanation = NO_EXPLANATION

    @property
    def run(self) -> Sequence[Delivery]:
        """The path and, once, the cycle."""
        return [*self.path, *self.cycle]


class Move(NamedTuple):
    """A step from a state: the delivery, the next state, and why a robot refuses the delivery (empty: none does)."""

    delivery: Delivery
    state: TeamState
    refusal: str = ""
