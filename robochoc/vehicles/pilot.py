"""A pilot flies one vehicle: it takes up orders, watches what the vehicle does, and brings it to an end.

Pure but for its clock: an `Autopilot` takes the commands, and `step` is called several times a second. A vehicle that
does not do what it is told is `OUT`, for good: it lands where it is, and no further order is taken up. One that a
person has taken over, or its own failsafe, gets no command any more, not even at the end. `Traffic` says when it may
take off, which set points it may fly to, and when it may land, so that vehicles keep their distance.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress

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


class Pilot:
    """Flies the vehicle `name` by `autopilot`, within the limits of `fleet`.

    Methods other than `step` only take note, and may be called by another thread.
    """

    ended: bool = False
    """True when the vehicle has been brought to an end: nothing more comes."""

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
        self._end_begun_s = self._turn_s = self._retry_s = -math.inf
        self._obeyed = self._was_armed = self._recovers = self._is_due = False
        self._seen = Telemetry()
        self._clearance = Clearance()
        self._sent: Clearance | None = None

    def fly(self, order: int, target: Target) -> None:
        """Take note of an order, in place of the one before."""
        self._wanted = order, target

    def end(self, how: AtEnd, *, waits: bool) -> None:
        """Take note that all is over. A second call may no longer wait."""
        self._ending = how, waits

    def recover(self, how: AtEnd) -> None:
        """Take note that another guard was lost: what it has left armed is to be brought to an end."""
        self._recovers = True
        self._ending = how, False

    def step(self) -> State:
        """Do what is next, and return the state of the vehicle."""
        try:
            self._seen = self._autopilot.look()
            self._do(self._seen)
        except Exception as error:  # noqa: BLE001 - whatever it was, no vehicle may be left in the air
            self._fail(f"its pilot failed: {type(error).__name__}: {shortened(on_one_line(str(error)))}")
        if self._commanded:
            self._takeover.command()
        seen = self._seen
        told = seen.place, seen.battery, seen.healthy, seen.in_air
        return State(self.name, self._phase, self._order, *told, self._commanded, self._why, self._clearance.waits_for)

    def _do(self, seen: Telemetry) -> None:
        """Take note of what the vehicle tells, and do what is next."""
        self._was_armed = self._was_armed or (self._commanded and seen.armed)
        if self._commanded:
            self._takeover.note(seen)
        self._traffic.see(self.name, seen.place, in_air=seen.in_air)
        try:
            if self._recovers:
                self._recover(seen)
            elif self._ending:
                self._end(seen, *self._ending)
            elif self._phase == Phase.CONNECTING:
                self._connect(seen)
            elif self._phase == Phase.OUT:
                self._bring_down(seen)
            else:
                self._go_on(seen)
        except RefusedError as refused:
            self._out(str(refused))

    # On the way

    def _connect(self, seen: Telemetry) -> None:
        if self._autopilot.connect() and seen.place is not None:
            self._enter(Phase.READY)
            return
        self._begun_s = min(self._begun_s, self._clock())  # opening the link takes time, too
        waited_s = self._clock() - self._begun_s
        limit_s = self._fleet.connect_s if seen.connecting else self._fleet.patience_s
        if waited_s > limit_s:
            missing = "has told no place" if seen.mode or seen.connecting else "is not heard"
            self._out(f"it {missing} on {self._autopilot.url} within {limit_s:g} s")

    def _go_on(self, seen: Telemetry) -> None:
        if trouble := self._trouble(seen):
            self._out(trouble)
            return
        wanted = self._wanted
        new = wanted is not None and wanted[0] != self._order
        passed_s = self._clock() - self._since_s
        match self._phase:
            case Phase.READY | Phase.LANDED if new and wanted:
                self._set_out(seen, *wanted)
            case Phase.READY if self._is_due:
                self._rise(seen)
            case Phase.FLYING | Phase.ARRIVED if new and wanted:
                self._head_for(*wanted)
            case Phase.CLIMBING if seen.place and seen.place[2] >= self._climb_to:
                self._climbed(passed_s)
            case Phase.CLIMBING if passed_s > CLIMB_S:
                self._out(f"it has not reached the height of its take-off within {CLIMB_S:g} s")
            case Phase.FLYING | Phase.ARRIVED:
                self._follow()
                self._arrive(seen)
            case Phase.LANDING if self._has_landed(seen):
                self._touch_down()
            case _:
                pass

    def _set_out(self, seen: Telemetry, order: int, target: Target) -> None:
        """Take up an order on the ground, or of a vehicle that is in the air already."""
        self._order, self._target = order, target
        if seen.is_flown_by_others:
            self._out(f"its mode is {seen.mode_and_who}")
        elif seen.in_air:
            self._head_for(order, target)
        elif target.lands:
            self._enter(Phase.LANDED)
        elif problem := seen.not_ready or self._outside(seen):
            self._out(problem)
        else:
            self._is_due = True
            self._enter(Phase.READY)
            self._rise(seen)

    def _rise(self, seen: Telemetry) -> None:
        """Take off as soon as nobody is in the way."""
        self._clearance = self._traffic.clearance(self.name)
        if self._clearance.climbs and seen.place is not None:
            self._commanded, self._is_due = True, False
            self._climb_to = seen.place[2] + CLIMBED * self._fleet.takeoff_m
            self._traffic.climbing(self.name)
            self._autopilot.arm()
            if self._ending is None:  # the end may have come meanwhile
                self._autopilot.take_off(self._fleet.takeoff_m)
                self._enter(Phase.CLIMBING)

    def _outside(self, seen: Telemetry) -> str:
        """Return where the vehicle stands if it cannot take off there; empty if it can."""
        if seen.place is not None and self._fleet.fence.holds_above(seen.place):
            return ""
        where = point_text(seen.place) if seen.place else "nowhere"
        return f"it stands at {where}, outside of the fence ({self._fleet.fence})"

    def _climbed(self, passed_s: float) -> None:
        """Go on from the take-off. Some autopilots refuse that at first."""
        order, target = self._wanted or (self._order, self._target)
        if target is None:
            return
        self._traffic.climbed(self.name)
        try:
            self._head_for(order, target)
        except RefusedError:
            if passed_s > CLIMB_S:
                raise

    def _head_for(self, order: int, target: Target) -> None:
        """Set out for `target`. Who should land outside of the fence lands where it is."""
        self._order, self._target, self._commanded = order, target, True
        self._follow()
        if self._phase != Phase.LANDING:
            self._enter(Phase.FLYING)

    def _follow(self) -> None:
        """Send the set point that is due, or land where the way ends with that."""
        self._clearance = clearance = self._traffic.clearance(self.name)
        if clearance.lands:
            self._traffic.landing(self.name)
            self._autopilot.land()
            self._enter(Phase.LANDING)
        elif clearance.to and (self._sent is None or clearance.to != self._sent.to):
            self._autopilot.go_to(clearance.to)
            self._sent = clearance

    def _arrive(self, seen: Telemetry) -> None:
        """Take note that a vehicle is there, or that it has to make room once more."""
        if self._phase == Phase.ARRIVED and not self._clearance.rests:
            self._enter(Phase.FLYING)
        elif self._phase == Phase.FLYING and self._clearance.rests and self._is_there(seen):
            self._enter(Phase.ARRIVED)

    def _is_there(self, seen: Telemetry) -> bool:
        if seen.place is None or self._target is None or self._target.lands:
            return False
        return math.dist(self._target.at, seen.place) <= self._fleet.near_m

    def _touch_down(self) -> None:
        self._traffic.landed(self.name)
        self._enter(Phase.LANDED)

    def _trouble(self, seen: Telemetry) -> str:
        """Return what speaks against going on; empty if nothing does."""
        ages = (seen.silent_s, "its link has been silent"), (seen.place_age_s, "it has not told its place")
        if problems := [problem for age_s, problem in ages if age_s > self._fleet.patience_s]:
            return f"{problems[0]} for {self._fleet.patience_s:g} s"
        if self._phase in {Phase.READY, Phase.LANDED}:
            return ""
        lands = self._phase == Phase.LANDING
        if (not lands or self._takeover.lasts) and self._takeover.has_come(seen):
            return f"{_NOT_OURS} {seen.mode_and_who}"
        if lands or seen.alarm:
            return "" if lands else seen.alarm
        if seen.place and seen.in_air and not self._fleet.fence.holds_above(seen.place, OUTSIDE_M):
            return f"it has left the fence, at {point_text(seen.place)}"
        return self._mode_trouble(seen) if self._clock() - self._since_s > MODE_S else ""

    def _mode_trouble(self, seen: Telemetry) -> str:
        """Return what a vehicle does that should be in the air and follow us; empty if it does."""
        if not seen.armed:
            return "its motors have stopped" if seen.is_heard else ""
        if self._phase == Phase.CLIMBING or seen.mode == OFFBOARD:
            return ""
        return f"{_NOT_OURS} {seen.mode_and_who if self._takeover.has_left_us() else seen.mode_in_words}"

    def _has_landed(self, seen: Telemetry) -> bool:
        """Return whether the vehicle lies on the ground. One that was armed a moment ago may not have told it yet."""
        told = self._was_armed or self._clock() - self._since_s > MODE_S
        return told and seen.is_heard and not seen.armed and not seen.in_air

    def _enter(self, phase: Phase) -> None:
        self._phase, self._since_s = phase, self._clock()

    def _out(self, why: str) -> None:
        self._why = why
        if self._wanted:
            self._order = self._wanted[0]
        self._clearance = Clearance()
        self._enter(Phase.OUT)
        self._traffic.lose(self.name)

    def _fail(self, why: str) -> None:
        """Make a vehicle land whose step has failed. What it told last counts; traffic may be what has failed."""
        with suppress(Exception):
            if self._phase != Phase.OUT:
                self._out(why)
        with suppress(Exception):
            if self._commanded and not self._obeyed:
                self._obeyed = self._is_brought_down(self._seen, AtEnd.LAND)
        if self._ending:
            self._end_begun_s = max(self._end_begun_s, self._since_s)
            is_due = self._commanded or self._recovers
            self.ended = self._obeyed or not is_due or self._clock() - self._end_begun_s > END_S

    # The end

    def _bring_down(self, seen: Telemetry) -> None:
        """Make a vehicle land that is out of order, as soon as it hears."""
        if self._wanted:
            self._order = self._wanted[0]
        if self._commanded and not self._obeyed and self._may_fall():
            self._obeyed = self._is_brought_down(seen, AtEnd.LAND)

    def _may_fall(self) -> bool:
        """Return whether a vehicle that is out of order may land where it is: nobody is right below, or long enough."""
        return self._clock() - self._since_s > GIVE_WAY_S or self._traffic.is_clear_below(self.name)

    def _recover(self, seen: Telemetry) -> None:
        """Find out whether the vehicle was left armed, once it is heard. One that a person flies is left alone."""
        waited_s = self._clock() - self._since_s
        if self._phase == Phase.CONNECTING:
            if self._autopilot.connect():
                self._enter(Phase.READY)
            else:
                self.ended = waited_s > (self._fleet.connect_s if seen.connecting else self._fleet.patience_s)
        elif seen.armed and not seen.is_flown_by_others:
            self._commanded, self._recovers = True, False
        else:
            self.ended = waited_s > MODE_S

    def _end(self, seen: Telemetry, how: AtEnd, waits: bool) -> None:  # noqa: FBT001 - one of two
        """Bring the vehicle to an end: it lands or holds, or was never commanded."""
        now = self._clock()
        if not math.isfinite(self._end_begun_s):
            self._end_begun_s = self._turn_s = now
        lies = self._phase == Phase.LANDED and not seen.in_air
        if self._obeyed and not self._takeover.is_known:
            self._await_landing(seen, now, waits=waits and how == AtEnd.LAND)
        elif not self._commanded or self._takeover.has_come(seen) or lies:
            self.ended = True
        elif how == AtEnd.LAND and not self._is_my_turn(seen):
            self._end_begun_s = now
        elif self._is_brought_down(seen, how):
            self._obeyed = True
            if how == AtEnd.LAND:
                self._traffic.landing(self.name)
                self._enter(self._phase if self._phase == Phase.OUT else Phase.LANDING)
        elif now - self._end_begun_s > END_S:
            self._end_out(f"it has not answered at the end, for {END_S:g} s")

    def _await_landing(self, seen: Telemetry, now: float, *, waits: bool) -> None:
        if not waits:
            self.ended = True
        elif self._has_landed(seen):
            if self._phase != Phase.OUT:
                self._touch_down()
            self.ended = True
        elif now - self._end_begun_s > LANDING_S:
            self._end_out(f"it has not landed within {LANDING_S:g} s")

    def _end_out(self, why: str) -> None:
        self._why = self._why or why
        self._enter(Phase.OUT)
        self.ended = True

    def _is_my_turn(self, seen: Telemetry) -> bool:
        """Return whether a vehicle may land now at the end; if not, go on to where it may."""
        if not seen.in_air or self._phase == Phase.LANDING or self._clock() - self._turn_s > TURN_S:
            return True
        if self._phase == Phase.OUT:
            return self._may_fall()
        self._clearance = self._traffic.clearance(self.name)
        if self._clearance.lands or self._clearance.to is None:
            return True
        if self._sent is None or self._clearance.to != self._sent.to:
            try:
                self._autopilot.go_to(self._clearance.to)
            except RefusedError:
                return True
            self._sent = self._clearance
        return False

    def _is_brought_down(self, seen: Telemetry, how: AtEnd) -> bool:
        """Return whether the vehicle has obeyed: it lands, holds, or is disarmed. A refused command is repeated."""
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
        """Return whether a vehicle on the ground has been disarmed, which one in the air refuses."""
        if seen.in_air:
            return False
        try:
            self._autopilot.disarm()
        except RefusedError:
            return False
        return True
