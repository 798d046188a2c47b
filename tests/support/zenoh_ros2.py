"""A zenoh router in a process of its own, and a far end that speaks rmw_zenoh and is not ours."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from queue import Queue
from types import TracebackType
from typing import Any, Self

from tests.support.limits import HANG_S
from tests.support.ports import LOOPBACK, free_port

_ROUTER = """
import sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", f'["tcp/{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config):
    print("ready", flush=True)
    sys.stdin.readline()
"""
_END = Path(__file__).parent / "zenoh_ros2_end.py"


class _Program:
    """A program that ends with its standard input."""

    def __init__(self, *words: str, env: dict[str, str] | None = None) -> None:
        self.process = subprocess.Popen(
            [sys.executable, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **(env or {})},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(HANG_S)
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


class Router(_Program):
    """The router, which `ros2 run rmw_zenoh_cpp rmw_zenohd` is in a ROS 2."""

    def __init__(self) -> None:
        self.port = free_port()
        super().__init__("-c", _ROUTER, f"{LOOPBACK}:{self.port}")
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"

    @property
    def place(self) -> str:
        return f"{LOOPBACK}:{self.port}"

    def stop(self) -> None:
        """Let it do nothing from now on."""
        self.process.send_signal(signal.SIGSTOP)


class FarEnd(_Program):
    """The far end, `zenoh_ros2_end.py`."""

    def __init__(self, router: Router, env: dict[str, str] | None = None) -> None:
        super().__init__(str(_END), str(router.port), env=env)
        self.heard: list[tuple[str, dict[str, Any]]] = []
        """The messages that it has received: topics and fields."""
        self._came = threading.Condition()
        self._answers: Queue[Any] = Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        assert self._answers.get(timeout=HANG_S) == "ready"

    def kill(self) -> None:
        """Kill it; the reader has read to the end before its stream is closed."""
        self.process.kill()
        self._reader.join(HANG_S)
        super().kill()

    def ask(self, name: str, **given: object) -> Any:  # noqa: ANN401 - JSON
        """Give a command; return the answer."""
        self.begin(name, **given)
        return self.answer()

    def begin(self, name: str, **given: object) -> None:
        """Give a command, and do not wait for the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([name, given]) + "\n")
        self.process.stdin.flush()

    def answer(self) -> Any:  # noqa: ANN401 - JSON
        """Return the oldest answer that was not taken yet."""
        return self._answers.get(timeout=HANG_S)

    def wait_for(self, number: int) -> list[tuple[str, dict[str, Any]]]:
        """Return what it has heard, when it is that many messages or more."""
        with self._came:
            assert self._came.wait_for(lambda: len(self.heard) >= number, HANG_S), self.heard
            return [*self.heard]

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if not line.endswith("\n"):
                return  # it was killed while it wrote
            topic, what = json.loads(line)
            if not topic:
                self._answers.put(what)
                continue
            with self._came:
                self.heard.append((topic, what))
                self._came.notify()
