"""A guard in a thread of this process, with played autopilots, in place of the process that `GuardClient` starts."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from io import FileIO

import msgspec

from robochoc.flight.layout import Point
from robochoc.vehicles.guard import Orders, VehicleGuard, serve_orders
from robochoc.vehicles.messages import FromGuard, GuardEnded, GuardSetup, ToGuard, line_of
from tests.support.limits import HANG_S
from tests.support.played_autopilot import GROUND, Played


class Flyer(Played):
    """A vehicle that starts at `place`, and lands and stops its motors as soon as it is told to land."""

    def __init__(self, place: Point) -> None:
        super().__init__()
        self.seen = replace(GROUND, place=place)
        self.battery_in_the_air = 1.0

    @property
    def place(self) -> Point:
        assert self.seen.place is not None
        return self.seen.place

    def take_off(self, height_m: float) -> None:
        x, y, z = self.place
        super().take_off(height_m)
        self.seen = replace(self.seen, place=(x, y, z + height_m), battery=self.battery_in_the_air)

    def land(self) -> None:
        self.take("land", mode="LAND", armed=False, in_air=False, place=(*self.place[:2], 0.0))


class GuardThread:
    """The side of `subprocess.Popen` that `GuardClient` uses. The thread ends when its orders end."""

    pid = 0

    def __init__(self, flyers: Mapping[str, Flyer]) -> None:
        self._flyers = flyers
        orders, orders_end = os.pipe()
        told, told_end = os.pipe()
        self.stdin = os.fdopen(orders_end, "wb", 0)
        self.stdout = os.fdopen(told, "rb")
        self._thread = threading.Thread(target=self._run, args=(orders, told_end), name="guard")
        self._thread.start()

    def wait(self, _timeout: float) -> None:
        self._thread.join(HANG_S)

    def _run(self, orders: int, told_end: int) -> None:
        lock = threading.Lock()
        with os.fdopen(orders, "rb", 0) as lines, os.fdopen(told_end, "wb", 0) as told:

            def tell(message: FromGuard) -> None:
                with lock:
                    told.write(line_of(message))

            setup = msgspec.json.decode(lines.readline(), type=ToGuard)
            assert isinstance(setup, GuardSetup)
            guard = VehicleGuard(setup.fleet, self._flyers.__getitem__, tell)
            serve_orders(guard, OrdersFrom(lines), threading.Event())
            tell(GuardEnded())


class OrdersFrom(Orders):
    """Orders from a pipe."""

    def __init__(self, lines: FileIO) -> None:
        self._pipe = lines
        self._has_ended = False

    @property
    def ended(self) -> bool:
        return self._has_ended

    def next(self, wait_s: float) -> ToGuard | None:
        if self._has_ended:
            time.sleep(wait_s)
        elif select.select([self._pipe], [], [], wait_s)[0]:
            line = self._pipe.readline()
            self._has_ended = not line
            return msgspec.json.decode(line, type=ToGuard) if line else None
        return None
