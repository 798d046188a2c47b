"""Played Nav2 robots in a program of their own (`played_nav2.py`), as tests use them."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from queue import Empty, Queue
from typing import Any, Self

from tests.support.limits import HANG_S
from tests.support.program import ROOT


class PlayedRobots:
    """Enter it to have the robots run; `place` is `dds:DOMAIN` or `rmw_zenoh:HOST:PORT`.

    With the program `played_crazyflies`, they are the drones of a server of Crazyswarm2.
    """

    def __init__(self, place: str, manners: dict[str, str], program: str = "played_nav2") -> None:
        words = [sys.executable, "-m", f"tests.support.{program}", place, json.dumps(manners)]
        self._program = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT)
        self._lines: Queue[Any] = Queue()
        self.events: list[Any] = []
        self._reader = threading.Thread(target=self._read, daemon=True)

    def __enter__(self) -> Self:
        self._reader.start()
        assert self._lines.get(timeout=HANG_S) == "ready"
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    def kill(self) -> None:
        """End the program."""
        self._program.kill()
        self._program.wait(HANG_S)
        self._reader.join(HANG_S)
        for stream in (self._program.stdin, self._program.stdout):
            if stream is not None:
                stream.close()

    def become(self, name: str, manner: str) -> None:
        """Change the manner of a robot."""
        assert self._program.stdin is not None
        self._program.stdin.write(json.dumps([name, manner]) + "\n")
        self._program.stdin.flush()
        self.wait_for(name, "is told")

    def wait_for(self, name: str, what: str) -> list[Any]:
        """Return the next event of this kind."""
        while True:
            event = self._lines.get(timeout=HANG_S)
            self.events.append(event)
            if event[:2] == [name, what]:
                return list(event[2:])

    def past(self) -> list[Any]:
        """Return all events so far."""
        while True:
            try:
                self.events.append(self._lines.get_nowait())
            except Empty:
                return self.events

    def _read(self) -> None:
        assert self._program.stdout is not None
        for line in self._program.stdout:
            self._lines.put(json.loads(line))
