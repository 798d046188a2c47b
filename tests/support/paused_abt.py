"""ABT that waits until the test starts it, so that there is time to attack a run across machines."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from robochoc.model.problem import Constraint
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.settings import Settings
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from tests.support.problems import PREDICATES, team_of

PAUSE_S = 0.005


def chain(size: int = 4, values: Iterable[int] = (0, 1)) -> tuple[dict[str, tuple[int, ...]], list[Constraint]]:
    """Return variables X0, X1, ..., and constraints: each differs from the one before."""
    names = [f"X{number}" for number in range(size)]
    pairs = itertools.pairwise(names)
    return dict.fromkeys(names, tuple(values)), [Constraint("C", PREDICATES[0], pair, pair) for pair in pairs]


CHAIN = team_of(*chain(), "chain")
"""RX0 to RX3: it has a solution, and RX0 shares no constraint with RX2 and RX3."""
TRIANGLE = team_of(chain(3)[0], [*chain(3)[1], Constraint("C", PREDICATES[0], ("X0", "X2"), ("X0", "X2"))], "triangle")
"""RX0 to RX2: it has none."""


class Ping(Message, frozen=True):
    """Still waiting; `number` counts."""

    number: int


class Until(Settings, frozen=True):
    """`file`: while it is not there, the search waits."""

    file: str = ""


class PausedABT(ABT):
    """The first two robots only say `Ping` to each other until there is that file; robots write to neighbours only."""

    messages = Ok | Nogood | AddLink | Ping
    traits = replace(ABT.traits, writes_to_non_neighbours=False)
    settings = Until()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self._begun = False

    def start(self) -> None:
        if not self.problem.parents:
            self.send(self.problem.children[0], Ping(1))

    def receive(self, sender: str, message: Message) -> None:
        if not isinstance(message, Ping):
            self._begin()
            super().receive(sender, message)
        elif self.problem.parents:
            self.send(sender, Ping(message.number + 1))
        elif Path(self.settings.file).exists():
            self._begin()
        else:
            time.sleep(PAUSE_S)
            self.send(sender, Ping(message.number + 1))

    def settle(self) -> None:
        if self._begun:
            super().settle()

    def _begin(self) -> None:
        if not self._begun:
            self._begun = True
            super().start()


class OverloadedABT(PausedABT):
    """One robot raises `TooLargeError`."""

    def start(self) -> None:
        if self.problem.agent == "RX2":
            raise TooLargeError("this is too much for RX2")


class CrashingABT(PausedABT):
    """One robot's program raises `ValueError`."""

    def start(self) -> None:
        if self.problem.agent == "RX2":
            raise ValueError("out of ideas")
