"""Programs that start warm: each is a fork of one process that has imported `robochoc`, and done nothing else.

To start Python and to import takes most of the time of a program that does little, and tests of machines start many. In
all else these are programs as others are: a process each, with the environment, folder, streams and signals of its own.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from tests.support.limits import HANG_S
from tests.support.program import ROOT

_MODULE = "tests.support.warm_server"
HURRY = signal.SIGURG
"""A signal at which a day passes for a program: nothing that it waits for takes longer. By default it does nothing."""
LONGEST = 2**17
"""Bytes of one request: a command, and an environment."""


class WarmPrograms:
    """A process that others are forked from. A context manager."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._statuses: dict[int, int] = {}
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            command = [sys.executable, "-m", _MODULE, str(theirs.fileno())]
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, cwd=ROOT, pass_fds=[theirs.fileno()]
            )

    def start(
        self,
        words: Sequence[str],
        out: IO[bytes],
        err: IO[bytes],
        environment: Mapping[str, str],
        folder: Path,
        namespace: str = "",
    ) -> WarmProcess:
        """Start `robochoc` with `words`, in a network `namespace` if that is given."""
        request = {
            "words": list(words),
            "environment": dict(environment),
            "folder": str(folder),
            "namespace": namespace,
        }
        with self._lock:
            socket.send_fds(self._socket, [json.dumps(request).encode()], [out.fileno(), err.fileno()])
            while "started" not in (answer := self._answer(HANG_S)):
                pass
        return WarmProcess(self, answer["started"])

    def status(self, pid: int, within_s: float) -> int | None:
        """The exit status of a process, as soon as it has one; None when it has none yet."""
        until = time.monotonic() + within_s
        while True:
            with self._lock:
                if pid in self._statuses:
                    return self._statuses[pid]
                left = until - time.monotonic()
                if not self._answer(max(0.0, left)) and left <= 0:
                    return None

    def _answer(self, within_s: float) -> dict[str, Any]:
        """What comes next from that process; empty when nothing comes."""
        if not select.select([self._socket], [], [], within_s)[0]:
            return {}
        content = self._socket.recv(LONGEST)
        assert content, "the process that programs are forked from has ended"
        answer: dict[str, Any] = json.loads(content)
        if "ended" in answer:
            self._statuses[answer["ended"]] = answer["status"]
        return answer

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()
        self._process.wait()


class WarmProcess:
    """One program, as `subprocess.Popen` has it."""

    def __init__(self, programs: WarmPrograms, pid: int) -> None:
        self.pid = pid
        self._programs = programs

    def poll(self) -> int | None:
        """Its exit status, if it has ended."""
        return self._programs.status(self.pid, 0)

    def wait(self, within_s: float = HANG_S) -> int:
        """Its exit status, once it has ended."""
        status = self._programs.status(self.pid, within_s)
        if status is None:
            raise subprocess.TimeoutExpired(str(self.pid), within_s)
        return status

    def send_signal(self, signum: signal.Signals) -> None:
        """Send it a signal, if it has not ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):  # its end is told a moment after it
                os.kill(self.pid, signum)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)
