"""The client of the guard process: sends orders to it, and receives the vehicles' states.

A sink and a source with the same fleet file share one guard process; the last user ends it.
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

from robochoc.system.errors import RobochocError
from robochoc.system.shared import Shared
from robochoc.system.signals import signals_delayed
from robochoc.vehicles.fleet import AtEnd, Fleet
from robochoc.vehicles.kinds import VehicleKind
from robochoc.vehicles.limits import END_S, LANDING_S, TURN_S
from robochoc.vehicles.messages import (
    End,
    FlightPhase,
    Fly,
    FromGuard,
    GuardEnded,
    GuardFailed,
    GuardSetup,
    NoRoutes,
    Permit,
    Recover,
    ToGuard,
    VehicleState,
    VehicleTarget,
    line_of,
)

SILENT_S = 20.0
"""The time without messages after which a guard counts as hanging: pilots may wait some seconds for an answer."""
START_S = 60.0
"""The longest time until the guard's first message: on a busy machine, starting the guard and its links is slow."""
_SPARE_S = 5.0
_UNWRITABLE = "/proc"
"""A folder in which not even root can create files."""
_SLICE_S = 0.2
_DONE = (FlightPhase.ARRIVED, FlightPhase.LANDED, FlightPhase.OUT)


class GuardError(RobochocError):
    """The guard process has ended or failed. The message describes what the vehicles will do."""


