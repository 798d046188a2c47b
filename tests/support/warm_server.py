"""The process that `warm_programs.py` has programs forked from: `python -m tests.support.warm_server SOCKET`."""

from __future__ import annotations

import argparse
import ctypes
import gc
import importlib
import json
import os
import pkgutil
import runpy
import select
import signal
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path

from tests.support.large_pages import use_large_pages
from tests.support.warm_programs import HURRY, LONGEST

A_DAY_S = 86_400.0
_NAMESPACES = Path("/run/netns")
_NETWORK = 0x40000000
"""What `setns` calls CLONE_NEWNET."""

_PACKAGES = ("robochoc.authority", "robochoc.communication.network", "robochoc.run.networked")
_COMMANDS = tuple(f"robochoc.cli.commands.{name}" for name in ("directory", "master", "robot", "sniff"))
_MODULES = (
    *_COMMANDS,
    "robochoc.cli.group",
    "robochoc.protocols.satisfaction.abt",
    "robochoc.sniffer.remote",
    "zenoh.ext",
)


def main(control: socket.socket) -> None:
    """Fork whatever is asked for, and tell of ends. Returns in each child, which is to be the program then."""
    heard, told = os.pipe()
    for end in (heard, told):
        os.set_blocking(end, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    while True:
        ready, _, _ = select.select([control.fileno(), heard], [], [])
        if heard in ready:
            os.read(heard, LONGEST)
            _tell_of_ends(control)
        if control.fileno() in ready:
            content, files, _, _ = socket.recv_fds(control, LONGEST, 2)
            if not content:
                os._exit(0)
            pid = os.fork()
            if not pid:
                signal.set_wakeup_fd(-1)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                for descriptor in (heard, told):
                    os.close(descriptor)
                control.close()
                _become(json.loads(content), files)
                return
            for descriptor in files:
                os.close(descriptor)
            control.send(json.dumps({"started": pid}).encode())


def _tell_of_ends(control: socket.socket) -> None:
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            pid, status = ended
            control.send(json.dumps({"ended": pid, "status": os.waitstatus_to_exitcode(status)}).encode())


def _become(request: dict[str, object], files: list[int]) -> None:
    for descriptor, place in zip(files, (1, 2), strict=True):
        os.dup2(descriptor, place)
        os.close(descriptor)
    environment, words = request["environment"], request["words"]
    assert isinstance(environment, dict)
    assert isinstance(words, list)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(str(request["folder"]))
    if request["namespace"]:
        _enter(str(request["namespace"]))
    _let_hurry()
    sys.argv = ["robochoc", *words]


def _enter(namespace: str) -> None:
    """Enter a network namespace, as `ip netns exec` does."""
    with (_NAMESPACES / namespace).open() as file:
        assert ctypes.CDLL(None).setns(file.fileno(), _NETWORK) == 0, f"{namespace} cannot be entered"


def _let_hurry() -> None:
    """A day passes at each `HURRY`, on the clock by which the program is patient."""
    begun, days = time.monotonic, 0

    def pass_a_day(*_: object) -> None:
        nonlocal days
        days += 1

    signal.signal(HURRY, pass_a_day)
    time.monotonic = lambda: begun() + days * A_DAY_S


def _import_all() -> None:
    for package in _PACKAGES:
        path = importlib.import_module(package).__path__
        for module in pkgutil.iter_modules(path, f"{package}."):
            if not module.name.endswith(("_process", "fork_server", "__main__")):
                importlib.import_module(module.name)
    for name in _MODULES:
        importlib.import_module(name)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("socket", type=int, metavar="SOCKET", help="descriptor of a socket that is inherited")
    listener = parser.parse_args().socket
    _import_all()
    gc.freeze()
    use_large_pages()
    main(socket.socket(fileno=listener))
    runpy.run_module("robochoc", run_name="__main__", alter_sys=True)
