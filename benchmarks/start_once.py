"""Start n x n silent robots once: `start_once.py N METHOD [preload]` prints when all were ready, and the end.

A program of its own, so that every start is from nothing: no fork server is left from the one before.
"""

from __future__ import annotations

import multiprocessing
import sys
import time
from typing import cast

from robochoc.communication.processes.pool import StartMethod
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Registered
from robochoc.model.message import Message
from robochoc.protocols.protocol import Protocol


class Silence(Message, frozen=True):
    """What is never said."""


class Silent(Protocol):
    """A robot that compiles its problem, confirms, and is quiet."""

    messages = Silence

    def start(self) -> None:
        """Nothing to do."""

    def receive(self, sender: str, message: Message) -> None:
        """Nothing comes."""


def main() -> None:
    """Run once, and print seconds from the run's beginning to the last confirmation, and to the last exit."""
    ready_s = 0.0

    def observe(event: AnyEvent) -> None:
        nonlocal ready_s
        if isinstance(event, Registered):
            ready_s = event.t

    if sys.argv[3:] == ["preload"]:
        rooms = ["robochoc.communication.processes.processes", "robochoc.generators.queens3d"]
        multiprocessing.set_forkserver_preload(rooms)
    team = queens3d(int(sys.argv[1]))
    run = ProcessesRun(team, Silent, observer=observe, start_method=cast("StartMethod", sys.argv[2]))
    began = time.perf_counter()
    run.run()
    print(ready_s, time.perf_counter() - began)


if __name__ == "__main__":
    main()
