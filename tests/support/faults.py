"""A run of the program that something happens to, and whatever it leaves behind.

Linux only: what is left is looked for in /proc, /dev/shm and the folders that the program writes to.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT

PROGRAM = str(Path(sys.executable).with_name("robochoc"))
POLL_S = 0.01
_MARK = "ROBOCHOC_FAULT_TEST"
_SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - where shared memory would be left
_LISTENING = "0A"
_PROGRAMS = {
    "solver": b"robochoc.solver.ace_process",
    "router": b"robochoc.communication.network.router_process",
    "viewer": b"robochoc.sniffer.viewer_process",
    "guard": b"robochoc.vehicles.guard",
}
"""Processes of a run that are programs of their own, and no robots."""


class Run:
    """The program `command`, in a session of its own, with `home` as its TMPDIR's and its outputs' place.

    Its environment bears a mark that all its processes inherit; that and the session are how they are found.
    """

    def __init__(self, command: list[str], home: Path, *, open_files: int | None = None, stdout: int = -1) -> None:
        self.home = home
        self.temporary = home / "tmp"
        self.temporary.mkdir()
        self._mark = f"{_MARK}={token_hex(8)}".encode()
        self._shared_before = _shared_memory()
        self._struck = 0.0
        self.names: list[str] = []
        """The robots, in the order in which they are started, as far as a test tells."""
        key, value = self._mark.decode().split("=")
        environment = {**os.environ, "TMPDIR": str(self.temporary), key: value}
        with (home / "stdout").open("wb") as out, (home / "stderr").open("wb") as err:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=out if stdout < 0 else stdout,
                stderr=err,
                env=environment,
                start_new_session=True,
                preexec_fn=None if open_files is None else lambda: _limit_files(open_files),  # noqa: PLW1509
                cwd=ROOT,
            )
        self.pid = self._process.pid

    # While it runs

    def robots(self) -> list[int]:
        """The ids of the robots' processes, in the order of their start, as long as none has ended."""
        try:
            return [int(pid) for pid in Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text().split()]
        except OSError:
            return []

    def wait_for_robots(self, count: int) -> list[int]:
        """Wait until `count` robots have a process."""
        wait_until(lambda: len(self.robots()) >= count, f"there are no {count} robots: {self.errors()}")
        return self.robots()

    def program(self, role: str) -> int | None:
        """The id of the `solver`, the `router`, the `viewer` or the `guard`, while there is one."""
        return self._first(lambda pid: _PROGRAMS[role] in _read(pid, "cmdline"))

    def robot(self, name: str) -> int | None:
        """The id of the robot's process, in whatever runtime, once it bears its name."""
        return self._first(lambda pid: _read(pid, "comm") == f"{name}\n".encode())

    def _first(self, fits: Callable[[int], bool]) -> int | None:
        return next((pid for pid in _pids() if fits(pid) and _alive(pid) and self._is_ours(pid)), None)

    def wait_until_listening(self) -> None:
        """Wait until the program, and no longer Python alone, answers signals, or is over already."""
        bit = 1 << (signal.SIGTERM - 1)
        wait_until(lambda: bool(_signals(self.pid, "SigCgt") & bit) or self.is_over, "it never listened to signals")

    def strike(self, signum: int, *victims: int, group: bool = False) -> None:
        """Send `signum` to `victims`, to the program itself without any, or to its whole process group."""
        self._struck = time.monotonic()
        if group:
            os.killpg(self.pid, signum)
        for pid in victims or ((self.pid,) if not group else ()):
            os.kill(pid, signum)

    @contextmanager
    def standing_still(self) -> Iterator[None]:
        """Stop the program itself; it notices what happens inside all at once, afterwards."""
        self.strike(signal.SIGSTOP)
        wait_until(lambda: is_stopped(self.pid), "it cannot be stopped")
        yield
        self.strike(signal.SIGCONT)

    @property
    def is_over(self) -> bool:
        """Whether the program itself has ended."""
        return self._process.poll() is not None

    # Afterwards

    def end(self, within_s: float = HANG_S) -> float:
        """Wait until no process is left; return how long that took since the last strike."""
        known = {self.pid, *self.processes()}
        deadline = time.monotonic() + within_s
        while True:
            self._process.poll()
            known = {pid for pid in known if _alive(pid)}
            took = time.monotonic() - self._struck
            if not known and not (known := set(self.processes())):
                return took
            if time.monotonic() > deadline:
                raise AssertionError(f"after {took:.1f} s there are still {sorted(known)}: {self.errors()}")
            time.sleep(POLL_S)

    def processes(self) -> list[int]:
        """The ids of all processes of this run."""
        return [pid for pid in _pids() if _alive(pid) and self._is_ours(pid)]

    def _is_ours(self, pid: int) -> bool:
        return _session(pid) == self.pid or self._mark in _read(pid, "environ")

    def status(self) -> int:
        """The exit status; negative: killed by that signal."""
        return self._process.wait(HANG_S)

    def errors(self) -> str:
        """What it has written to stderr."""
        return (self.home / "stderr").read_text()

    def output(self) -> str:
        """What it has written to stdout."""
        return (self.home / "stdout").read_text()

    def left_behind(self) -> list[str]:
        """Files that nobody asked for: temporary ones, shared memory, unfinished outputs."""
        unfinished = [path for path in self.home.rglob("*") if path.name.startswith(".") or path.suffix == ".part"]
        shared = _shared_memory() - self._shared_before
        return [*map(str, (*self.temporary.iterdir(), *unfinished)), *(shared and shared - _mapped_memory())]

    def ports(self) -> set[int]:
        """TCP ports at which processes of this run listen."""
        return {port for port, _ in self.listening()}

    def listening(self) -> set[tuple[int, str]]:
        """Port and inode of the TCP sockets at which processes of this run listen."""
        inodes = {inode for pid in self.processes() for inode in _sockets(pid)}
        return {(port, inode) for port, inode in _listening() if inode in inodes}

    @staticmethod
    def still_listening(sockets: set[tuple[int, str]]) -> set[tuple[int, str]]:
        """Those of `sockets` that anybody still listens at."""
        return sockets & set(_listening())

    def put_out(self) -> None:
        """Kill whatever is left, so that a test that fails leaves nothing either."""
        for pid in self.processes():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()


