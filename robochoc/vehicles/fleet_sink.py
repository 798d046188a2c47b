"""The base of the sinks `mavlink:FILE` and `crazyflie:FILE`, which fly decisions with the vehicles in a fleet file.

Without permission to arm, a sink checks links, vehicles and the fence, but sends no commands.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import combinations
from pathlib import Path
from typing import ClassVar

from robochoc.flight.mission import Drone
from robochoc.formats.diagnostics import on_one_line
from robochoc.maps.routes.distances import SLACK_M
from robochoc.robots.sink import Fields, Sink, SinkError, Waypoint
from robochoc.system.files import resolved
from robochoc.vehicles.fleet import AtEnd, FleetError, point_text, read_fleet
from robochoc.vehicles.guard_client import START_S, GuardClient, GuardError, shared
from robochoc.vehicles.kinds import VehicleKind
from robochoc.vehicles.messages import FlightPhase, VehicleState, VehicleTarget
from robochoc.vehicles.route_planner import spacing


class FleetSink(Sink):
    """Flies decisions, and waits until vehicles have arrived, unless a source receives their reports."""

    kind: ClassVar[VehicleKind]
    """The kind of vehicles, set by subclasses."""
    arms = True

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._path = Path(place)
        with _as_sink_errors():
            self._fleet = read_fleet(self._path, self.kind)
            self._guard = shared.enter(resolved(self._path), lambda: GuardClient(self._fleet))
        self._names: dict[int, str] = {}
        self._may_arm = self._is_closed = False
        self._flown: set[str] = set()

    def allow_arming(self) -> None:
        """Permit arming."""
        with _as_sink_errors():
            self._guard.permit()
        self._may_arm = True

    def assign(self, drones: Sequence[Drone]) -> None:
        """Check that drones and vehicles match, and wait until all vehicles are connected."""
        self._names = {number: drone.name for number, drone in enumerate(drones)}
        doubled = [name for name, count in Counter(self._names.values()).items() if count > 1]
        missing = [
            *dict.fromkeys(drone.name for drone in drones if drone.topic and drone.name not in self._fleet.vehicles)
        ]
        strange = [name for name in self._fleet.vehicles if name not in self._names.values()]
        if doubled:
            raise self._error(f"two drones are called {doubled[0]}", "each drone needs its own vehicle")
        if missing:
            nobodys = f"no drone is called {strange[0]}" if strange else "each drone with a topic needs one"
            raise self._error(f"there is no vehicle for {missing[0]}", nobodys)
        if strange:
            known = ", ".join(self._names.values())
            raise self._error(f"no drone is called {strange[0]}", f"the team's drones are {known}")
        self._await_vehicles()

    def decide(self, waypoints: Sequence[Waypoint]) -> None:
        """Fly a decision. No vehicle is armed if a place is outside the fence, or two places are too near.

        Landing points may be outside; pilots then land elsewhere.
        """
        fence = self._fleet.fence
        for one in waypoints:
            if not one.lands and not fence.contains(one.at):
                problem = f"the waypoint of {self._names[one.drone]}, {point_text(one.at)}, is outside the fence"
                raise self._error(problem, f"the fence is from {fence}; the decision is not flown")
        self._check_distances([one for one in waypoints if not one.lands])
        targets = {self._names[one.drone]: VehicleTarget(one.at, one.lands) for one in waypoints}
        if not self._may_arm or not targets:
            return
        self._flown |= {name for name, target in targets.items() if not target.lands}
        with _as_sink_errors():
            self._guard.fly(targets)
            if not self._guard.observers:
                self._await_arrival(targets)

    def _check_distances(self, waypoints: Sequence[Waypoint]) -> None:
        least, downwash = self._fleet.distance_m, self._fleet.downwash
        for first, second in combinations(waypoints, 2):
            near = spacing([first.at, second.at], downwash)
            if near < least - SLACK_M:
                names = f"{self._names[first.drone]} and {self._names[second.drone]}"
                flat = f", heights divided by {downwash:g}" if downwash != 1 else ""
                problem = f"the waypoints of {names} are {near:.2f} m apart{flat}"
                raise self._error(problem, f"'distance' is {least:g} m; the decision is not flown")

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Do nothing, since `decide` flies waypoints, and vehicles send their own reports."""

    def close(self) -> None:
        """Wait until all vehicles have arrived; then make them land, or hold."""
        try:
            with _as_sink_errors():
                if self._may_arm and self._guard.observers:
                    self._guard.wait_for(lambda: not self._guard.is_flying, self._fleet.time_s)
            self._end(waits=True)
        finally:
            self._leave()

    def discard(self) -> None:
        """Make all vehicles land, or hold, at once. A failure is not reported: another error is already raised."""
        try:
            with suppress(SinkError):
                self._end(waits=False)
        finally:
            self._leave()

    def _end(self, *, waits: bool) -> None:
        if self._is_closed:
            return
        with _as_sink_errors():
            self._guard.end(self._fleet.end, waits=waits)
        self.summary = self._result_text()

    def _leave(self) -> None:
        if not self._is_closed:
            self._is_closed = True
            shared.leave(resolved(self._path))

    # Waiting

    def _await_vehicles(self) -> None:
        guard, names = self._guard, [*self._fleet.vehicles]

        def is_known(name: str) -> bool:
            return name in guard.states and guard.states[name].phase != FlightPhase.CONNECTING

        with _as_sink_errors():
            guard.wait_for(lambda: all(map(is_known, names)), self._fleet.connect_s + START_S)
        missing = [name for name in names if not is_known(name) or guard.states[name].phase == FlightPhase.OUT]
        if missing:
            state = guard.states.get(missing[0])
            why = state.why if state and state.why else "it has reported no state"
            others = f"; {', '.join(missing[1:])} cannot fly either" if missing[1:] else ""
            raise self._error(f"{missing[0]} cannot fly: {why}{others}", "nothing was armed")
        for name in names:
            state = guard.states[name]
            if self._may_arm and state.place and not state.in_air and not self._fleet.fence.covers(state.place):
                where = f"{name} is at {point_text(state.place)}, outside the fence"
                raise self._error(where, f"the fence is from {self._fleet.fence}; nothing was armed")

    def _await_arrival(self, names: Iterable[str]) -> None:
        """Wait until all have arrived. A vehicle out of order ends the run, since no source reports it to the team."""
        sent = [*names]
        self._guard.wait_for(
            lambda: all(map(self._guard.is_done, sent)) or any(self._out_of_order(sent)), self._fleet.time_s
        )
        fallen = [*self._out_of_order(sent)]
        if fallen:
            raise self._error(f"{fallen[0].vehicle} is out of order: {fallen[0].why}", "the others are brought down")
        late = [name for name in sent if not self._guard.is_done(name)]
        if late:
            state = self._guard.states.get(late[0])
            waits = f"; it waits for {state.waits_for}" if state and state.waits_for else ""
            problem = f"{late[0]} has not arrived after {self._fleet.time_s:g} s{waits}"
            raise self._error(problem, "increase 'time' in the fleet file, or shorten the flight")

    def _out_of_order(self, names: Iterable[str]) -> Iterator[VehicleState]:
        for name in names:
            state = self._guard.states.get(name)
            if state is not None and state.phase == FlightPhase.OUT:
                yield state

    def _result_text(self) -> str:
        """Return a summary of the flights, in one line."""
        if not self._may_arm:
            return f"{len(self._fleet.vehicles)} vehicles seen, none armed (--arm lets them fly)"
        states = [self._guard.states[name] for name in sorted(self._flown) if name in self._guard.states]
        ended = sum(state.phase == FlightPhase.LANDED for state in states)
        words = [f"{len(self._flown)} flown"]
        words.append(f"{ended} landed" if self._fleet.end == AtEnd.LAND else f"{len(states) - ended} hold")
        words += [f"{state.vehicle} is out of order: {state.why}" for state in states if state.phase == FlightPhase.OUT]
        return on_one_line(", ".join(words))

    def _error(self, problem: str, hint: str) -> SinkError:
        return SinkError(on_one_line(f"{self._path}: {problem}; {hint}"))


@contextmanager
def _as_sink_errors() -> Iterator[None]:
    """Convert errors in the fleet file and errors of the guard to `SinkError`."""
    try:
        yield
    except (FleetError, GuardError) as error:
        raise SinkError(str(error)) from error
