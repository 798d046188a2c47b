"""A pilot flies one vehicle: it takes up orders, watches what the vehicle does, and brings it to an end.

Pure but for its clock: an `Autopilot` takes the commands, and `step` is called several times a second. A vehicle that
does not do what it is told is `OUT`, for good: it lands where it is, and no further order is taken up. One that a
person has taken over by remote control gets no command any more, not even at the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from robochoc.flight.layout import Point
from robochoc.ros.autopilots.autopilot import MANUAL, OFFBOARD, Autopilot, RefusedError, Telemetry
from robochoc.ros.autopilots.fleet import AtEnd, Fleet, point_text
from robochoc.ros.autopilots.messages import Phase, State, Target

CLIMB_S = 30.0
"""The longest time of a take-off, in seconds."""
MODE_S = 3.0
"""The time within which a vehicle tells that it has changed its mode, in seconds: heartbeats come once a second."""
OUTSIDE_M = 1.0
"""A vehicle in the air may be that far out of the fence before it is made to land."""
RETRY_S = 0.5
"""The interval after which a command of the end is repeated that was refused, in seconds."""
END_S = 10.0
"""For so long commands of the end are repeated."""
LANDING_S = 90.0
"""The longest time of a landing that somebody waits for."""
_CLIMBED = 0.9
"""The part of a take-off's height from which on the vehicle is sent elsewhere."""


