"""A pilot flies one vehicle: it follows orders, watches the vehicle, and ends its flight.

`step` is called several times a second. It executes the first row of a table whose state, event and guard hold:
`FLIGHT` while the vehicle follows orders, `END` once the flight has to end, `RECOVERY` after another guard was lost.
The tables are at the end of the class, to be reviewed beside the firmware's documentation.

The only input besides the `Autopilot` is a clock. A vehicle that does not obey is `OUT` for good: it lands where it is,
and follows no further order. A vehicle that a person or its own failsafe has taken over gets no further command, not
even at the end. `Traffic` decides when the vehicle may take off, its set points, and when it may land, so that vehicles
keep their distance.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from typing import ClassVar, NamedTuple

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.vehicles.autopilot import OFFBOARD, Autopilot, RefusedError, Telemetry
from robochoc.vehicles.craft import Clearance
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
from robochoc.vehicles.messages import Phase, State, Target
from robochoc.vehicles.takeover import Takeover
from robochoc.vehicles.traffic import Traffic

_NOT_OURS = "it no longer follows set points: its mode is"

Condition = Callable[["Pilot", Telemetry], object]
"""An event or a guard: it holds if its result is true. A text is the reason for which a vehicle is `OUT`."""
Action = Callable[["Pilot", Telemetry, str], object]
"""An action; its last argument is the reason. The state changes unless it returns False."""


def _always(_pilot: Pilot, _seen: Telemetry) -> bool:
    return True


def _nothing(_pilot: Pilot, _seen: Telemetry, _reason: str) -> None:
    pass


class Transition(NamedTuple):
    """A row of a table."""

    name: str
    states: frozenset[Phase]
    event: Condition
    guard: Condition = _always
    action: Action = _nothing
    next: Phase | None = None
    """The next state; None: the same."""
    ends: bool = False
    """True if nothing more follows."""


_ALL = frozenset(Phase)
_CONNECTING, _READY, _CLIMBING = (frozenset({phase}) for phase in (Phase.CONNECTING, Phase.READY, Phase.CLIMBING))
_FLYING, _ARRIVED, _LANDING = (frozenset({phase}) for phase in (Phase.FLYING, Phase.ARRIVED, Phase.LANDING))
_LANDED, _OUT = (frozenset({phase}) for phase in (Phase.LANDED, Phase.OUT))
_GROUND = _READY | _LANDED
_WAY = _FLYING | _ARRIVED
_AIR = _CLIMBING | _WAY


class Pilot:
    """Flies the vehicle `name` by `autopilot`, within the limits of `fleet`.

    Methods other than `step` only store a request, and may be called by another thread.
    """

    ended: bool = False
    """True once the flight of the vehicle has ended: nothing more follows."""

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
        self._phase = Phase.CONNECTING
        self._why = ""
        self._wanted: tuple[int, Target] | None = None
        self._order = 0
        self._target: Target | None = None
        self._climb_to = -math.inf
        self._commanded = False
        self._takeover = Takeover(clock)
        self._ending: tuple[AtEnd, bool] | None = None
        self._how, self._waits = AtEnd.LAND, False
        self._end_begun_s = self._turn_s = self._retry_s = -math.inf
        self._obeyed = self._was_armed = self._recovers = self._is_due = False
        self._seen = Telemetry()
        self._clearance = Clearance()
        self._sent: Clearance | None = None

    def fly(self, order: int, target: Target) -> None:
        """Replace the order by another."""
        self._wanted = order, target

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """Request the end of the flight. A second call may no longer wait."""
        self._ending = how, waits

    def recover(self, how: AtEnd) -> None:
        """Request the end of a flight that a lost guard has begun, if the vehicle is armed."""
        self._recovers = True
        self._ending = how, False

    def step(self) -> State:
        """Execute the next transition, and return the state of the vehicle."""
        try:
            self._seen = self._autopilot.telemetry()
            self._react(self._seen)
        except Exception as error:  # noqa: BLE001 - whatever it was, no vehicle may be left in the air
            self._fail(f"its pilot failed: {type(error).__name__}: {shortened(on_one_line(str(error)))}")
        if self._commanded:
            self._takeover.command()
        seen = self._seen
        told = seen.place, seen.battery, seen.healthy, seen.in_air
        return State(self.name, self._phase, self._order, *told, self._commanded, self._why, self._clearance.waits_for)

    def _react(self, seen: Telemetry) -> None:
        """Record the telemetry, and execute the next transition."""
        self._was_armed = self._was_armed or (self._commanded and seen.armed)
        if self._commanded:
            self._takeover.note(seen)
        self._traffic.see(self.name, seen.place, in_air=seen.in_air)
        try:
            if self._recovers:
                self._run(self.RECOVERY, seen)
            elif self._ending:
                self._how, self._waits = self._ending
                if not math.isfinite(self._end_begun_s):
                    self._end_begun_s = self._turn_s = self._clock()
                self._run(self.END, seen)
            else:
                self._run(self.FLIGHT, seen)
        except RefusedError as refused:
            self._drop_out(seen, str(refused))

    def _run(self, table: tuple[Transition, ...], seen: Telemetry) -> None:
        """Execute the first row of `table` that applies. The event of adjacent rows is evaluated once."""
        event, found = None, None
        for row in table:
            if self._phase not in row.states:
                continue
            if row.event is not event:
                event, found = row.event, row.event(self, seen)
            if found and (reason := row.guard(self, seen)):
                text = next((text for text in (reason, found) if isinstance(text, str)), "")
                self._execute(row, seen, text)
                return

    def _execute(self, row: Transition, seen: Telemetry, reason: str) -> None:
        if row.action(self, seen, reason) is not False and row.next is not None:
            self._enter(row.next)
        self.ended = self.ended or row.ends

    def _enter(self, phase: Phase) -> None:
        self._phase, self._since_s = phase, self._clock()

    def _fail(self, why: str) -> None:
        """Make a vehicle land whose step has failed, by its last telemetry. Traffic may be the cause of the failure."""
        with suppress(Exception):
            if self._phase != Phase.OUT:
                self._drop_out(self._seen, why)
        with suppress(Exception):
            if self._commanded and not self._obeyed:
                self._obeyed = self._is_brought_down(self._seen, AtEnd.LAND)
        if self._ending:
            self._end_begun_s = max(self._end_begun_s, self._since_s)
            is_due = self._commanded or self._recovers
            self.ended = self._obeyed or not is_due or self._clock() - self._end_begun_s > END_S

    # Events of the link

    def _opens(self, _seen: Telemetry) -> bool:
        return self._autopilot.connect()

    def _connects(self, seen: Telemetry) -> bool:
        return self._autopilot.connect() and seen.place is not None

    def _connects_too_late(self, seen: Telemetry) -> str:
        self._begun_s = min(self._begun_s, self._clock())  # opening the link takes time, too
        limit_s = self._connect_limit_s(seen)
        if self._clock() - self._begun_s <= limit_s:
            return ""
        missing = "has told no place" if seen.mode or seen.connecting else "is not heard"
        return f"it {missing} on {self._autopilot.url} within {limit_s:g} s"

    def _opens_too_late(self, seen: Telemetry) -> bool:
        return self._clock() - self._since_s > self._connect_limit_s(seen)

    def _connect_limit_s(self, seen: Telemetry) -> float:
        return self._fleet.connect_s if seen.connecting else self._fleet.patience_s

    def _is_silent(self, seen: Telemetry) -> str:
        limit_s = self._fleet.patience_s
        return f"its link has been silent for {limit_s:g} s" if seen.silent_s > limit_s else ""

    def _place_is_old(self, seen: Telemetry) -> str:
        limit_s = self._fleet.patience_s
        return f"it has not told its place for {limit_s:g} s" if seen.place_age_s > limit_s else ""

    # Events of the vehicle in the air

    def _is_taken_over(self, seen: Telemetry) -> str:
        return f"{_NOT_OURS} {seen.mode_and_who}" if self._takeover.has_come(seen) else ""

    def _takeover_lasts(self, seen: Telemetry) -> str:
        """A landing vehicle may report another mode for a moment."""
        return self._is_taken_over(seen) if self._takeover.lasts else ""

    def _alarm(self, seen: Telemetry) -> str:
        return seen.alarm

    def _leaves_fence(self, seen: Telemetry) -> str:
        if seen.place and seen.in_air and not self._fleet.fence.holds_above(seen.place, OUTSIDE_M):
            return f"it has left the fence, at {point_text(seen.place)}"
        return ""

    def _motors_stop(self, seen: Telemetry) -> str:
        """Without telemetry, MAVSDK reports that motors have stopped."""
        stopped = self._passed_s > MODE_S and not seen.armed and seen.is_heard
        return "its motors have stopped" if stopped else ""

    def _leaves_mode(self, seen: Telemetry) -> str:
        if self._passed_s <= MODE_S or not seen.armed or seen.mode == OFFBOARD:
            return ""
        return f"{_NOT_OURS} {seen.mode_and_who if self._takeover.has_left_us() else seen.mode_in_words}"

    def _reaches_height(self, seen: Telemetry) -> bool:
        if seen.place is None or seen.place[2] < self._climb_to:
            return False
        self._order, self._target = self._wanted or (self._order, self._target)
        self._traffic.climbed(self.name)
        return True

    def _climbs_too_long(self, _seen: Telemetry) -> str:
        late = self._passed_s > CLIMB_S
        return f"it has not reached the height of its take-off within {CLIMB_S:g} s" if late else ""

    def _touches_down(self, seen: Telemetry) -> bool:
        """A vehicle that was armed a moment ago may not have reported it yet."""
        known = self._was_armed or self._passed_s > MODE_S
        return known and seen.is_heard and not seen.armed and not seen.in_air

    @property
    def _passed_s(self) -> float:
        """Return the time in the present state, in seconds."""
        return self._clock() - self._since_s

    # Events of orders

    def _gets_order(self, seen: Telemetry) -> bool:
        if self._wanted is None or self._wanted[0] == self._order:
            return False
        self._order, self._target = self._wanted
        self._commanded = self._commanded or (seen.in_air and not seen.is_flown_by_others)
        return True

    def _waits_for_take_off(self, _seen: Telemetry) -> bool:
        return self._is_due

    def _must_come_down(self, _seen: Telemetry) -> bool:
        if self._wanted:
            self._order = self._wanted[0]
        return self._commanded and not self._obeyed

    # Guards

    def _flown_by_others(self, seen: Telemetry) -> str:
        return f"its mode is {seen.mode_and_who}" if seen.is_flown_by_others else ""

    def _may_land(self, seen: Telemetry) -> bool:
        """A clearance to land is also given outside of the fence, where the vehicle is."""
        if not seen.in_air and self._phase in _GROUND:
            return False
        self._clearance = self._traffic.clearance(self.name)
        return self._clearance.lands

    def _in_air(self, seen: Telemetry) -> bool:
        return seen.in_air

    def _target_is_ground(self, _seen: Telemetry) -> bool:
        return self._target is not None and self._target.lands

    def _cannot_take_off(self, seen: Telemetry) -> str:
        if seen.not_ready:
            return seen.not_ready
        if seen.place is not None and self._fleet.fence.holds_above(seen.place):
            return ""
        where = point_text(seen.place) if seen.place else "nowhere"
        return f"it stands at {where}, outside of the fence ({self._fleet.fence})"

    def _may_climb(self, seen: Telemetry) -> bool:
        self._clearance = self._traffic.clearance(self.name)
        return self._clearance.climbs and seen.place is not None

    def _makes_room(self, _seen: Telemetry) -> bool:
        return not self._clearance.rests

    def _is_there(self, seen: Telemetry) -> bool:
        if not self._clearance.rests or seen.place is None or self._target is None or self._target.lands:
            return False
        return math.dist(self._target.at, seen.place) <= self._fleet.near_m

    def _may_fall(self, _seen: Telemetry) -> bool:
        """No vehicle is right below, or this vehicle has waited long enough."""
        return self._passed_s > GIVE_WAY_S or self._traffic.is_clear_below(self.name)

    # Actions

    def _drop_out(self, _seen: Telemetry, reason: str) -> None:
        self._why = reason
        if self._wanted:
            self._order = self._wanted[0]
        self._clearance = Clearance()
        self._enter(Phase.OUT)  # before traffic, which may fail
        self._traffic.lose(self.name)

    def _land(self, _seen: Telemetry, _reason: str) -> None:
        self._commanded = True
        self._traffic.landing(self.name)
        self._autopilot.land()

    def _send_set_point(self, _seen: Telemetry, _reason: str) -> None:
        self._commanded = True
        to = self._clearance.to
        if to and (self._sent is None or to != self._sent.to):
            self._autopilot.go_to(to)
            self._sent = self._clearance

    def _leave_climb(self, seen: Telemetry, reason: str) -> bool:
        """Some autopilots refuse commands until the take-off is complete."""
        try:
            (self._land if self._clearance.lands else self._send_set_point)(seen, reason)
        except RefusedError:
            if self._passed_s > CLIMB_S:
                raise
            return False
        return True

    def _take_off(self, seen: Telemetry, _reason: str) -> bool:
        self._wait_for_take_off(seen, "")
        self._commanded, self._is_due = True, False
        if seen.place is not None:
            self._climb_to = seen.place[2] + CLIMBED * self._fleet.takeoff_m
        self._traffic.climbing(self.name)
        self._autopilot.arm()
        if self._ending is not None:  # another thread may have requested the end while the motors started
            return False
        self._autopilot.take_off(self._fleet.takeoff_m)
        return True

    def _wait_for_take_off(self, _seen: Telemetry, _reason: str) -> None:
        self._is_due = True
        if self._phase != Phase.READY:
            self._enter(Phase.READY)

    def _report_landing(self, _seen: Telemetry, _reason: str) -> None:
        self._traffic.landed(self.name)

    def _come_down(self, seen: Telemetry, _reason: str) -> None:
        self._obeyed = self._is_brought_down(seen, AtEnd.LAND)

    # The end

    def _is_left_armed(self, seen: Telemetry) -> bool:
        return seen.armed and not seen.is_flown_by_others

    def _mode_is_known(self, _seen: Telemetry) -> bool:
        return self._passed_s > MODE_S

    def _begin_end(self, _seen: Telemetry, _reason: str) -> None:
        self._commanded, self._recovers = True, False

    def _has_obeyed(self, _seen: Telemetry) -> bool:
        return self._obeyed and not self._takeover.is_known

    def _need_not_wait(self, _seen: Telemetry) -> bool:
        return not self._waits or self._how != AtEnd.LAND

    def _lands_too_long(self, _seen: Telemetry) -> str:
        late = self._clock() - self._end_begun_s > LANDING_S
        return f"it has not landed within {LANDING_S:g} s" if late else ""

    def _was_never_commanded(self, _seen: Telemetry) -> bool:
        return not self._commanded

    def _is_flown_by_others(self, seen: Telemetry) -> bool:
        return self._takeover.has_come(seen)

    def _is_on_ground(self, seen: Telemetry) -> bool:
        return not seen.in_air

    def _must_wait_its_turn(self, seen: Telemetry) -> bool:
        return self._how == AtEnd.LAND and not self._is_my_turn(seen)

    def _obeys(self, seen: Telemetry) -> bool:
        """The command is sent here: a refused command is repeated."""
        self._obeyed = self._is_brought_down(seen, self._how)
        return self._obeyed

    def _lands_at_end(self, _seen: Telemetry) -> bool:
        return self._how == AtEnd.LAND

    def _refuses_too_long(self, _seen: Telemetry) -> str:
        late = self._clock() - self._end_begun_s > END_S
        return f"it has not answered at the end, for {END_S:g} s" if late else ""

    def _extend_end(self, _seen: Telemetry, _reason: str) -> None:
        self._end_begun_s = self._clock()

    def _report_descent(self, _seen: Telemetry, _reason: str) -> None:
        self._traffic.landing(self.name)

    def _give_up(self, _seen: Telemetry, reason: str) -> None:
        self._why = self._why or reason

    def _is_my_turn(self, seen: Telemetry) -> bool:
        """Return whether a vehicle may land now at the end; if not, send it to the place where it may."""
        if not seen.in_air or self._phase == Phase.LANDING or self._clock() - self._turn_s > TURN_S:
            return True
        if self._phase == Phase.OUT:
            return self._may_fall(seen)
        self._clearance = self._traffic.clearance(self.name)
        if self._clearance.lands or self._clearance.to is None:
            return True
        try:
            self._send_set_point(seen, "")
        except RefusedError:
            return True
        return False

    def _is_brought_down(self, seen: Telemetry, how: AtEnd) -> bool:
        """Return whether the vehicle lands, holds or is disarmed, after a command. A refused command is repeated."""
        now = self._clock()
        if self._takeover.has_come(seen):
            return True
        if now - self._retry_s < RETRY_S:
            return False
        self._retry_s = now
        try:
            if how == AtEnd.HOLD and seen.in_air:
                self._autopilot.hold()
            else:
                self._autopilot.land()
        except RefusedError:
            return self._is_disarmed(seen)
        return True

    def _is_disarmed(self, seen: Telemetry) -> bool:
        """Return whether a vehicle on the ground was disarmed; a vehicle in the air refuses."""
        if seen.in_air:
            return False
        try:
            self._autopilot.disarm()
        except RefusedError:
            return False
        return True

    # The tables. Columns: name, states, event, guard, action, next state, whether nothing more follows.
    # fmt: off
    FLIGHT: ClassVar[tuple[Transition, ...]] = (
        Transition("connected", _CONNECTING, _connects, next=Phase.READY),
        Transition("not connected", _CONNECTING, _connects_too_late, action=_drop_out, next=Phase.OUT),
        Transition("silent", _GROUND | _AIR | _LANDING, _is_silent, action=_drop_out, next=Phase.OUT),
        Transition("old place", _GROUND | _AIR | _LANDING, _place_is_old, action=_drop_out, next=Phase.OUT),
        Transition("taken over", _AIR, _is_taken_over, action=_drop_out, next=Phase.OUT),
        Transition("landing taken over", _LANDING, _takeover_lasts, action=_drop_out, next=Phase.OUT),
        Transition("alarm", _AIR, _alarm, action=_drop_out, next=Phase.OUT),
        Transition("fence left", _AIR, _leaves_fence, action=_drop_out, next=Phase.OUT),
        Transition("motors stopped", _AIR, _motors_stop, action=_drop_out, next=Phase.OUT),
        Transition("mode left", _WAY, _leaves_mode, action=_drop_out, next=Phase.OUT),
        Transition("order, but flown by others", _GROUND, _gets_order, _flown_by_others, _drop_out, Phase.OUT),
        Transition("order to land at once, in the air", _GROUND, _gets_order, _may_land, _land, Phase.LANDING),
        Transition("order in the air", _GROUND, _gets_order, _in_air, _send_set_point, Phase.FLYING),
        Transition("order to land, on the ground", _GROUND, _gets_order, _target_is_ground, next=Phase.LANDED),
        Transition("order, but not ready", _GROUND, _gets_order, _cannot_take_off, _drop_out, Phase.OUT),
        Transition("order to take off", _GROUND, _gets_order, _may_climb, _take_off, Phase.CLIMBING),
        Transition("order to wait", _GROUND, _gets_order, action=_wait_for_take_off, next=Phase.READY),
        Transition("take-off after a wait", _READY, _waits_for_take_off, _may_climb, _take_off, Phase.CLIMBING),
        Transition("order to land at once", _WAY, _gets_order, _may_land, _land, Phase.LANDING),
        Transition("order on the way", _WAY, _gets_order, action=_send_set_point, next=Phase.FLYING),
        Transition("climbed, lands", _CLIMBING, _reaches_height, _may_land, _leave_climb, Phase.LANDING),
        Transition("climbed", _CLIMBING, _reaches_height, action=_leave_climb, next=Phase.FLYING),
        Transition("climb too long", _CLIMBING, _climbs_too_long, action=_drop_out, next=Phase.OUT),
        Transition("landing", _WAY, _always, _may_land, _land, Phase.LANDING),
        Transition("making room", _ARRIVED, _always, _makes_room, _send_set_point, Phase.FLYING),
        Transition("arrived", _FLYING, _always, _is_there, _send_set_point, Phase.ARRIVED),
        Transition("on the way", _WAY, _always, action=_send_set_point),
        Transition("landed", _LANDING, _touches_down, action=_report_landing, next=Phase.LANDED),
        Transition("out of order", _OUT, _must_come_down, _may_fall, _come_down),
    )
    RECOVERY: ClassVar[tuple[Transition, ...]] = (
        Transition("recovery: link open", _CONNECTING, _opens, next=Phase.READY),
        Transition("recovery: no link", _CONNECTING, _opens_too_late, ends=True),
        Transition("recovery: left armed", _ALL - _CONNECTING, _is_left_armed, action=_begin_end),
        Transition("recovery: not armed", _ALL - _CONNECTING, _mode_is_known, ends=True),
    )
    END: ClassVar[tuple[Transition, ...]] = (
        Transition("end: no wait", _ALL, _has_obeyed, _need_not_wait, ends=True),
        Transition("end: landed", _ALL - _OUT, _has_obeyed, _touches_down, _report_landing, Phase.LANDED, ends=True),
        Transition("end: landed out of order", _OUT, _has_obeyed, _touches_down, ends=True),
        Transition("end: landing too long", _ALL, _has_obeyed, _lands_too_long, _give_up, Phase.OUT, ends=True),
        Transition("end: landing", _ALL, _has_obeyed),
        Transition("end: never commanded", _ALL, _was_never_commanded, ends=True),
        Transition("end: flown by others", _ALL, _is_flown_by_others, ends=True),
        Transition("end: on the ground", _LANDED, _is_on_ground, ends=True),
        Transition("end: waiting its turn", _ALL, _must_wait_its_turn, action=_extend_end),
        Transition("end: told to land", _ALL - _OUT, _obeys, _lands_at_end, _report_descent, Phase.LANDING),
        Transition("end: told to land out of order", _OUT, _obeys, _lands_at_end, _report_descent, Phase.OUT),
        Transition("end: told to hold", _ALL, _obeys),
        Transition("end: refused too long", _ALL, _refuses_too_long, action=_give_up, next=Phase.OUT, ends=True),
    )
    # fmt: on
