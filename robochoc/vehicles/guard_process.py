"""The guard process from the side of its parent: orders go there, the vehicles' states come from there.

A sink and a source with the same fleet file share one guard; the last that leaves ends it.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import msgspec

from robochoc.system.files import resolved
from robochoc.system.signals import signals_held
from robochoc.vehicles.fleet import AtEnd, Fleet
from robochoc.vehicles.kinds import Kind
from robochoc.vehicles.limits import END_S, LANDING_S, TURN_S
from robochoc.vehicles.messages import (
    End,
    Ended,
    Failed,
    Fly,
    FromGuard,
    NoWays,
    Permit,
    Phase,
    Recover,
    Setup,
    State,
    Target,
    ToGuard,
    line_of,
)

SILENT_S = 20.0
"""A guard that says nothing for so long hangs: pilots may wait some seconds for an answer."""
START_S = 60.0
"""For so long it may say nothing at first: a busy machine takes its time to start it and its links."""
_SPARE_S = 5.0
_UNWRITABLE = "/proc"
"""A folder in which nobody makes files, not even root."""
_SLICE_S = 0.2
_DONE = (Phase.ARRIVED, Phase.LANDED, Phase.OUT)


class GuardError(Exception):
    """The guard process is not there any more, or cannot do its work. The message says what the vehicles do."""


class GuardProcess:
    """A guard process for `fleet`. Raises `GuardError`, as its methods do; whoever starts it ends it by `leave`."""

    def __init__(self, fleet: Fleet) -> None:
        self.fleet = fleet
        self.states: dict[str, State] = {}
        """The newest state of each vehicle that has told one."""
        self.observers: list[Callable[[State], None]] = []
        """Called with each state, in another thread."""
        self._order = 0
        self._orders: dict[str, int] = {}
        self._sent_s = -math.inf
        self._came = threading.Condition()
        self._problem = self._no_ways = ""
        self._is_over = self._ends = self._has_ended = False
        self._heard_s = time.monotonic()
        with signals_held():
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "robochoc.vehicles.guard"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=_environment(fleet.kind),
                start_new_session=True,  # neither Ctrl-C nor the end of a terminal reaches it
            )
        self._reader = threading.Thread(target=self._read, daemon=True, name="hears the guard")
        self._reader.start()
        try:
            self._say(Setup(fleet))
        except GuardError:
            self._shut()
            raise

    def permit(self) -> None:
        """Let vehicles be armed."""
        self._say(Permit())

    def fly(self, targets: Mapping[str, Target]) -> None:
        """Send vehicles to their targets, in place of earlier ones."""
        self._order += 1
        self._orders |= dict.fromkeys(targets, self._order)
        self._sent_s = time.monotonic()
        self._say(Fly(self._order, targets))

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """Bring all vehicles to an end, and wait until each has obeyed; with `waits`, until those that land are down.

        Those that land one after the other, as one is above another's place, are waited for.

        Raises `GuardError` if the guard was lost before: vehicles then do what their own failsafe says.
        """
        self._ends = True
        with suppress(GuardError):
            self._say(End(how, waits))
        until = time.monotonic() + TURN_S + END_S + _SPARE_S + (LANDING_S if waits else 0.0)
        with self._came:
            while not self._is_over and time.monotonic() < until:
                self._came.wait(_SLICE_S)
        self._ends = self._has_ended
        if not self._has_ended:
            self._is_over = True
            self.check()

    def wait_for(self, condition: Callable[[], bool], within_s: float) -> bool:
        """Wait for `condition` on the states; return whether it has come true within the time."""
        until = time.monotonic() + within_s
        with self._came:
            while not condition():
                self.check()
                left_s = until - time.monotonic()
                if left_s <= 0:
                    return False
                self._came.wait(min(left_s, _SLICE_S))
        return True

    def check(self) -> None:
        """Raise `GuardError` if the guard is gone, or hangs."""
        if self._no_ways:
            raise GuardError(f"the decision is not flown: {self._no_ways}")
        problem = self._problem
        if not problem and self._is_over and not self._ends:
            problem = "the guard process has ended"
        limit_s = SILENT_S if self.states else START_S
        if not problem and time.monotonic() - self._heard_s > limit_s:
            problem = f"the guard process has said nothing for {limit_s:g} s"
        if problem:
            raise self._lost(problem)

    def _lost(self, problem: str) -> GuardError:
        return GuardError(f"{problem}; {self.fleet.kind.rules.alone}, until another guard reaches them")

    @property
    def is_flying(self) -> bool:
        """Return whether vehicles are on the way to where they were sent, and still may be."""
        in_time = time.monotonic() - self._sent_s < self.fleet.time_s
        return in_time and not all(map(self.is_done, self._orders))

    def is_done(self, name: str) -> bool:
        """Return whether a vehicle is through with its newest order: it is there, or out of order."""
        state = self.states.get(name)
        return state is not None and state.phase in _DONE and state.order == self._orders.get(name)

    def close(self) -> None:
        """End the process. Vehicles that were not brought to an end are, by itself, when it hears nothing more.

        If it was lost, another guard does that.
        """
        self._shut()
        if self._orders and not self._has_ended:
            flown = {name: link for name, link in self.fleet.vehicles.items() if name in self._orders}
            with suppress(GuardError):
                _recover(msgspec.structs.replace(self.fleet, vehicles=flown))

    def recover(self) -> None:
        """Bring to an end what another guard has left armed, and wait for that."""
        self._ends = True
        self._say(Recover(self.fleet.end))
        until = time.monotonic() + self.fleet.connect_s + END_S + _SPARE_S
        with self._came:
            while not self._is_over and time.monotonic() < until:
                self._came.wait(_SLICE_S)

    def _shut(self) -> None:
        if self._process.stdin:
            with suppress(OSError):
                self._process.stdin.close()
        try:
            self._process.wait(TURN_S + END_S + _SPARE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        if self._process.stdout:
            self._process.stdout.close()

    @property
    def pid(self) -> int:
        """Return the number of the process."""
        return self._process.pid

    def _say(self, message: ToGuard) -> None:
        content = line_of(message)
        try:
            if self._process.stdin is None:
                raise BrokenPipeError
            os.write(self._process.stdin.fileno(), content)
        except (OSError, ValueError):
            self.check()  # a report of the guard may state the reason
            raise self._lost("the guard process has ended") from None  # the reader has not noticed it yet

    def _read(self) -> None:
        stdout = self._process.stdout
        for line in stdout or ():
            with suppress(msgspec.DecodeError):
                self._take(msgspec.json.decode(line, type=FromGuard))
        with self._came:
            self._is_over = True
            self._came.notify_all()

    def _take(self, message: FromGuard) -> None:
        with self._came:
            self._heard_s = time.monotonic()
            match message:
                case State():
                    self.states[message.vehicle] = message
                case NoWays(why=why):
                    self._no_ways = self._no_ways or why
                case Failed(why=why):
                    self._problem = self._problem or f"the guard process failed: {why}"
                case Ended():
                    self._is_over = self._has_ended = True
            self._came.notify_all()
        if isinstance(message, State):
            for observer in self.observers:
                observer(message)


def _recover(fleet: Fleet) -> None:
    guard = GuardProcess(fleet)
    try:
        guard.recover()
    finally:
        guard.close()


def _environment(kind: Kind) -> dict[str, str]:
    """Return the environment of the guard. MAVSDK's files, which it would leave behind when killed, have no place.

    They are descriptions of cameras and the like. MAVSDK goes on without them where no folder can be made; it ends
    where the temporary folder does not exist, or so it does in 4.1.
    """
    leaves_files = kind == Kind.MAVLINK and Path(_UNWRITABLE).is_dir()
    nowhere = {"TMPDIR": _UNWRITABLE, "XDG_CACHE_HOME": _UNWRITABLE} if leaves_files else {}
    return {**os.environ, **nowhere}


class _Shared:
    """The guards of this process, by fleet file, and how many use each."""

    def __init__(self) -> None:
        self._open: dict[Path, tuple[GuardProcess, int]] = {}

    def enter(self, path: Path, fleet: Fleet) -> GuardProcess:
        """Return the guard for a fleet file; it is started for the first that asks."""
        key = resolved(path)
        guard, users = self._open.get(key, (None, 0))
        guard = guard or GuardProcess(fleet)
        self._open[key] = guard, users + 1
        return guard

    def leave(self, path: Path) -> None:
        """End the guard if nobody else uses it."""
        key = resolved(path)
        guard, users = self._open.pop(key)
        if users > 1:
            self._open[key] = guard, users - 1
        else:
            guard.close()


shared = _Shared()