class Pilot:
    """Flies the vehicle `name` by `autopilot`, within the limits of `fleet`.

    Methods other than `step` only take note, and may be called by another thread.
    """

    ended: bool = False
    """True when the vehicle has been brought to an end: nothing more comes."""

    def __init__(
        self, name: str, autopilot: Autopilot, fleet: Fleet, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.name = name
        self._autopilot = autopilot
        self._fleet = fleet
        self._clock = clock
        self._begun_s = self._since_s = clock()
        self._phase = Phase.CONNECTING
        self._why = ""
        self._wanted: tuple[int, Target] | None = None
        self._order = 0
        self._target: Target | None = None
        self._climb_to = -math.inf
        self._commanded = self._hands_off = False
        self._ending: tuple[AtEnd, bool] | None = None
        self._end_begun_s = self._retry_s = -math.inf
        self._obeyed = self._was_armed = self._recovers = False

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
        seen = self._autopilot.look()
        self._was_armed = self._was_armed or (self._commanded and seen.armed)
        try:
            if self._recovers:
                self._recover(seen)
            elif self._ending:
                self._end(seen, *self._ending)
            elif self._phase is Phase.CONNECTING:
                self._connect(seen)
            elif self._phase is Phase.OUT:
                self._bring_down(seen)
            else:
                self._go_on(seen)
        except RefusedError as refused:
            self._out(str(refused))
        return State(
            self.name,
            self._phase,
            self._order,
            seen.place,
            seen.battery,
            seen.healthy,
            seen.in_air,
            self._commanded,
            self._why,
        )

    # On the way

    def _connect(self, seen: Telemetry) -> None:
        waited_s = self._clock() - self._begun_s
        if self._autopilot.connect() and seen.place is not None:
            self._enter(Phase.READY)
            return
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
            case Phase.FLYING | Phase.ARRIVED if new and wanted:
                self._head_for(seen, *wanted)
            case Phase.CLIMBING if seen.place and seen.place[2] >= self._climb_to:
                self._climbed(seen, passed_s)
            case Phase.CLIMBING if passed_s > CLIMB_S:
                self._out(f"it has not reached the height of its take-off within {CLIMB_S:g} s")
            case Phase.FLYING if self._is_there(seen):
                self._arrive()
            case Phase.LANDING if self._has_landed(seen):
                self._enter(Phase.LANDED)
            case _:
                pass

    def _set_out(self, seen: Telemetry, order: int, target: Target) -> None:
        """Take up an order on the ground, or of a vehicle that is in the air already."""
        self._order, self._target = order, target
        if seen.in_air:
            self._head_for(seen, order, target)
        elif target.lands:
            self._enter(Phase.LANDED)
        elif problem := self._not_ready(seen):
            self._out(problem)
        elif seen.place is not None:
            self._commanded = True
            self._climb_to = seen.place[2] + _CLIMBED * self._fleet.takeoff_m
            self._autopilot.arm()
            self._autopilot.take_off(self._fleet.takeoff_m)
            self._enter(Phase.CLIMBING)

    def _not_ready(self, seen: Telemetry) -> str:
        """Return why the vehicle cannot take off; empty if it can."""
        if not seen.healthy:
            return seen.problem or "its autopilot is not ready to arm"
        if seen.place is None or not self._fleet.fence.holds_above(seen.place):
            where = point_text(seen.place) if seen.place else "nowhere"
            return f"it stands at {where}, outside of the fence ({self._fleet.fence})"
        return ""

    def _climbed(self, seen: Telemetry, passed_s: float) -> None:
        """Go on from the take-off. Some autopilots refuse that at first."""
        order, target = self._wanted or (self._order, self._target)
        if target is None:
            return
        try:
            self._head_for(seen, order, target)
        except RefusedError:
            if passed_s > CLIMB_S:
                raise

    def _head_for(self, seen: Telemetry, order: int, target: Target) -> None:
        """Fly to `target`. Who lands there flies at its present height until it is above it.

        Who should land outside of the fence lands where it is.
        """
        self._order, self._target, self._commanded = order, target, True
        if target.lands and not self._fleet.fence.holds_above(target.at):
            self._autopilot.land()
            self._enter(Phase.LANDING)
        else:
            self._autopilot.go_to(self._above(seen, target))
            self._enter(Phase.FLYING)

    def _above(self, seen: Telemetry, target: Target) -> Point:
        if not target.lands or seen.place is None:
            return target.at
        fence = self._fleet.fence
        return (*target.at[:2], min(max(seen.place[2], fence.low[2]), fence.high[2]))

    def _is_there(self, seen: Telemetry) -> bool:
        if seen.place is None or self._target is None:
            return False
        at, place = self._target.at, seen.place
        if self._target.lands:
            at, place = (*at[:2], 0.0), (*place[:2], 0.0)
        return math.dist(at, place) <= self._fleet.near_m

    def _arrive(self) -> None:
        if self._target and self._target.lands:
            self._autopilot.land()
            self._enter(Phase.LANDING)
        else:
            self._enter(Phase.ARRIVED)

    def _trouble(self, seen: Telemetry) -> str:
        """Return what speaks against going on; empty if nothing does."""
        if seen.silent_s > self._fleet.patience_s:
            return f"its link has been silent for {self._fleet.patience_s:g} s"
        if self._phase in {Phase.READY, Phase.LANDED, Phase.LANDING}:
            return ""
        if seen.place and seen.in_air and not self._fleet.fence.holds_above(seen.place, OUTSIDE_M):
            return f"it has left the fence, at {point_text(seen.place)}"
        return self._mode_trouble(seen) if self._clock() - self._since_s > MODE_S else ""

    def _mode_trouble(self, seen: Telemetry) -> str:
        """Return what a vehicle does that should be in the air and follow us; empty if it does."""
        if not seen.armed:
            return "its motors have stopped"
        self._hands_off = seen.mode in MANUAL
        if self._hands_off or (self._phase is not Phase.CLIMBING and seen.mode != OFFBOARD):
            return f"it no longer follows set points: its mode is {seen.mode.lower()}"
        return ""

    def _has_landed(self, seen: Telemetry) -> bool:
        """Return whether the vehicle lies on the ground. One that was armed a moment ago may not have told it yet."""
        told = self._was_armed or self._clock() - self._since_s > MODE_S
        return told and not seen.armed and not seen.in_air

    def _enter(self, phase: Phase) -> None:
        self._phase, self._since_s = phase, self._clock()

    def _out(self, why: str) -> None:
        self._why = why
        if self._wanted:
            self._order = self._wanted[0]
        self._enter(Phase.OUT)

    # The end

    def _bring_down(self, seen: Telemetry) -> None:
        """Make a vehicle land that is out of order, as soon as it hears."""
        if self._wanted:
            self._order = self._wanted[0]
        if self._commanded and not self._obeyed:
            self._obeyed = self._is_brought_down(seen, AtEnd.LAND)

    def _recover(self, seen: Telemetry) -> None:
        """Find out whether the vehicle was left armed, once it is heard. One that a person flies is left alone."""
        waited_s = self._clock() - self._since_s
        if self._phase is Phase.CONNECTING:
            if self._autopilot.connect():
                self._enter(Phase.READY)
            else:
                self.ended = waited_s > (self._fleet.connect_s if seen.connecting else self._fleet.patience_s)
        elif seen.armed and seen.mode not in MANUAL:
            self._commanded, self._recovers = True, False
        else:
            self.ended = waited_s > MODE_S

    def _end(self, seen: Telemetry, how: AtEnd, waits: bool) -> None:  # noqa: FBT001 - one of two
        """Bring the vehicle to an end: it lands or holds, or was never commanded."""
        now = self._clock()
        if not math.isfinite(self._end_begun_s):
            self._end_begun_s = now
        passed_s = now - self._end_begun_s
        lies = self._phase is Phase.LANDED and not seen.in_air
        if not self._commanded or self._hands_off or lies:
            self.ended = True
        elif not self._obeyed:
            self._obeyed = self._is_brought_down(seen, how)
            if not self._obeyed and passed_s > END_S:
                self._why = self._why or f"it has not answered at the end, for {END_S:g} s"
                self._enter(Phase.OUT)
                self.ended = True
            elif self._obeyed and self._phase is not Phase.OUT:
                self._enter(Phase.LANDING if how is AtEnd.LAND else self._phase)
        elif how is AtEnd.HOLD or not waits:
            self.ended = True
        elif self._has_landed(seen):
            if self._phase is not Phase.OUT:
                self._enter(Phase.LANDED)
            self.ended = True
        elif passed_s > LANDING_S:
            self._why = self._why or f"it has not landed within {LANDING_S:g} s"
            self._enter(Phase.OUT)
            self.ended = True

    def _is_brought_down(self, seen: Telemetry, how: AtEnd) -> bool:
        """Return whether the vehicle has obeyed: it lands, holds, or is disarmed. A refused command is repeated."""
        now = self._clock()
        if self._hands_off:
            return True
        if now - self._retry_s < RETRY_S:
            return False
        self._retry_s = now
        try:
            if how is AtEnd.HOLD and seen.in_air:
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