@contextmanager
def running(command: list[str], home: Path, *, open_files: int | None = None, stdout: int = -1) -> Iterator[Run]:
    """A run of `command`; it is over afterwards in any case."""
    home.mkdir(parents=True, exist_ok=True)
    run = Run(command, home, open_files=open_files, stdout=stdout)
    try:
        yield run
    finally:
        run.put_out()


def open_descriptors() -> int:
    """How many files this process holds open."""
    return len(list(Path("/proc/self/fd").iterdir()))


def own_children() -> dict[int, str]:
    """Return the processes that this one has started and not taken leave of, with their names (Linux)."""
    pids = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    return {int(pid): _read(int(pid), "comm").decode().strip() for pid in pids}


def _limit_files(count: int) -> None:
    resource.setrlimit(resource.RLIMIT_NOFILE, (count, count))


def _pids() -> list[int]:
    return [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]


def _stat(pid: int) -> list[str]:
    """The fields of /proc/PID/stat from the state on; none when it has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _alive(pid: int) -> bool:
    """Whether the process is there and is more than an entry for its parent to read."""
    fields = _stat(pid)
    return bool(fields) and fields[0] not in "ZX"


def _session(pid: int) -> int:
    fields = _stat(pid)
    return int(fields[3]) if fields else 0


def _read(pid: int, file: str) -> bytes:
    """The content of /proc/PID/`file`; nothing when the process has ended."""
    try:
        return Path(f"/proc/{pid}/{file}").read_bytes()
    except OSError:
        return b""


def is_stopped(pid: int) -> bool:
    """Whether the process has been stopped, or has ended."""
    return not _alive(pid) or _stat(pid)[:1] in ([], ["T"])


def ignores_ctrl_c(pid: int) -> bool:
    """Whether the process ignores SIGINT."""
    return bool(_signals(pid, "SigIgn") & 1 << (signal.SIGINT - 1))


def _signals(pid: int, kind: str) -> int:
    """The set of signals that the process has handlers for (`SigCgt`), or ignores (`SigIgn`)."""
    lines = _read(pid, "status").decode().splitlines()
    return next((int(line.split()[1], 16) for line in lines if line.startswith(kind)), 0)


def _sockets(pid: int) -> Iterator[str]:
    with suppress(OSError):
        for entry in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(OSError):
                target = str(entry.readlink())
                if target.startswith("socket:["):
                    yield target[len("socket:[") : -1]


def _listening() -> Iterator[tuple[int, str]]:
    """Port and inode of every listening TCP socket of this machine."""
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        with suppress(OSError):
            for line in Path(table).read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == _LISTENING:
                    yield int(fields[1].rpartition(":")[2], 16), fields[9]


def _shared_memory() -> set[str]:
    """Names in /dev/shm as Python makes them; browsers of other tests put theirs there too."""
    return {str(path) for path in _SHARED_MEMORY.iterdir() if path.name.startswith(("psm_", "sem.mp", "pym-", "robo"))}


def _mapped_memory() -> set[str]:
    """Names in /dev/shm that a living process has mapped, such as the semaphores of another worker's tests."""
    found: set[str] = set()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):
            found.update(line.split()[-1] for line in maps.read_text().splitlines() if str(_SHARED_MEMORY) in line)
    return found
