"""Detects that a person or the vehicle's failsafe has taken over. The vehicle then gets no further command."""

from __future__ import annotations

import math
from collections.abc import Callable

from robochoc.vehicles.autopilot import Telemetry
from robochoc.vehicles.limits import MODE_S, SILENCE_S


class Takeover:
    """Monitors the modes of one vehicle from its first command on."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._commanded_s = self._foreign_s = math.inf
        self._silence_s = 0.0
        self._was_ours = self._is_taken = False

    def command(self) -> None:
        """Record that the vehicle has been commanded."""
        self._commanded_s = min(self._commanded_s, self._clock())

    def record(self, telemetry: Telemetry) -> None:
        """Record the telemetry of a commanded vehicle."""
        self._was_ours = self._was_ours or (telemetry.armed and not telemetry.is_flown_by_others)
        self._foreign_s = min(self._foreign_s, self._clock()) if telemetry.is_flown_by_others else math.inf
        self._silence_s = max(self._silence_s, telemetry.silent_s)

    @property
    def was_detected(self) -> bool:
        """Return whether a take-over was detected before."""
        return self._is_taken

    @property
    def lasts(self) -> bool:
        """True if another mode has lasted for some time: some autopilots report one briefly after a landing."""
        return self._clock() - self._foreign_s > MODE_S

    def detect(self, telemetry: Telemetry) -> bool:
        """Return whether the vehicle has been taken over, judged by all its telemetry.

        Until the vehicle has obeyed once, its mode may be the one from before its first command.
        """
        known = self._was_ours or self._clock() - self._commanded_s > MODE_S
        self._is_taken = self._is_taken or (known and telemetry.is_flown_by_others)
        return self._is_taken

    def is_deliberate(self) -> bool:
        """Return whether a vehicle has left our mode by the command of a person or its own failsafe.

        This is assumed unless the link was silent for a long time, since the vehicle may then have lacked set points.
        """
        self._is_taken = self._is_taken or self._silence_s <= SILENCE_S
        return self._is_taken
