"""The guard: a separate process that owns all links, and ends all flights when its parent process is gone.

The guard reads orders from standard input, and writes states to standard output (`messages.py`). When the input ends,
the parent has died, or SIGTERM arrives, commanded vehicles land or hold, as set in the fleet file, and the guard ends.
Only the parent handles Ctrl-C.

    python -m robochoc.vehicles.guard
"""

from __future__ import annotations

import math
import os
import select
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

import msgspec

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.vehicles.autopilot import Autopilot
from robochoc.vehicles.fleet import AtEnd, Fleet
from robochoc.vehicles.kinds import VehicleKind
from robochoc.vehicles.limits import END_S, TURN_S
from robochoc.vehicles.messages import (
    LINE_MAX,
    End,
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
    line_of,
)
from robochoc.vehicles.pilot import Pilot
from robochoc.vehicles.route_planner import RouteError
from robochoc.vehicles.traffic import Traffic

STEP_S = 0.1
"""The time between two steps of a pilot, in seconds."""
REPORT_S = 0.25
"""The time between two reports of an unchanged state, in seconds."""
_ORDERS_MAX = 1 << 20
_SPARE_S = 20.0
"""Additional time for ending all flights, in seconds: the final commands may wait some seconds for answers."""
Send = Callable[[FromGuard], None]


class _Flight(threading.Thread):
    """Runs one pilot in a thread."""

    def __init__(self, name: str, autopilot: Autopilot, fleet: Fleet, traffic: Traffic, send: Send) -> None:
        super().__init__(name=f"pilot of {name}", daemon=True)
        self.pilot = Pilot(name, autopilot, fleet, traffic)
        self._autopilot = autopilot
        self._send = send

    def run(self) -> None:
        """Fly until the flight has ended."""
        sent, sent_s = None, 0.0
        try:
            while not self.pilot.ended:
                state = self.pilot.step()
                now = time.monotonic()
                if self._reportable(state) != sent or now - sent_s >= REPORT_S or self.pilot.ended:
                    sent, sent_s = self._reportable(state), now
                    with suppress(Exception):  # the flight continues without reports
                        self._send(state)
                time.sleep(STEP_S)
        finally:
            self._autopilot.close()

    @staticmethod
    def _reportable(state: VehicleState) -> tuple[object, ...]:
        return state.phase, state.order, state.why, state.waits_for


class VehicleGuard:
    """Owns the vehicles' links. `send` sends a message to the parent; `open_autopilot` opens the link of a vehicle."""

    def __init__(self, fleet: Fleet, open_autopilot: Callable[[str], Autopilot], send: Send) -> None:
        self.at_end = fleet.end
        self.end_s = fleet.connect_s + TURN_S + END_S + _SPARE_S
        """The longest time for ending all flights, unless a pilot hangs."""
        self._send = send
        self._permitted = False
        self._traffic = Traffic(fleet)
        self._flights = {
            name: _Flight(name, open_autopilot(name), fleet, self._traffic, send) for name in fleet.vehicles
        }
        for flight in self._flights.values():
            flight.start()

    def obey(self, order: ToGuard) -> None:
        """Obey an order. If that fails, end all flights."""
        try:
            self._obey(order)
        except Exception as error:  # noqa: BLE001 - the parent reports the error; no vehicle may be left in the air
            self.fail(error)

    def fail(self, error: Exception) -> None:
        """Report a failure, and end all flights."""
        self._send(GuardFailed(f"{type(error).__name__}: {shortened(on_one_line(str(error)))}"))
        self.end(self.at_end, waits=False)

    def _obey(self, order: ToGuard) -> None:
        match order:
            case Permit():
                self._permitted = True
            case Fly() if not self._permitted:
                self._send(GuardFailed("arming is not permitted, but an order to fly was received"))
            case Fly():
                self._fly(order)
            case End():
                self.end(order.how, waits=order.waits)
            case Recover():
                for flight in self._flights.values():
                    flight.pilot.recover(order.how)
            case _:
                pass

    def _fly(self, order: Fly) -> None:
        try:
            self._traffic.fly(order.targets)
        except RouteError as error:
            self._send(NoRoutes(str(error)))
            return
        for name, target in order.targets.items():
            self._flights[name].pilot.fly(order.order, target)

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """End all flights."""
        if how == AtEnd.LAND:
            with suppress(Exception):  # without a plan each vehicle lands in place, after some time
                self._traffic.bring_down()
        for flight in self._flights.values():
            flight.pilot.end(how, waits=waits)

    @property
    def ended(self) -> bool:
        """True if all flights have ended."""
        return not self.hanging

    @property
    def hanging(self) -> list[str]:
        """The names of vehicles whose flights have not ended."""
        return [name for name, flight in self._flights.items() if flight.is_alive()]


