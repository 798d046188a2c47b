"""The guard: a process of its own that owns all links, and brings every vehicle to an end when its parent is gone.

Its standard input has orders, its standard output states (`messages.py`). When the input ends, when its parent has
died, or when it is told to end by SIGTERM, vehicles that were commanded land, or hold, as the fleet file says; then it
ends. Ctrl-C is left to the parent.

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
from robochoc.vehicles.kinds import Kind
from robochoc.vehicles.limits import END_S, TURN_S
from robochoc.vehicles.messages import (
    LINE_MAX,
    End,
    Ended,
    Failed,
    Fly,
    FromGuard,
    NoWays,
    Permit,
    Recover,
    Setup,
    State,
    ToGuard,
    line_of,
)
from robochoc.vehicles.pilot import Pilot
from robochoc.vehicles.route_planner import RouteError
from robochoc.vehicles.traffic import Traffic

STEP_S = 0.1
"""The time between two steps of a pilot, in seconds."""
TOLD_S = 0.25
"""The time between two states of a vehicle that does nothing new, in seconds."""
_ORDERS_MAX = 1 << 20
_SPARE_S = 20.0
"""Commands of the end may wait some seconds for their answers."""
Tell = Callable[[FromGuard], None]


class _Flight(threading.Thread):
    """A thread in which one pilot flies."""

    def __init__(self, name: str, autopilot: Autopilot, fleet: Fleet, traffic: Traffic, tell: Tell) -> None:
        super().__init__(name=f"pilot of {name}", daemon=True)
        self.pilot = Pilot(name, autopilot, fleet, traffic)
        self._autopilot = autopilot
        self._tell = tell

    def run(self) -> None:
        """Fly until all is over."""
        told, told_s = None, 0.0
        try:
            while not self.pilot.ended:
                state = self.pilot.step()
                now = time.monotonic()
                if self._news(state) != told or now - told_s >= TOLD_S or self.pilot.ended:
                    told, told_s = self._news(state), now
                    with suppress(Exception):  # what cannot be told is no reason to fly no longer
                        self._tell(state)
                time.sleep(STEP_S)
        finally:
            self._autopilot.close()

    @staticmethod
    def _news(state: State) -> tuple[object, ...]:
        return state.phase, state.order, state.why, state.waits_for


class Guard:
    """Owns the vehicles' links. `tell` takes what it has to say; `open_autopilot` opens a link by a vehicle's name."""

    def __init__(self, fleet: Fleet, open_autopilot: Callable[[str], Autopilot], tell: Tell) -> None:
        self.at_end = fleet.end
        self.end_s = fleet.connect_s + TURN_S + END_S + _SPARE_S
        """No vehicle takes longer to be brought to an end, unless its pilot hangs."""
        self._tell = tell
        self._permitted = False
        self._traffic = Traffic(fleet)
        self._flights = {
            name: _Flight(name, open_autopilot(name), fleet, self._traffic, tell) for name in fleet.vehicles
        }
        for flight in self._flights.values():
            flight.start()

    def take(self, order: ToGuard) -> None:
        """Obey an order. If that fails, all vehicles are brought to an end."""
        try:
            self._take(order)
        except Exception as error:  # noqa: BLE001 - the parent says it; nobody may be left in the air
            self.fail(error)

    def fail(self, error: Exception) -> None:
        """Say what has failed, and bring all vehicles to an end."""
        self._tell(Failed(f"{type(error).__name__}: {shortened(on_one_line(str(error)))}"))
        self.end(self.at_end, waits=False)

    def _take(self, order: ToGuard) -> None:
        match order:
            case Permit():
                self._permitted = True
            case Fly() if not self._permitted:
                self._tell(Failed("nothing may be armed: an order to fly came without a permit"))
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
            self._tell(NoWays(str(error)))
            return
        for name, target in order.targets.items():
            self._flights[name].pilot.fly(order.order, target)

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """Bring all vehicles to an end."""
        if how == AtEnd.LAND:
            with suppress(Exception):  # without a plan each lands where it is, after a while
                self._traffic.bring_down()
        for flight in self._flights.values():
            flight.pilot.end(how, waits=waits)

    @property
    def ended(self) -> bool:
        """Return whether all vehicles have been brought to an end."""
        return not self.hanging

    @property
    def hanging(self) -> list[str]:
        """Return the names of vehicles that have not been brought to an end yet."""
        return [name for name, flight in self._flights.items() if flight.is_alive()]


class Orders:
    """Orders from standard input. `over` is True when it has ended, or the parent has died."""

    def __init__(self) -> None:
        self._parent = os.getppid()
        self._buffer = b""
        self._lines: deque[bytes] = deque()
        self._is_closed = False

    @property
    def over(self) -> bool:
        """Robots' processes, too, may hold the other end of the pipe: so the parent itself counts."""
        return self._is_closed or os.getppid() != self._parent

    def next(self, wait_s: float) -> ToGuard | None:
        """Return the next order; None if none comes within `wait_s`. Raises `msgspec.DecodeError`."""
        if not self._lines and self._is_closed:
            time.sleep(wait_s)
        elif not self._lines and select.select([0], [], [], wait_s)[0]:
            chunk = os.read(0, _ORDERS_MAX)
            self._is_closed = not chunk
            *lines, self._buffer = (self._buffer + chunk).split(b"\n")
            self._lines.extend(lines)
        return msgspec.json.decode(self._lines.popleft(), type=ToGuard) if self._lines else None


