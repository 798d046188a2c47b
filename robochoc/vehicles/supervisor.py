"""The state that the supervisor of a Crazyflie's firmware tells: the bits of its log variable `supervisor.info`.

Source: the firmware's supervisor.c.
"""

from __future__ import annotations

from dataclasses import dataclass

from robochoc.vehicles.autopilot import OFFBOARD

CAN_ARM, IS_ARMED, ARMS_ITSELF, CAN_FLY, FLIES, TUMBLED, LOCKED, CRASHED = (1 << bit for bit in range(8))
COMMANDS, FINISHED, DECK_FAULT = 1 << 8, 1 << 9, 1 << 11
MANUAL = "MANUAL"
_PROBLEMS = {
    LOCKED: "it is locked: restart it",
    CRASHED: "it has crashed: put it on its feet and restart it",
    TUMBLED: "it does not stand upright",
    DECK_FAULT: "a deck of it has a fault",
}


@dataclass(frozen=True)
class Supervisor:
    """The state of a Crazyflie, by the bits that it tells."""

    bits: int

    def _has(self, bit: int) -> bool:
        return bool(self.bits & bit)

    @property
    def arms_itself(self) -> bool:
        """Return whether motors are armed all the time, as those with brushes are."""
        return self._has(ARMS_ITSELF)

    @property
    def can_fly(self) -> bool:
        """Return whether commands to fly are taken up."""
        return self._has(CAN_FLY)

    @property
    def flies(self) -> bool:
        """Return whether motors have had thrust, within the last 2 s."""
        return self._has(FLIES)

    @property
    def commands(self) -> bool:
        """Return whether the high-level commander flies it."""
        return self._has(COMMANDS)

    @property
    def finished(self) -> bool:
        """Return whether the high-level commander has come to the end of its path."""
        return self._has(FINISHED)

    @property
    def armed(self) -> bool:
        """Return whether motors run, or may be made to run by us alone."""
        return self.flies or self.commands or (self._has(IS_ARMED) and not self.arms_itself)

    @property
    def mode(self) -> str:
        """Return who flies, in a word of autopilots.

        In the air without the high-level commander, somebody else sends set points: without any, it would fall.
        """
        if self.commands:
            return OFFBOARD
        return MANUAL if self.flies else "STANDBY"

    @property
    def problem(self) -> str:
        """Return why it cannot be armed; empty if it can be, or is."""
        for bit, problem in _PROBLEMS.items():
            if self._has(bit):
                return problem
        return "" if self.bits & (CAN_ARM | IS_ARMED | CAN_FLY) else "its autopilot is not ready to arm"
