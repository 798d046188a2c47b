"""A real ROS 1: Debian's, installed by whoever needs it first, and a core of its own on loopback."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import pytest

from robochoc.robots.sink import SinkError
from robochoc.ros.live.rospy_node import RospySink
from tests.support.limits import HANG_S
from tests.support.program import ROOT

PACKAGES = (
    "python3-geometry-msgs",
    "python3-rosbag",
    "python3-roslaunch",
    "python3-rospy",
    "python3-rostopic",
    "python3-sensor-msgs",
)
"""The least that has `rosbag`, `roscore` and `rostopic`, and the messages that we use; they need fifty others."""
SYSTEM_PYTHON = "/usr/bin/python3"
SYSTEM_PACKAGES = "/usr/lib/python3/dist-packages"


def install() -> None:
    """Have Debian's packages installed, or skip the test."""
    if all(map(shutil.which, ("rosbag", "roscore", "rostopic"))) and Path(SYSTEM_PACKAGES, "rospy").is_dir():
        return
    if not shutil.which("apt-get"):
        pytest.skip("no apt-get here: a real ROS 1 is installed from Debian's packages")
    if os.geteuid() != 0:
        pytest.skip(f"only root can install a real ROS 1: apt-get install {' '.join(PACKAGES)}")
    command = ["apt-get", "-o", "DPkg::Lock::Timeout=120", "install", "-y", "--no-install-recommends", *PACKAGES]
    for wanted in (["apt-get", "update"], command):
        done = subprocess.run(
            wanted, env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"}, capture_output=True, text=True, check=False
        )
        if done.returncode:
            pytest.skip(f"{' '.join(wanted[:2])} failed: {(done.stderr.strip().splitlines() or ['?'])[-1]}")


class Core:
    """A `roscore`. Enter it to have it run; when it is left nothing of it is."""

    def __init__(self, folder: Path) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.env = {
            **{name: value for name, value in os.environ.items() if not name.startswith("ROS")},
            "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(folder / "home"),
            "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONPATH": os.pathsep.join((str(ROOT), SYSTEM_PACKAGES)),
        }
        self.logs = folder
        self._others: list[subprocess.Popen[str]] = []

    def __enter__(self) -> Self:
        self.process = subprocess.Popen(
            ["roscore", "-p", str(self.port)],
            env=self.env,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        assert until(lambda: "/rosout" in self.rostopic("list").stdout, 60)
        return self

    def __exit__(self, *_: object) -> None:
        for other in self._others:
            other.kill()
            other.communicate()
        self.end()

    def end(self) -> None:
        """End the core, and all that it has started."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(HANG_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
        assert until(lambda: not self.running(), 20), self.running()

    def running(self) -> list[str]:
        """What is left of it: nobody else has this port in its arguments, or this folder."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_text(encoding="utf-8", errors="replace")
            except OSError:
                continue
            if f"-p\0{self.port}" in words or self.env["ROS_LOG_DIR"] in words:
                found.append(words.replace("\0", " "))
        return found

    def rostopic(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run Debian's own tool."""
        return subprocess.run(
            ["rostopic", *words], env=self.env, capture_output=True, text=True, timeout=HANG_S, check=False
        )

    def program(self, *words: str, python: str = sys.executable) -> subprocess.Popen[str]:
        """Start a Python program, with rospy: ours, or with Debian's Python one that has nothing of us."""
        env = {**self.env, "PYTHONPATH": ""} if python == SYSTEM_PYTHON else self.env
        pipe = subprocess.PIPE
        self._others.append(
            subprocess.Popen([python, *words], env=env, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        )
        return self._others[-1]


def until(what: Callable[[], object], seconds: float) -> bool:
    """Whether that is so in time."""
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.1)
    return True


def lines(text: str) -> list[Any]:
    """Lines of JSON."""
    return [json.loads(line) for line in text.splitlines()]


def publish_much() -> None:
    """Publish until it cannot be gone on: a program for tests, which prints what went wrong."""
    try:
        with RospySink("") as sink:
            for number in range(int(sys.argv[2])):
                sink.publish("/a/out_of_order", "std_msgs/String", {"data": f"{number} {'x' * 10_000}"}, 0)
                time.sleep(float(sys.argv[3]))
                if not number:
                    sys.stdout.write("began\n")
                    sys.stdout.flush()
    except SinkError as failed:
        sys.stdout.write(str(failed))


if __name__ == "__main__":
    publish_much()
