"""Protocols without a problem, whose robots send messages by a script: the detection of the end needs no more."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import ClassVar

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.solver.local_problem import LocalProblem
from tests.support.problems import team_of

TEAMS = {size: team_of(dict.fromkeys("ABC"[:size], (0, 1)), [], f"{size} robots") for size in (2, 3)}
"""Teams without constraints: RA, RB and RC."""


Script = Mapping[str, tuple[str, ...]]
"""The receivers of the messages of each turn, by robot: "RB RB" or "". `!`: the robot concludes the search."""


class Ping(Message, frozen=True):
    """A message without content."""


class Scripted(Protocol):
    """At its start, and at each message, the robot sends the next messages of its script, and changes its value."""

    messages = Ping
    traits = Traits(writes_to_non_neighbours=True, concludes=(Verdict.NO_SOLUTION,))
    script: ClassVar[Script] = {}

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self._left = list(self.script.get(problem.agent, ()))
        self.value = 0

    def start(self) -> None:
        self._next()

    def receive(self, sender: str, message: Message) -> None:
        del sender, message
        self.value = 1 - (self.value or 0)
        self._next()

    def _next(self) -> None:
        for receiver in self._left.pop(0).split() if self._left else ():
            if receiver == "!":
                self.conclude(Verdict.NO_SOLUTION)
            else:
                self.send(receiver, Ping())


def scripted(script: Script) -> type[Scripted]:
    """Return the protocol with this script."""
    return type("Scripted", (Scripted,), {"script": script})


def all_scripts(most: int) -> Iterator[Script]:
    """Yield every way in which two robots send each other up to `most` messages, up to two at a time."""
    turns = [turn for turn in itertools.product((0, 1, 2), repeat=most) if sum(turn) <= most]
    seen = set()
    for mine, others in itertools.product(turns, repeat=2):
        script = _used(mine, others)
        if sum(map(sum, script)) <= most and script not in seen and script[::-1] not in seen:
            seen.add(script)
            yield {
                "RA": tuple(" ".join(["RB"] * many) for many in script[0]),
                "RB": tuple(" ".join(["RA"] * many) for many in script[1]),
            }


def _used(mine: tuple[int, ...], others: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the turns that happen: the first, and one for each message of the other robot."""
    here, there = 1, 1
    while True:
        more = min(len(mine), 1 + sum(others[:there])), min(len(others), 1 + sum(mine[:here]))
        if more == (here, there):
            return mine[:here], others[:there]
        here, there = more