class Orders:
    """Reads orders from standard input."""

    def __init__(self) -> None:
        self._parent = os.getppid()
        self._buffer = b""
        self._lines: deque[bytes] = deque()
        self._is_closed = False

    @property
    def ended(self) -> bool:
        """True if the input has ended or the parent has died; robots' processes may keep the pipe open after that."""
        return self._is_closed or os.getppid() != self._parent

    def next(self, wait_s: float) -> ToGuard | None:
        """Return the next order; None if none arrives within `wait_s`. Raises `msgspec.DecodeError`."""
        if not self._lines and self._is_closed:
            time.sleep(wait_s)
        elif not self._lines and select.select([0], [], [], wait_s)[0]:
            chunk = os.read(0, _ORDERS_MAX)
            self._is_closed = not chunk
            *lines, self._buffer = (self._buffer + chunk).split(b"\n")
            self._lines.extend(lines)
        return msgspec.json.decode(self._lines.popleft(), type=ToGuard) if self._lines else None


class _LineWriter:
    """Writes lines to the original standard output, while a new one discards MAVSDK's log and cflib's warnings.

    Writing never waits for a parent that does not read; states are dropped instead.
    """

    def __init__(self) -> None:
        self._descriptor = os.dup(1)
        os.set_blocking(self._descriptor, False)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)

    def send(self, message: FromGuard) -> None:
        line = line_of(message)
        if len(line) > LINE_MAX:
            line = line_of(GuardFailed("a message of the guard was too long"))
        try:
            os.write(self._descriptor, line)
        except OSError:  # the pipe is full, or closed
            return


def main() -> None:
    """Guard the vehicles of the fleet given on standard input."""
    terminated = threading.Event()
    signal.signal(signal.SIGTERM, lambda _number, _frame: terminated.set())
    for ignored in (signal.SIGINT, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(ignored, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    outlet, orders = _LineWriter(), Orders()
    try:
        guard = _wait_for_setup(orders, outlet.send)
        if guard:
            serve_orders(guard, orders, terminated)
            outlet.send(GuardEnded())
    except Exception as error:  # noqa: BLE001 - the parent reports it
        outlet.send(GuardFailed(f"{type(error).__name__}: {error}"))


def _wait_for_setup(orders: Orders, send: Send) -> VehicleGuard | None:
    """Return a guard for the fleet in the first `GuardSetup`; None if the parent ends before."""
    while not orders.ended:
        order = orders.next(STEP_S)
        if isinstance(order, GuardSetup):
            return _guard_of(order.fleet, send)
    return None


def _guard_of(fleet: Fleet, send: Send) -> VehicleGuard:
    # Imported here, so that the parent reports a broken library.
    match fleet.kind:
        case VehicleKind.MAVLINK:
            from robochoc.vehicles.mavsdk_autopilot import MavsdkAutopilot  # noqa: PLC0415

            return VehicleGuard(fleet, lambda name: MavsdkAutopilot(fleet.vehicles[name], fleet.origin), send)
        case VehicleKind.CRAZYFLIE:
            from robochoc.vehicles.cflib_autopilot import CflibAutopilot  # noqa: PLC0415

            return VehicleGuard(fleet, lambda name: CflibAutopilot(fleet.vehicles[name], fleet.speed_ms), send)


def serve_orders(guard: VehicleGuard, orders: Orders, terminated: threading.Event) -> None:
    """Execute orders until all flights have ended. If the parent process has died, end all flights.

    In that case, do not wait for landings.

    Raises:
        TimeoutError: if a pilot does not respond.
    """
    until = math.inf
    while not guard.ended:
        try:
            order = orders.next(STEP_S)
        except msgspec.DecodeError as error:
            guard.fail(error)
            continue
        if order is not None:
            guard.obey(order)
        if until == math.inf and (orders.ended or terminated.is_set()):
            until = time.monotonic() + guard.end_s
            guard.end(guard.at_end, waits=False)
        if time.monotonic() > until:
            raise TimeoutError(f"{', '.join(guard.hanging)}: the flight has not ended within {guard.end_s:g} s")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # hanging threads of a library must not keep the process alive
