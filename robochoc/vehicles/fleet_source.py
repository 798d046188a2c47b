"""The base of the sources `mavlink:FILE` and `crazyflie:FILE`, which convert telemetry to reports of drones.

Poses and battery charges are reported as they arrive. A vehicle that is out of order, for any reason, is reported once.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.inbox import MessageInbox
from robochoc.robots.sink import Fields
from robochoc.robots.source import REPORTS, ReceivedMessage, Source, SourceError
from robochoc.system.files import resolved
from robochoc.vehicles.fleet import FleetError, read_fleet
from robochoc.vehicles.guard_client import GuardClient, GuardError, shared
from robochoc.vehicles.kinds import VehicleKind
from robochoc.vehicles.messages import FlightPhase, VehicleState

_SLICE_S = 0.2
_CHARGE = 0.01
"""Smaller changes of the charge since the last report are not reported."""


class FleetSource(Source):
    """Reads reports of the vehicles in a fleet file. A source and a sink with the same file share the links."""

    kind: ClassVar[VehicleKind]
    """The kind of vehicles, set by subclasses."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._path = Path(place)
        try:
            self._fleet = read_fleet(self._path, self.kind)
            self._guard = shared.enter(resolved(self._path), lambda: GuardClient(self._fleet))
        except (FleetError, GuardError) as error:
            raise SourceError(str(error)) from error
        self._namespaces: Mapping[str, str] = {}
        self._topics: Mapping[str, str] = {}
        self._is_closed = False
        self._charges: dict[str, float] = {}
        self._out: set[str] = set()
        self._inbox = MessageInbox()

    @property
    def is_busy(self) -> bool:
        """True if vehicles are still flying the newest decision."""
        return self._guard.is_flying

    def assign(self, namespaces: Mapping[str, str]) -> None:
        """Store the drones' namespaces. Each vehicle needs a namespace."""
        strange = [name for name in self._fleet.vehicles if name not in namespaces]
        if strange:
            known = ", ".join(namespaces)
            problem = f"{self._path}: no drone is called {strange[0]}; the team's drones are {known}"
            raise SourceError(on_one_line(problem))
        self._namespaces = namespaces

    def listen(self, topics: Mapping[str, str]) -> None:
        """Report on `topics` from now on."""
        self._topics = topics
        if self._report_state not in self._guard.observers:
            self._guard.observers.append(self._report_state)

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """Return the oldest report; None if none arrives within `wait_s`."""
        until = time.monotonic() + wait_s
        while True:
            left_s = until - time.monotonic()
            found = self._inbox.get(min(max(left_s, 0), _SLICE_S))
            if found or left_s <= 0:
                return found
            try:
                self._guard.check()
            except GuardError as error:
                raise SourceError(str(error)) from error

    def close(self) -> None:
        """Release the vehicles; the last user ends their flights."""
        if not self._is_closed:
            self._is_closed = True
            if self._report_state in self._guard.observers:
                self._guard.observers.remove(self._report_state)
            shared.leave(resolved(self._path))

    def _report_state(self, state: VehicleState) -> None:
        """Report a state; called in the thread that reads from the guard."""
        name = state.vehicle
        if state.place is not None:
            x, y, z = state.place
            self._put(name, "pose", {"pose": {"position": {"x": x, "y": y, "z": z}, "orientation": {"w": 1.0}}})
        if state.battery is not None and abs(state.battery - self._charges.get(name, -1.0)) >= _CHARGE:
            self._charges[name] = state.battery
            self._put(name, "battery", {"percentage": state.battery, "present": True})
        if state.phase == FlightPhase.OUT and name not in self._out:
            self._out.add(name)
            self._put(name, "out_of_order", {"data": state.why})

    def _put(self, name: str, token: str, fields: Fields) -> None:
        topic = f"{self._namespaces.get(name, '')}/{token}"
        if topic in self._topics:
            self._inbox.put(ReceivedMessage(topic, REPORTS[token], fields, time.time_ns()))
