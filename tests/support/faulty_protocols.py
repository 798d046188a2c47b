"""Protocols that do what a protocol must not do, or more than one usually does.

Run as a program it lets a team speak one of them: `python faulty_protocols.py TEAM Spins`.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
from typing import cast

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.generators.queens3d import queens3d
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol

TEAM = queens3d(2)
CROWD = queens3d(5)
FLOOD = 2000
FLOOD_BYTES = 10_000
LARGE_BYTES = 1_000_000


class Word(Message, frozen=True):
    """Something to say."""

    text: str = ""


class Strange(Message, frozen=True):
    """What nobody understands."""


class Speaks(Protocol):
    """Each robot says one word to the robot after it."""

    messages = Word

    def start(self) -> None:
        self.send(self.next, Word())

    def receive(self, sender: str, message: Message) -> None:
        """The word is heard."""

    @property
    def next(self) -> str:
        names = [robot.name for robot in TEAM.robots]
        return names[(names.index(self.problem.agent) + 1) % len(names)]

    @property
    def is_first(self) -> bool:
        return self.problem.agent == TEAM.robots[0].name


class Raises(Speaks):
    def settle(self) -> None:
        if self.is_first:
            raise ValueError("out of ideas")


class RaisesAtOnce(Speaks):
    def start(self) -> None:
        if self.is_first:
            raise ValueError("no ideas at all")


class Leaves(Speaks):
    def settle(self) -> None:
        if self.is_first:
            os._exit(7)


class HangsUp(Speaks):
    """Closes all its pipes, so that it looks ended, and lives on."""

    def settle(self) -> None:
        if self.is_first:
            os.closerange(3, 1000)
            time.sleep(1000)


class AsksForStranger(Speaks):
    def start(self) -> None:
        if self.is_first:
            self.send("Robot9.9", Word())


class TalksNonsense(Speaks):
    def start(self) -> None:
        if self.is_first:
            self.send(self.next, Strange())


class TalksToAll(Speaks):
    """A crowd in which everyone needs a pipe to everyone."""

    def start(self) -> None:
        for robot in CROWD.robots:
            self.send(robot.name, Word())


class HasFewFiles(TalksToAll):
    """One robot may not open as many files as it needs pipes."""

    def start(self) -> None:
        if self.is_first:
            allow_no_more_files()
        super().start()


class Spins(Speaks):
    """Computes for ever, deaf to everything."""

    def settle(self) -> None:
        while True:
            pass


class StopsItself(Speaks):
    """The first robot is stopped, as by SIGSTOP from elsewhere, before it says its word."""

    def start(self) -> None:
        if self.is_first:
            os.kill(os.getpid(), signal.SIGSTOP)
        super().start()


class Floods(Speaks):
    """Two robots say far more to each other than pipes hold, before either reads."""

    def start(self) -> None:
        first, second = (robot.name for robot in TEAM.robots[:2])
        other = {first: second, second: first}.get(self.problem.agent)
        if other:
            for _ in range(FLOOD):
                self.send(other, Word("x" * FLOOD_BYTES))


class SaysMuch(Speaks):
    """One message that is larger than any pipe."""

    def start(self) -> None:
        self.send(self.next, Word("x" * LARGE_BYTES))

    def receive(self, sender: str, message: Message) -> None:
        if cast("Word", message).text != "x" * LARGE_BYTES:
            raise ValueError(f"{sender} has been cut short")


def allow_no_more_files(_: object = None) -> None:
    """Whatever this process opens from now on is refused."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))


if __name__ == "__main__":
    observer = allow_no_more_files if "parent-has-few-files" in sys.argv else None
    ProcessesRun(globals()[sys.argv[1]], globals()[sys.argv[2]], observer=observer).run()
