"""What a test leaves behind: threads, processes, descriptors (with them ports), temporary files.

`Belongings` is what there is at a moment; what is there after a test and was not before it is left behind. After most
tests a `Glance` shows that nothing has changed. What tests share (a browser, a solver) is begun inside
`shared_by_tests`, and belongs to nobody.

Linux only: /proc says what there is.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple, Self
from weakref import WeakSet

from tests.support.limits import HANG_S, wait_until

WITHIN_S = HANG_S
"""What ends by itself has ended by then, however busy the machine is."""
_BEFORE_ALL_GARBAGE_S = 0.2
"""Most of what is still there after a test ends sooner. No longer wait is needed, as another one follows."""
MARK = "ROBOCHOC_TESTS"
"""The environment's variable that all processes of a test run inherit."""
_OWN_KINDS = ("anon_inode:", "/dev/", "/proc/", "/sys/")
"""Descriptors of the interpreter and of native libraries, once for all: event polls, random numbers."""
_PYTESTS_OWN = "pytest-of-"
"""A pytest that a test starts keeps the folders of its last runs."""
_HELPERS = (b"multiprocessing.resource_tracker", b"multiprocessing.forkserver")
"""Python's own processes, which stay until the interpreter ends."""
_LISTENS = "0A"
"""The state of a socket in /proc/net/tcp that waits for links."""

_shared_threads: WeakSet[threading.Thread] = WeakSet()
_shared_processes: set[int] = set()
_shared_descriptors: set[str] = set()
_shared_files: set[str] = set()
_shared_programs: set[int] = set()
_socket_names: dict[str, str] = {}
"""The names of the sockets seen so far. Listing TCP links takes the kernel 7 ms: it is done for new sockets only."""


class Belongings(NamedTuple):
    """What this process has at a moment."""

    threads: frozenset[threading.Thread]
    processes: frozenset[int]
    descriptors: frozenset[str]
    files: frozenset[str]

    @classmethod
    def now(cls) -> Self:
        """Return what there is."""
        multiprocessing.active_children()  # takes leave of those that have ended
        return cls(frozenset(threading.enumerate()), frozenset(_children()), frozenset(_descriptors()), _files())

    def left(self) -> list[str]:
        """Return in words what has been added since."""
        now = self.now()
        threads = {thread for thread in now.threads - self.threads if thread not in _shared_threads}
        processes = {pid for pid in now.processes - self.processes - _shared_processes if not _is_helper(pid)}
        descriptors = now.descriptors - self.descriptors - _shared_descriptors
        for helper in filter(_is_helper, now.processes - self.processes if descriptors else ()):
            descriptors -= set(_descriptors(helper))  # the other ends of what holds them
        return [
            *(f"thread {thread.name}" for thread in threads),
            *(f"process {pid}: {_command(pid)}" for pid in processes),
            *(f"descriptor {target}" for target in descriptors),
            *(f"file {path}" for path in now.files - self.files - _shared_files),
        ]

    def check(self, but: str = "nothing", message: str = "left behind") -> None:
        """Wait until nothing is left that has been added since; fail if something stays.

        Args:
            but: The beginning of what may stay, as in "descriptor socket".
            message: The beginning of the error message.
        """

        def left() -> list[str]:
            return [each for each in self.left() if not each.startswith(but)]

        if not left():
            return
        gc.collect(1)  # the garbage of a test is young; a search through all objects takes half a second
        try:
            wait_until(lambda: not left(), message, min(WITHIN_S, _BEFORE_ALL_GARBAGE_S))
        except AssertionError:
            gc.collect()
            wait_until(lambda: not left(), lambda: f"{message}: {left()}", WITHIN_S)


class Glance(NamedTuple):
    """The threads, child processes, numbers of descriptors and temporary files: 20 times cheaper than `Belongings`."""

    threads: frozenset[threading.Thread]
    processes: frozenset[int]
    descriptors: frozenset[str]
    files: frozenset[str]

    @classmethod
    def now(cls) -> Self:
        """Return the current state."""
        return cls(
            frozenset(threading.enumerate()),
            frozenset(_children_of(os.getpid())),
            frozenset(os.listdir("/proc/self/fd")),  # noqa: PTH208 - names are cheaper than paths
            frozenset(os.listdir(tempfile.gettempdir())),  # noqa: PTH208
        )


class LeftoversOfFile:
    """Checks after each test of a file, and once more after the last one, that nothing is left behind.

    After a test a glance is enough as long as it shows the same as before the test. A glance misses what takes the
    number of a closed descriptor, and children of shared processes: the check at the end of the file finds both.

    Args:
        but: The beginning of what may stay, as in "descriptor socket".
    """

    def __init__(self, but: str) -> None:
        self._but = but
        self._glance, self._before = Glance.now(), Belongings.now()

    @contextmanager
    def of_test(self) -> Iterator[None]:
        """Check that the test inside leaves nothing behind."""
        glance = Glance.now()
        if glance != self._glance:  # a fixture that several tests share was set up, or removed
            self._glance, self._before = glance, Belongings.now()
        yield
        if Glance.now() != self._glance:
            self._before.check(self._but)

    def check(self) -> None:
        """Check that the file leaves nothing behind."""
        self._before.check(self._but, "left behind by a test of this file")


