"""Detects that a person or the vehicle's failsafe has taken over. The vehicle then gets no further command."""

from __future__ import annotations

import math
from collections.abc import Callable

from robochoc.vehicles.autopilot import Telemetry
from robochoc.vehicles.limits import MODE_S, SILENCE_S


class Takeover:
    """Watches the modes of one vehicle from its first command on."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._commanded_s = self._foreign_s = math.inf
        self._silence_s = 0.0
        self._was_ours = self._is_taken = False

    def command(self) -> None:
        """Record that the vehicle has been commanded."""
        self._commanded_s = min(self._commanded_s, self._clock())

    def note(self, seen: Telemetry) -> None:
        """Record the telemetry of a commanded vehicle."""
        self._was_ours = self._was_ours or (seen.armed and not seen.is_flown_by_others)
        self._foreign_s = min(self._foreign_s, self._clock()) if seen.is_flown_by_others else math.inf
        self._silence_s = max(self._silence_s, seen.silent_s)

    @property
    def is_known(self) -> bool:
        """Return whether a take-over was detected before."""
        return self._is_taken

    @property
    def lasts(self) -> bool:
        """Return whether another mode lasts longer than the moment for which some report it after a landing."""
        return self._clock() - self._foreign_s > MODE_S

    def has_come(self, seen: Telemetry) -> bool:
        """Return whether the vehicle was taken over, by its telemetry until now.

        Before it has obeyed once its mode may be that of before its first command.
        """
        told = self._was_ours or self._clock() - self._commanded_s > MODE_S
        self._is_taken = self._is_taken or (told and seen.is_flown_by_others)
        return self._is_taken

    def has_left_us(self) -> bool:
        """Return whether a vehicle that has left our mode was told to, by a person or by its own failsafe.

        It was if its link was good all the time. After a silence it may have done so for want of set points.
        """
        self._is_taken = self._is_taken or self._silence_s <= SILENCE_S
        return self._is_taken
