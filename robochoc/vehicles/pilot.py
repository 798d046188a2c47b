"""A pilot flies one vehicle: it follows orders, monitors the vehicle, and ends its flight.

`step` is called several times a second. It executes the first row of a transition table whose state, event and guard
hold. The tables are `FLIGHT` while the vehicle follows orders, `END` once the flight has to end, and `RECOVERY` after
another guard process was lost. They are at the end of the class, for reviews beside the firmware's documentation.

The only input besides the `Autopilot` is a clock. A vehicle that does not obey is permanently `OUT`: it lands in place,
and follows no further order. A vehicle that a person or its own failsafe has taken over gets no further command, not
even at the end. To keep vehicles apart, `Traffic` decides when the vehicle may take off, its set points, and when it
may land.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from typing import ClassVar, NamedTuple

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.vehicles.autopilot import OFFBOARD, Autopilot, RefusedError, Telemetry
from robochoc.vehicles.fleet import AtEnd, Fleet, point_text
from robochoc.vehicles.limits import (
    CLIMB_S,
    CLIMBED,
    END_S,
    GIVE_WAY_S,
    LANDING_S,
    MODE_S,
    OUTSIDE_M,
    RETRY_S,
    TURN_S,
)
from robochoc.vehicles.messages import FlightPhase, VehicleState, VehicleTarget
from robochoc.vehicles.takeover import Takeover
from robochoc.vehicles.traffic import Clearance, Traffic

_NOT_OURS = "it no longer follows set points: its mode is"

Condition = Callable[["Pilot", Telemetry], object]
"""An event or a guard, which holds if its result is true. If the result is a text, it is the reason for `OUT`."""
Action = Callable[["Pilot", Telemetry, str], object]
"""An action, called with the reason as the last argument. The state changes unless the action returns False."""


def _always(_pilot: Pilot, _telemetry: Telemetry) -> bool:
    return True


def _nothing(_pilot: Pilot, _telemetry: Telemetry, _reason: str) -> None:
    pass


class Transition(NamedTuple):
    """A row in a transition table."""

    name: str
    states: frozenset[FlightPhase]
    event: Condition
    guard: Condition = _always
    action: Action = _nothing
    next: FlightPhase | None = None
    """The next state; None: the state does not change."""
    ends: bool = False
    """True if this transition ends the flight."""


_ALL = frozenset(FlightPhase)
_CONNECTING, _READY, _CLIMBING = (
    frozenset({phase}) for phase in (FlightPhase.CONNECTING, FlightPhase.READY, FlightPhase.CLIMBING)
)
_FLYING, _ARRIVED, _LANDING = (
    frozenset({phase}) for phase in (FlightPhase.FLYING, FlightPhase.ARRIVED, FlightPhase.LANDING)
)
_LANDED, _OUT = (frozenset({phase}) for phase in (FlightPhase.LANDED, FlightPhase.OUT))
_GROUND = _READY | _LANDED
_WAY = _FLYING | _ARRIVED
_AIR = _CLIMBING | _WAY


class Pilot:
    """Flies the vehicle `name` with `autopilot`, within the limits in `fleet`.

    Methods other than `step` only store a request, and may be called from another thread.
    """

    ended: bool = False
    """True once the flight of the vehicle has ended."""

    def __init__(
        self,
        name: str,
        autopilot: Autopilot,
        fleet: Fleet,
        traffic: Traffic,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self._autopilot = autopilot
        self._fleet = fleet
        self._traffic = traffic
        self._clock = clock
        self._begun_s, self._since_s = math.inf, clock()
        self._phase = FlightPhase.CONNECTING
        self._why = ""
        self._requested: tuple[int, VehicleTarget] | None = None
        self._order = 0
        self._target: VehicleTarget | None = None
        self._climb_to = -math.inf
        self._commanded = False
        self._takeover = Takeover(clock)
        self._ending: tuple[AtEnd, bool] | None = None
        self._how, self._waits = AtEnd.LAND, False
        self._end_begun_s = self._turn_s = self._retry_s = -math.inf
        self._obeyed = self._was_armed = self._recovers = self._is_due = False
        self._telemetry = Telemetry()
        self._clearance = Clearance()
        self._sent: Clearance | None = None

    def fly(self, order: int, target: VehicleTarget) -> None:
        """Replace the order."""
        self._requested = order, target

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """Request the end of the flight. A second call can cancel the wait."""
        self._ending = how, waits

    def recover(self, how: AtEnd) -> None:
        """Request the end of a flight that was begun by a lost guard process, if the vehicle is armed."""
        self._recovers = True
        self._ending = how, False

    def step(self) -> VehicleState:
        """Execute the next transition, and return the state of the vehicle."""
        try:
            self._telemetry = self._autopilot.telemetry()
            self._react(self._telemetry)
        except Exception as error:  # noqa: BLE001 - no error may leave a vehicle in the air
            self._fail(f"its pilot failed: {type(error).__name__}: {shortened(on_one_line(str(error)))}")
        if self._commanded:
            self._takeover.command()
        telemetry = self._telemetry
        reported = telemetry.place, telemetry.battery, telemetry.healthy, telemetry.in_air
        return VehicleState(
            self.name, self._phase, self._order, *reported, self._commanded, self._why, self._clearance.waits_for
        )

    def _react(self, telemetry: Telemetry) -> None:
        """Record the telemetry, and execute the next transition."""
        self._was_armed = self._was_armed or (self._commanded and telemetry.armed)
        if self._commanded:
            self._takeover.record(telemetry)
        self._traffic.update_place(self.name, telemetry.place, in_air=telemetry.in_air)
        try:
            if self._recovers:
                self._run(self.RECOVERY, telemetry)
            elif self._ending:
                self._how, self._waits = self._ending
                if not math.isfinite(self._end_begun_s):
                    self._end_begun_s = self._turn_s = self._clock()
                self._run(self.END, telemetry)
            else:
                self._run(self.FLIGHT, telemetry)
        except RefusedError as refused:
            self._drop_out(telemetry, str(refused))

    def _run(self, table: tuple[Transition, ...], telemetry: Telemetry) -> None:
        """Execute the first applicable row in `table`. An event in adjacent rows is evaluated once."""
        event, found = None, None
        for row in table:
            if self._phase not in row.states:
                continue
            if row.event is not event:
                event, found = row.event, row.event(self, telemetry)
            if found and (reason := row.guard(self, telemetry)):
                text = next((text for text in (reason, found) if isinstance(text, str)), "")
                self._execute(row, telemetry, text)
                return

    def _execute(self, row: Transition, telemetry: Telemetry, reason: str) -> None:
        if row.action(self, telemetry, reason) is not False and row.next is not None:
            self._enter(row.next)
        self.ended = self.ended or row.ends

    def _enter(self, phase: FlightPhase) -> None:
        self._phase, self._since_s = phase, self._clock()

    def _fail(self, why: str) -> None:
        """Land a vehicle whose step has failed, possibly in `Traffic`, using its last telemetry."""
        with suppress(Exception):
            if self._phase != FlightPhase.OUT:
                self._drop_out(self._telemetry, why)
        with suppress(Exception):
            if self._commanded and not self._obeyed:
                self._obeyed = self._is_brought_down(self._telemetry, AtEnd.LAND)
        if self._ending:
            self._end_begun_s = max(self._end_begun_s, self._since_s)
            is_due = self._commanded or self._recovers
            self.ended = self._obeyed or not is_due or self._clock() - self._end_begun_s > END_S

    # Events of the link

    def _opens(self, _telemetry: Telemetry) -> bool:
        return self._autopilot.connect()

    def _connects(self, telemetry: Telemetry) -> bool:
        return self._autopilot.connect() and telemetry.place is not None

    def _connects_too_late(self, telemetry: Telemetry) -> str:
        self._begun_s = min(self._begun_s, self._clock())  # opening the link takes time as well
        limit_s = self._connect_limit_s(telemetry)
        if self._clock() - self._begun_s <= limit_s:
            return ""
        missing = "place reported" if telemetry.mode or telemetry.connecting else "message received"
        return f"no {missing} on {self._autopilot.url} within {limit_s:g} s"

    def _opens_too_late(self, telemetry: Telemetry) -> bool:
        return self._clock() - self._since_s > self._connect_limit_s(telemetry)

    def _connect_limit_s(self, telemetry: Telemetry) -> float:
        return self._fleet.connect_s if telemetry.connecting else self._fleet.patience_s

    def _is_silent(self, telemetry: Telemetry) -> str:
        limit_s = self._fleet.patience_s
        return f"its link has been silent for {limit_s:g} s" if telemetry.silent_s > limit_s else ""

    def _place_is_outdated(self, telemetry: Telemetry) -> str:
        limit_s = self._fleet.patience_s
        return f"no place reported for {limit_s:g} s" if telemetry.place_age_s > limit_s else ""

    # Events of the vehicle in the air

    def _is_taken_over(self, telemetry: Telemetry) -> str:
        return f"{_NOT_OURS} {telemetry.mode_and_pilot}" if self._takeover.detect(telemetry) else ""

    def _takeover_lasts(self, telemetry: Telemetry) -> str:
        """Check the duration, since a landing vehicle may report another mode for a moment."""
        return self._is_taken_over(telemetry) if self._takeover.lasts else ""

    def _alarm(self, telemetry: Telemetry) -> str:
        return telemetry.alarm

    def _leaves_fence(self, telemetry: Telemetry) -> str:
        if telemetry.place and telemetry.in_air and not self._fleet.fence.covers(telemetry.place, OUTSIDE_M):
            return f"it has left the fence, at {point_text(telemetry.place)}"
        return ""

    def _motors_stop(self, telemetry: Telemetry) -> str:
        """Check that telemetry arrives: without telemetry, MAVSDK reports that motors have stopped."""
        stopped = self._elapsed_s > MODE_S and not telemetry.armed and telemetry.has_heartbeat
        return "its motors have stopped" if stopped else ""

    def _leaves_mode(self, telemetry: Telemetry) -> str:
        if self._elapsed_s <= MODE_S or not telemetry.armed or telemetry.mode == OFFBOARD:
            return ""
        return f"{_NOT_OURS} {telemetry.mode_and_pilot if self._takeover.is_deliberate() else telemetry.mode_in_words}"

    def _reaches_height(self, telemetry: Telemetry) -> bool:
        if telemetry.place is None or telemetry.place[2] < self._climb_to:
            return False
        self._order, self._target = self._requested or (self._order, self._target)
        self._traffic.climbed(self.name)
        return True

    def _climbs_too_long(self, _telemetry: Telemetry) -> str:
        late = self._elapsed_s > CLIMB_S
        return f"it has not reached the height of its take-off within {CLIMB_S:g} s" if late else ""

    def _touches_down(self, telemetry: Telemetry) -> bool:
        """Allow some time, since a vehicle that was armed a moment ago may not have reported it yet."""
        known = self._was_armed or self._elapsed_s > MODE_S
        return known and telemetry.has_heartbeat and not telemetry.armed and not telemetry.in_air

    @property
    def _elapsed_s(self) -> float:
        """The time in the present state, in seconds."""
        return self._clock() - self._since_s

    # Events of orders

    def _gets_order(self, telemetry: Telemetry) -> bool:
        if self._requested is None or self._requested[0] == self._order:
            return False
        self._order, self._target = self._requested
        self._commanded = self._commanded or (telemetry.in_air and not telemetry.is_flown_by_others)
        return True

    def _waits_for_take_off(self, _telemetry: Telemetry) -> bool:
        return self._is_due

    def _must_come_down(self, _telemetry: Telemetry) -> bool:
        if self._requested:
            self._order = self._requested[0]
        return self._commanded and not self._obeyed

    # Guards

    def _flown_by_others(self, telemetry: Telemetry) -> str:
        return f"its mode is {telemetry.mode_and_pilot}" if telemetry.is_flown_by_others else ""

    def _may_land(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle may land, which is also possible in place outside the fence."""
        if not telemetry.in_air and self._phase in _GROUND:
            return False
        self._clearance = self._traffic.clearance(self.name)
        return self._clearance.lands

    def _in_air(self, telemetry: Telemetry) -> bool:
        return telemetry.in_air

    def _target_is_ground(self, _telemetry: Telemetry) -> bool:
        return self._target is not None and self._target.lands

    def _cannot_take_off(self, telemetry: Telemetry) -> str:
        if telemetry.not_ready:
            return telemetry.not_ready
        if telemetry.place is not None and self._fleet.fence.covers(telemetry.place):
            return ""
        where = point_text(telemetry.place) if telemetry.place else "an unknown place"
        return f"it is at {where}, outside the fence ({self._fleet.fence})"

    def _may_climb(self, telemetry: Telemetry) -> bool:
        self._clearance = self._traffic.clearance(self.name)
        return self._clearance.climbs and telemetry.place is not None

    def _makes_room(self, _telemetry: Telemetry) -> bool:
        return not self._clearance.rests

    def _is_there(self, telemetry: Telemetry) -> bool:
        if not self._clearance.rests or telemetry.place is None or self._target is None or self._target.lands:
            return False
        return math.dist(self._target.at, telemetry.place) <= self._fleet.near_m

    def _may_fall(self, _telemetry: Telemetry) -> bool:
        """Return whether no vehicle is directly below, or this vehicle has waited long enough."""
        return self._elapsed_s > GIVE_WAY_S or self._traffic.is_clear_below(self.name)

    # Actions

    def _drop_out(self, _telemetry: Telemetry, reason: str) -> None:
        self._why = reason
        if self._requested:
            self._order = self._requested[0]
        self._clearance = Clearance()
        self._enter(FlightPhase.OUT)  # before the call of `Traffic`, which may fail
        self._traffic.lose(self.name)

    def _land(self, _telemetry: Telemetry, _reason: str) -> None:
        self._commanded = True
        self._traffic.landing(self.name)
        self._autopilot.land()

    def _send_set_point(self, _telemetry: Telemetry, _reason: str) -> None:
        self._commanded = True
        to = self._clearance.to
        if to and (self._sent is None or to != self._sent.to):
            self._autopilot.go_to(to)
            self._sent = self._clearance

    def _leave_climb(self, telemetry: Telemetry, reason: str) -> bool:
        """Land or fly on; repeated, since some autopilots refuse commands until the take-off is complete."""
        try:
            (self._land if self._clearance.lands else self._send_set_point)(telemetry, reason)
        except RefusedError:
            if self._elapsed_s > CLIMB_S:
                raise
            return False
        return True

    def _take_off(self, telemetry: Telemetry, _reason: str) -> bool:
        self._wait_for_take_off(telemetry, "")
        self._commanded, self._is_due = True, False
        if telemetry.place is not None:
            self._climb_to = telemetry.place[2] + CLIMBED * self._fleet.takeoff_m
        self._traffic.climbing(self.name)
        self._autopilot.arm()
        if self._ending is not None:  # another thread may have requested the end while the motors started
            return False
        self._autopilot.take_off(self._fleet.takeoff_m)
        return True

    def _wait_for_take_off(self, _telemetry: Telemetry, _reason: str) -> None:
        self._is_due = True
        if self._phase != FlightPhase.READY:
            self._enter(FlightPhase.READY)

    def _report_landing(self, _telemetry: Telemetry, _reason: str) -> None:
        self._traffic.landed(self.name)

    def _come_down(self, telemetry: Telemetry, _reason: str) -> None:
        self._obeyed = self._is_brought_down(telemetry, AtEnd.LAND)

    # The end

    def _is_left_armed(self, telemetry: Telemetry) -> bool:
        return telemetry.armed and not telemetry.is_flown_by_others

    def _mode_is_known(self, _telemetry: Telemetry) -> bool:
        return self._elapsed_s > MODE_S

    def _begin_end(self, _telemetry: Telemetry, _reason: str) -> None:
        self._commanded, self._recovers = True, False

    def _has_obeyed(self, _telemetry: Telemetry) -> bool:
        return self._obeyed and not self._takeover.was_detected

    def _need_not_wait(self, _telemetry: Telemetry) -> bool:
        return not self._waits or self._how != AtEnd.LAND

    def _lands_too_long(self, _telemetry: Telemetry) -> str:
        late = self._clock() - self._end_begun_s > LANDING_S
        return f"it has not landed within {LANDING_S:g} s" if late else ""

    def _was_never_commanded(self, _telemetry: Telemetry) -> bool:
        return not self._commanded

    def _is_flown_by_others(self, telemetry: Telemetry) -> bool:
        return self._takeover.detect(telemetry)

    def _is_on_ground(self, telemetry: Telemetry) -> bool:
        return not telemetry.in_air

    def _must_wait_its_turn(self, telemetry: Telemetry) -> bool:
        return self._how == AtEnd.LAND and not self._is_my_turn(telemetry)

    def _obeys(self, telemetry: Telemetry) -> bool:
        """Send the command, and return whether it was accepted; a refused command is repeated."""
        self._obeyed = self._is_brought_down(telemetry, self._how)
        return self._obeyed

    def _lands_at_end(self, _telemetry: Telemetry) -> bool:
        return self._how == AtEnd.LAND

    def _refuses_too_long(self, _telemetry: Telemetry) -> str:
        late = self._clock() - self._end_begun_s > END_S
        return f"it has not accepted the final command within {END_S:g} s" if late else ""

    def _extend_end(self, _telemetry: Telemetry, _reason: str) -> None:
        self._end_begun_s = self._clock()

    def _report_descent(self, _telemetry: Telemetry, _reason: str) -> None:
        self._traffic.landing(self.name)

    def _give_up(self, _telemetry: Telemetry, reason: str) -> None:
        self._why = self._why or reason

    def _is_my_turn(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle may land now at the end; if not, send it to its landing place."""
        if not telemetry.in_air or self._phase == FlightPhase.LANDING or self._clock() - self._turn_s > TURN_S:
            return True
        if self._phase == FlightPhase.OUT:
            return self._may_fall(telemetry)
        self._clearance = self._traffic.clearance(self.name)
        if self._clearance.lands or self._clearance.to is None:
            return True
        try:
            self._send_set_point(telemetry, "")
        except RefusedError:
            return True
        return False

    def _is_brought_down(self, telemetry: Telemetry, how: AtEnd) -> bool:
        """Repeat the final command until it is accepted; return whether the vehicle lands, holds or is disarmed."""
        now = self._clock()
        if self._takeover.detect(telemetry):
            return True
        if now - self._retry_s < RETRY_S:
            return False
        self._retry_s = now
        try:
            if how == AtEnd.HOLD and telemetry.in_air:
                self._autopilot.hold()
            else:
                self._autopilot.land()
        except RefusedError:
            return self._is_disarmed(telemetry)
        return True

    def _is_disarmed(self, telemetry: Telemetry) -> bool:
        """Disarm the vehicle, which is refused in the air; return whether the vehicle is disarmed."""
        if telemetry.in_air:
            return False
        try:
            self._autopilot.disarm()
        except RefusedError:
            return False
        return True

    # The tables. Columns: name, states, event, guard, action, next state, whether the flight has ended.
    # fmt: off
    FLIGHT: ClassVar[tuple[Transition, ...]] = (
        Transition("connected", _CONNECTING, _connects, next=FlightPhase.READY),
        Transition("not connected", _CONNECTING, _connects_too_late, action=_drop_out, next=FlightPhase.OUT),
        Transition("silent", _GROUND | _AIR | _LANDING, _is_silent, action=_drop_out, next=FlightPhase.OUT),
        Transition("old place", _GROUND | _AIR | _LANDING, _place_is_outdated, action=_drop_out, next=FlightPhase.OUT),
        Transition("taken over", _AIR, _is_taken_over, action=_drop_out, next=FlightPhase.OUT),
        Transition("landing taken over", _LANDING, _takeover_lasts, action=_drop_out, next=FlightPhase.OUT),
        Transition("alarm", _AIR, _alarm, action=_drop_out, next=FlightPhase.OUT),
        Transition("fence left", _AIR, _leaves_fence, action=_drop_out, next=FlightPhase.OUT),
        Transition("motors stopped", _AIR, _motors_stop, action=_drop_out, next=FlightPhase.OUT),
        Transition("mode left", _WAY, _leaves_mode, action=_drop_out, next=FlightPhase.OUT),
        Transition("order, but flown by others", _GROUND, _gets_order, _flown_by_others, _drop_out, FlightPhase.OUT),
        Transition("order to land at once, in the air", _GROUND, _gets_order, _may_land, _land, FlightPhase.LANDING),
        Transition("order in the air", _GROUND, _gets_order, _in_air, _send_set_point, FlightPhase.FLYING),
        Transition("order to land, on the ground", _GROUND, _gets_order, _target_is_ground, next=FlightPhase.LANDED),
        Transition("order, but not ready", _GROUND, _gets_order, _cannot_take_off, _drop_out, FlightPhase.OUT),
        Transition("order to take off", _GROUND, _gets_order, _may_climb, _take_off, FlightPhase.CLIMBING),
        Transition("order to wait", _GROUND, _gets_order, action=_wait_for_take_off, next=FlightPhase.READY),
        Transition("take-off after a wait", _READY, _waits_for_take_off, _may_climb, _take_off, FlightPhase.CLIMBING),
        Transition("order to land at once", _WAY, _gets_order, _may_land, _land, FlightPhase.LANDING),
        Transition("order on the way", _WAY, _gets_order, action=_send_set_point, next=FlightPhase.FLYING),
        Transition("climbed, lands", _CLIMBING, _reaches_height, _may_land, _leave_climb, FlightPhase.LANDING),
        Transition("climbed", _CLIMBING, _reaches_height, action=_leave_climb, next=FlightPhase.FLYING),
        Transition("climb too long", _CLIMBING, _climbs_too_long, action=_drop_out, next=FlightPhase.OUT),
        Transition("landing", _WAY, _always, _may_land, _land, FlightPhase.LANDING),
        Transition("making room", _ARRIVED, _always, _makes_room, _send_set_point, FlightPhase.FLYING),
        Transition("arrived", _FLYING, _always, _is_there, _send_set_point, FlightPhase.ARRIVED),
        Transition("on the way", _WAY, _always, action=_send_set_point),
        Transition("landed", _LANDING, _touches_down, action=_report_landing, next=FlightPhase.LANDED),
        Transition("out of order", _OUT, _must_come_down, _may_fall, _come_down),
    )
    RECOVERY: ClassVar[tuple[Transition, ...]] = (
        Transition("recovery: link open", _CONNECTING, _opens, next=FlightPhase.READY),
        Transition("recovery: no link", _CONNECTING, _opens_too_late, ends=True),
        Transition("recovery: left armed", _ALL - _CONNECTING, _is_left_armed, action=_begin_end),
        Transition("recovery: not armed", _ALL - _CONNECTING, _mode_is_known, ends=True),
    )
    END: ClassVar[tuple[Transition, ...]] = (
        Transition("end: no wait", _ALL, _has_obeyed, _need_not_wait, ends=True),
        Transition(
            "end: landed", _ALL - _OUT, _has_obeyed, _touches_down, _report_landing, FlightPhase.LANDED, ends=True
        ),
        Transition("end: landed out of order", _OUT, _has_obeyed, _touches_down, ends=True),
        Transition("end: landing too long", _ALL, _has_obeyed, _lands_too_long, _give_up, FlightPhase.OUT, ends=True),
        Transition("end: landing", _ALL, _has_obeyed),
        Transition("end: never commanded", _ALL, _was_never_commanded, ends=True),
        Transition("end: flown by others", _ALL, _is_flown_by_others, ends=True),
        Transition("end: on the ground", _LANDED, _is_on_ground, ends=True),
        Transition("end: waiting its turn", _ALL, _must_wait_its_turn, action=_extend_end),
        Transition("end: commanded to land", _ALL - _OUT, _obeys, _lands_at_end, _report_descent, FlightPhase.LANDING),
        Transition(
            "end: commanded to land out of order", _OUT, _obeys, _lands_at_end, _report_descent, FlightPhase.OUT
        ),
        Transition("end: commanded to hold", _ALL, _obeys),
        Transition("end: refused too long", _ALL, _refuses_too_long, action=_give_up, next=FlightPhase.OUT, ends=True),
    )
    # fmt: on