@contextmanager
def nothing_left_behind() -> Iterator[None]:
    """Whatever was begun inside must have ended afterwards, or end by itself."""
    before = Belongings.now()
    yield
    before.check()


@contextmanager
def shared_by_tests(*, with_children: bool = False) -> Iterator[None]:
    """What is begun inside is shared by tests: none of them has left it behind.

    Args:
        with_children: The same holds for all that its processes start later, as a browser does.
    """
    before = Belongings.now()
    yield
    now = Belongings.now()
    _shared_threads.update(now.threads - before.threads)
    _shared_processes.update(now.processes - before.processes)
    if with_children:
        _shared_programs.update(now.processes - before.processes)
    _shared_descriptors.update(now.descriptors - before.descriptors)
    _shared_files.update(now.files - before.files)


@contextmanager
def no_process_left(mark: str) -> Iterator[None]:
    """Whatever process was started inside has ended, also when it has left this one's family."""
    before = set(marked(mark))

    def left() -> list[str]:
        new = set(marked(mark)) - before - _shared_processes
        return [f"{pid}: {_command(pid)}" for pid in new if not (_is_helper(pid) or _is_of_a_shared_program(pid))]

    yield
    wait_until(lambda: not left(), lambda: f"processes left behind: {left()}", WITHIN_S)


def _children() -> Iterator[int]:
    """Yield the processes below this one that run."""
    below = [os.getpid()]
    while below:
        found = _children_of(below.pop())
        below.extend(found - _shared_programs)
        yield from found


def _children_of(pid: int) -> set[int]:
    found: set[int] = set()
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with suppress(OSError):
                found.update(map(int, (task / "children").read_text().split()))
    return found


def _is_of_a_shared_program(pid: int) -> bool:
    while pid > 1:
        if pid in _shared_programs:
            return True
        try:
            pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            return False
    return False


def _descriptors(pid: str | int = "self") -> Iterator[str]:
    """Yield the names of the open descriptors: those of TCP links name the other end, and are numbered."""
    so_far = Counter[str]()
    targets = list(_targets(pid))
    sockets = {target for target in targets if target.startswith("socket:")}
    if not _socket_names.keys() >= sockets:
        links = _links()
        _socket_names.update({target: links.get(target, target) for target in sockets - _socket_names.keys()})
    for target in targets:
        name = _socket_names.get(target, target)
        if name != target:
            so_far[name] += 1
            name = f"{name}, number {so_far[name]}"
        yield name


def _targets(pid: str | int) -> Iterator[str]:
    with suppress(OSError):
        for entry in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(OSError):
                target = str(entry.readlink())
                if not target.startswith(_OWN_KINDS):
                    yield target


def _links() -> dict[str, str]:
    """Return the TCP links of this machine by what /proc calls their sockets.

    A link that a run which tests share has opened anew (on a busy machine, after an outage) takes the place of the one
    before, and is not left behind.
    """
    links = {}
    for table in ("tcp", "tcp6"):
        with suppress(OSError):
            for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
                _, local, remote, state, *rest = line.split()
                if state != _LISTENS:
                    links[f"socket:[{rest[5]}]"] = f"socket: {table} link with {_address(remote)}"
                else:
                    links[f"socket:[{rest[5]}]"] = f"socket: {table} listens at {_address(local)}"
    return links


def _address(hexadecimal: str) -> str:
    host, _, port = hexadecimal.rpartition(":")
    return f"{host}:{int(port, 16)}"


def _files() -> frozenset[str]:
    """Return what is in the folder for temporary files, which these tests have for themselves."""
    temporary = Path(tempfile.gettempdir())
    return frozenset(str(path) for path in temporary.iterdir() if not path.name.startswith(_PYTESTS_OWN))


def marked(mark: str) -> Iterator[int]:
    """Yield the processes whose environment has the mark: what was started with it, and all that these have started."""
    sought = f"{MARK}={mark}".encode()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with suppress(OSError):
                if sought in (entry / "environ").read_bytes().split(b"\0"):
                    yield int(entry.name)


def _is_helper(pid: int) -> bool:
    with suppress(OSError):
        return any(name in Path(f"/proc/{pid}/cmdline").read_bytes() for name in _HELPERS)
    return False


def _command(pid: int) -> str:
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        return command[:200] or "no command"
    except OSError:
        return "it has just ended"