class _Outlet:
    """Writes lines to what was standard output; MAVSDK writes a log there, which nobody reads, and cflib its warnings.

    It never waits for a parent that does not read: states are dropped then.
    """

    def __init__(self) -> None:
        self._descriptor = os.dup(1)
        os.set_blocking(self._descriptor, False)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)

    def tell(self, message: FromGuard) -> None:
        line = line_of(message)
        if len(line) > LINE_MAX:
            line = line_of(Failed("a message of the guard was too long"))
        try:
            os.write(self._descriptor, line)
        except OSError:  # full, or nobody is there any more
            return


def main() -> None:
    """Guard the vehicles of the fleet that standard input names."""
    told_to_end = threading.Event()
    signal.signal(signal.SIGTERM, lambda _number, _frame: told_to_end.set())
    for ignored in (signal.SIGINT, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(ignored, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    outlet, orders = _Outlet(), Orders()
    try:
        guard = _begun(orders, outlet.tell)
        if guard:
            watch(guard, orders, told_to_end)
            outlet.tell(Ended())
    except Exception as error:  # noqa: BLE001 - the parent says it
        outlet.tell(Failed(f"{type(error).__name__}: {error}"))


def _begun(orders: Orders, tell: Tell) -> Guard | None:
    """Return the guard of the fleet that is named first; None if the parent is gone before."""
    while not orders.over:
        order = orders.next(STEP_S)
        if isinstance(order, Setup):
            return _guard_of(order.fleet, tell)
    return None


def _guard_of(fleet: Fleet, tell: Tell) -> Guard:
    # Imported here: a library may be broken, and the parent says so.
    match fleet.kind:
        case Kind.MAVLINK:
            from robochoc.vehicles.mavsdk_autopilot import MavsdkAutopilot  # noqa: PLC0415

            return Guard(fleet, lambda name: MavsdkAutopilot(fleet.vehicles[name], fleet.origin), tell)
        case Kind.CRAZYFLIE:
            from robochoc.vehicles.cflib_autopilot import CflibAutopilot  # noqa: PLC0415

            return Guard(fleet, lambda name: CflibAutopilot(fleet.vehicles[name], fleet.speed_ms), tell)


def watch(guard: Guard, orders: Orders, told_to_end: threading.Event) -> None:
    """Obey orders until all is over; then bring all vehicles to an end. Raises `TimeoutError` if a pilot hangs.

    If the parent dies meanwhile, it is not waited for landings.
    """
    until = math.inf
    while not guard.ended:
        try:
            order = orders.next(STEP_S)
        except msgspec.DecodeError as error:
            guard.fail(error)
            continue
        if order is not None:
            guard.take(order)
        if until == math.inf and (orders.over or told_to_end.is_set()):
            until = time.monotonic() + guard.end_s
            guard.end(guard.at_end, waits=False)
        if time.monotonic() > until:
            raise TimeoutError(f"{', '.join(guard.hanging)}: not brought to an end within {guard.end_s:g} s")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # the threads of a library that hangs must not keep it
