"""Python as on Windows, for tests on other systems: without the modules, functions and signals of POSIX.

`take_away` is called at the start of each process (by a `sitecustomize.py`); `main` solves problems in each way, and
prints each result as a line of JSON. Modules of Python that exist in another form on Windows are imported before.
"""

from __future__ import annotations

import asyncio  # noqa: F401 - as below
import json
import multiprocessing  # noqa: F401 - as below
import os
import select
import selectors  # noqa: F401 - has another form on Windows
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

MODULES = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
FUNCTIONS = [
    "fork",
    "forkpty",
    "pwrite",
    "pread",
    "getuid",
    "geteuid",
    "getgid",
    "getegid",
    "getpgid",
    "setsid",
    "killpg",
    "set_blocking",
    "register_at_fork",
    "memfd_create",
    "pipe2",
    "sched_getaffinity",
    "mkfifo",
    "posix_fallocate",
    "posix_spawn",
    "O_CLOEXEC",
    "O_NONBLOCK",
    "O_NOCTTY",
    "O_TMPFILE",
]
SIGNALS = [
    "SIGUSR1",
    "SIGUSR2",
    "SIGKILL",
    "SIGALRM",
    "SIGHUP",
    "SIGPIPE",
    "SIGCONT",
    "SIGSTOP",
    "SIGCHLD",
    "pthread_sigmask",
    "pthread_kill",
    "setitimer",
    "ITIMER_REAL",
    "SIG_BLOCK",
    "SIG_UNBLOCK",
    "SIG_SETMASK",
    "alarm",
    "sigwait",
]


class _Absent:
    """Refuses the import of modules."""

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> None:
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def take_away() -> None:
    """Make this process resemble Windows, as far as robochoc depends on it."""
    c_signals = sys.modules["_signal"]
    sys.meta_path.insert(0, _Absent())
    for name in MODULES:
        sys.modules.pop(name, None)
    for module, names in (
        (os, FUNCTIONS),
        (signal, SIGNALS),
        (c_signals, SIGNALS),
        (select, ["poll", "epoll"]),
        (socket, ["AF_UNIX"]),
    ):
        for name in names:
            if hasattr(module, name):
                delattr(module, name)
    setattr(subprocess.Popen, "kill", _kill)  # noqa: B010 - mypy
    subprocess.Popen.__init__ = _without_descriptors(subprocess.Popen.__init__)  # type: ignore[method-assign]
    os.replace = _replace_closed(os.replace)


def _kill(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.kill(process.pid, 9)


def _without_descriptors(start: Callable[..., None]) -> Callable[..., None]:
    """Refuse what `subprocess` refuses on Windows."""

    def refused(process: object, *arguments: object, **options: object) -> None:
        if any(options.get(name) for name in ("pass_fds", "preexec_fn", "start_new_session")):
            raise ValueError("pass_fds, preexec_fn and start_new_session are not supported on Windows")
        start(process, *arguments, **options)

    return refused


def _replace_closed(replace: Callable[[Any, Any], None]) -> Callable[..., None]:
    """Refuse to rename files that this process has opened."""

    def refused(source: str | Path, target: str | Path) -> None:
        descriptors = [f"/proc/self/fd/{number}" for number in os.listdir("/proc/self/fd")]  # noqa: PTH208
        opened = {os.path.realpath(one) for one in descriptors}
        if opened & {os.path.realpath(source), os.path.realpath(target)}:
            raise PermissionError(13, "the file is in use", str(source))
        replace(source, target)

    return refused


def cases(folder: Path) -> dict[str, Callable[[], object]]:
    """Return ways to solve problems, each with a result that JSON can express."""
    import robochoc  # noqa: PLC0415 - after `take_away`

    def model(robots: int = 3, values: int = 3, *, costs: bool = False) -> robochoc.Model:
        made = robochoc.Model("team")
        x = [made.robot(f"r{place}").variable("x", range(values)) for place in range(robots)]
        made.add(robochoc.all_different(x))
        if costs:
            made.minimize(sum(abs(one - 1) for one in x))
        return made

    def journal() -> object:
        model().solve("abt", journal=folder / "run.journal")
        return len(list(robochoc.journal.rows(folder / "run.journal"))) > 3

    def saved() -> object:
        model(costs=True).save(folder / "team")
        model(costs=True).save(folder / "team", replace=True)
        return robochoc.load(folder / "team").solve("dpop").cost

    def arrays() -> object:
        return robochoc.ArrayProblem(2, 2, [(0, 1)], [[1, 0], [0, 1]]).solve("dsa", cycles=5).cost

    def container() -> object:
        made = robochoc.AgentsContainer()
        made.set_agent_type("MasterABT")
        return made.run()

    return {
        "abt": lambda: model().solve("abt").verdict,
        "dpop": lambda: model(costs=True).solve("dpop").cost,
        "auto": lambda: model(costs=True).solve(cache=False).cost,
        "arrays": lambda: model().solve("dsa", runtime="arrays", settings={"cycles": 50}).verdict,
        "array problem": arrays,
        "central, small": lambda: model(costs=True).solve("central").cost,
        "central, ACE": lambda: model(9, 9, costs=True).solve("central").cost,
        "central, OR-Tools": lambda: model(9, 9, costs=True).solve("central", central_with="ortools").cost,
        "cache": lambda: model().solve("sfb").verdict,
        "conflict": lambda: len(model(3, 2).conflict() or ()),
        "solutions": lambda: sum(1 for _ in model().solutions()),
        "time": lambda: model(9, 8).solve("abt", timeout=0.2).verdict,
        "save": saved,
        "journal": journal,
        "processes": lambda: model().solve("abt", runtime="processes").verdict,
        "network": lambda: model().solve("abt", runtime="network").verdict,
        "container": container,
    }


def main() -> None:
    """Solve problems in the ways named by the arguments, and print each result, or error."""
    import robochoc  # noqa: PLC0415 - after `take_away`

    with tempfile.TemporaryDirectory() as folder:
        known = cases(Path(folder))
        for name in sys.argv[1:]:
            try:
                result = known[name]()
            except robochoc.RobochocError as error:
                result = f"refused: {error}"
            except Exception as error:  # noqa: BLE001 - shown by the test
                result = f"error: {error!r}"
            sys.stdout.write(json.dumps([name, result]) + "\n")


if __name__ == "__main__":
    main()