class GuardClient:
    """Starts a guard process for `fleet`, and ends it by `close`. The constructor and methods raise `GuardError`."""

    def __init__(self, fleet: Fleet) -> None:
        self.fleet = fleet
        self.states: dict[str, VehicleState] = {}
        """The newest state of each vehicle that has reported one."""
        self.observers: list[Callable[[VehicleState], None]] = []
        """Called with each state, in another thread."""
        self._order = 0
        self._orders: dict[str, int] = {}
        self._sent_s = -math.inf
        self._changed = threading.Condition()
        self._problem = self._no_ways = ""
        self._is_over = self._ends = self._has_ended = False
        self._received_s = time.monotonic()
        with signals_delayed():
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "robochoc.vehicles.guard"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=_environment(fleet.kind),
                start_new_session=True,  # not reached by Ctrl-C, or by the end of a terminal
            )
        self._reader = threading.Thread(target=self._read, daemon=True, name="reader of the guard")
        self._reader.start()
        try:
            self._send(GuardSetup(fleet))
        except GuardError:
            self._shut()
            raise

    def permit(self) -> None:
        """Permit arming."""
        self._send(Permit())

    def fly(self, targets: Mapping[str, VehicleTarget]) -> None:
        """Send vehicles to their targets, which replace earlier targets."""
        self._order += 1
        self._orders |= dict.fromkeys(targets, self._order)
        self._sent_s = time.monotonic()
        self._send(Fly(self._order, targets))

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """End all flights, and wait until each vehicle has obeyed; with `waits`, until landing vehicles are down.

        Vehicles that must land one after another, since one is above another's place, are waited for in any case.

        Raises:
            GuardError: The guard was lost; vehicles then follow their own failsafe.
        """
        self._ends = True
        with suppress(GuardError):
            self._send(End(how, waits))
        until = time.monotonic() + TURN_S + END_S + _SPARE_S + (LANDING_S if waits else 0.0)
        with self._changed:
            while not self._is_over and time.monotonic() < until:
                self._changed.wait(_SLICE_S)
        self._ends = self._has_ended
        if not self._has_ended:
            self._is_over = True
            self.check()

    def wait_for(self, condition: Callable[[], bool], within_s: float) -> bool:
        """Wait until the states meet `condition`; return whether they did in time."""
        until = time.monotonic() + within_s
        with self._changed:
            while not condition():
                self.check()
                left_s = until - time.monotonic()
                if left_s <= 0:
                    return False
                self._changed.wait(min(left_s, _SLICE_S))
        return True

    def check(self) -> None:
        """Raise `GuardError` if the guard has ended, hangs, or has refused a decision."""
        if self._no_ways:
            raise GuardError(f"the decision is not flown: {self._no_ways}")
        problem = self._problem
        if not problem and self._is_over and not self._ends:
            problem = "the guard process has ended"
        limit_s = SILENT_S if self.states else START_S
        if not problem and time.monotonic() - self._received_s > limit_s:
            problem = f"no message from the guard process for {limit_s:g} s"
        if problem:
            raise self._lost(problem)

    def _lost(self, problem: str) -> GuardError:
        return GuardError(f"{problem}; {self.fleet.kind.rules.alone}, until another guard reaches them")

    @property
    def is_flying(self) -> bool:
        """True if vehicles are on their way to their targets, within the time limit."""
        in_time = time.monotonic() - self._sent_s < self.fleet.time_s
        return in_time and not all(map(self.is_done, self._orders))

    def is_done(self, name: str) -> bool:
        """Return whether a vehicle has completed its newest order: it has arrived or landed, or is out of order."""
        state = self.states.get(name)
        return state is not None and state.phase in _DONE and state.order == self._orders.get(name)

    def close(self) -> None:
        """End the guard process, which ends all flights when its input ends.

        If the guard was lost, another guard ends the flights.
        """
        self._shut()
        if self._orders and not self._has_ended:
            flown = {name: link for name, link in self.fleet.vehicles.items() if name in self._orders}
            with suppress(GuardError):
                _recover(msgspec.structs.replace(self.fleet, vehicles=flown))

    def recover(self) -> None:
        """End the flights of vehicles left armed by another guard, and wait until these flights have ended."""
        self._ends = True
        self._send(Recover(self.fleet.end))
        until = time.monotonic() + self.fleet.connect_s + END_S + _SPARE_S
        with self._changed:
            while not self._is_over and time.monotonic() < until:
                self._changed.wait(_SLICE_S)

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
        """The process id."""
        return self._process.pid

    def _send(self, message: ToGuard) -> None:
        content = line_of(message)
        try:
            if self._process.stdin is None:
                raise BrokenPipeError
            os.write(self._process.stdin.fileno(), content)
        except (OSError, ValueError):
            self.check()  # a message from the guard may state the reason
            raise self._lost("the guard process has ended") from None  # the reader has not noticed it yet

    def _read(self) -> None:
        stdout = self._process.stdout
        for line in stdout or ():
            with suppress(msgspec.DecodeError):
                self._receive(msgspec.json.decode(line, type=FromGuard))
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def _receive(self, message: FromGuard) -> None:
        with self._changed:
            self._received_s = time.monotonic()
            match message:
                case VehicleState():
                    self.states[message.vehicle] = message
                case NoRoutes(why=why):
                    self._no_ways = self._no_ways or why
                case GuardFailed(why=why):
                    self._problem = self._problem or f"the guard process failed: {why}"
                case GuardEnded():
                    self._is_over = self._has_ended = True
            self._changed.notify_all()
        if isinstance(message, VehicleState):
            for observer in self.observers:
                observer(message)


def _recover(fleet: Fleet) -> None:
    guard = GuardClient(fleet)
    try:
        guard.recover()
    finally:
        guard.close()


def _environment(kind: VehicleKind) -> dict[str, str]:
    """Return environment variables for the guard with which MAVSDK writes no files, which would remain if killed.

    Such files are descriptions of cameras, for example. MAVSDK 4.1 continues without these files if no folder can be
    created, but ends if the temporary folder does not exist.
    """
    leaves_files = kind == VehicleKind.MAVLINK and Path(_UNWRITABLE).is_dir()
    nowhere = {"TMPDIR": _UNWRITABLE, "XDG_CACHE_HOME": _UNWRITABLE} if leaves_files else {}
    return {**os.environ, **nowhere}


shared: Shared[GuardClient] = Shared(GuardClient.close)
"""The guards of this process, by resolved path of the fleet file."""
