"""The application in a process of its own, as `robochoc app` runs it: NiceGUI can be begun once a process only."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.limits import HANG_S


class AppServer:
    """A running application, that keeps its teams in `folder`."""

    def __init__(self, folder: Path, port: int = 0) -> None:
        pytest.importorskip("nicegui")
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "robochoc", "app", "--no-open", "--folder", str(folder), "--port", str(port)],
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stderr is not None
        line = self.process.stderr.readline()
        assert " is the application" in line, line + self.process.stderr.read()
        self.url = line.split()[0]

    @property
    def port(self) -> int:
        """The port of its address."""
        return int(self.url.split("/")[2].split(":")[1])

    @property
    def path(self) -> str:
        """The path of its address, which is its secret."""
        return "/" + self.url.split("/", 3)[3]

    def end(self, by: int = signal.SIGINT) -> int:
        """End it by a signal; return its exit status."""
        if self.process.poll() is None:
            os.kill(self.process.pid, by)
        try:
            return self.process.wait(HANG_S)
        finally:
            self.process.kill()
            assert self.process.stderr is not None
            self.process.stderr.close()


@contextmanager
def app_server(folder: Path) -> Iterator[AppServer]:
    """A running application, which ends by Ctrl-C."""
    server = AppServer(folder)
    try:
        yield server
    finally:
        assert server.end() == 0
