"""The state reported by the supervisor in a Crazyflie's firmware, from the bits of its log variable `supervisor.info`.

Source: the firmware's supervisor.c. Separate from `cflib_autopilot.py`, which needs cflib.
"""

from __future__ import annotations

from robochoc.system.lazy_dataclass import dataclass
from robochoc.vehicles.autopilot import OFFBOARD

CAN_ARM, IS_ARMED, ARMS_ITSELF, CAN_FLY, FLIES, TUMBLED, LOCKED, CRASHED = (1 << bit for bit in range(8))
COMMANDS, FINISHED, DECK_FAULT = 1 << 8, 1 << 9, 1 << 11
MANUAL = "MANUAL"
_PROBLEMS = {
    LOCKED: "it is locked: restart it",
    CRASHED: "it has crashed: set it upright and restart it",
    TUMBLED: "it does not stand upright",
    DECK_FAULT: "one of its decks has a fault",
}


@dataclass(frozen=True)
class Supervisor:
    """The state of a Crazyflie, decoded from its bits."""

    bits: int

    def _has(self, bit: int) -> bool:
        return bool(self.bits & bit)

    @property
    def arms_itself(self) -> bool:
        """True if motors are always armed, like brushed motors."""
        return self._has(ARMS_ITSELF)

    @property
    def can_fly(self) -> bool:
        """True if commands to fly are accepted."""
        return self._has(CAN_FLY)

    @property
    def flies(self) -> bool:
        """True if motors had thrust within the last 2 s."""
        return self._has(FLIES)

    @property
    def commands(self) -> bool:
        """True if the high-level commander flies the Crazyflie."""
        return self._has(COMMANDS)

    @property
    def finished(self) -> bool:
        """True if the high-level commander has reached the end of its path."""
        return self._has(FINISHED)

    @property
    def armed(self) -> bool:
        """True if motors run, or one of our commands can start them."""
        return self.flies or self.commands or (self._has(IS_ARMED) and not self.arms_itself)

    @property
    def mode(self) -> str:
        """The flight mode, with the names used by autopilots.

        A Crazyflie in the air without the high-level commander must get set points from elsewhere, or it would fall.
        """
        if self.commands:
            return OFFBOARD
        return MANUAL if self.flies else "STANDBY"

    @property
    def problem(self) -> str:
        """The reason why the Crazyflie cannot be armed; empty if it can be, or is, armed."""
        for bit, problem in _PROBLEMS.items():
            if self._has(bit):
                return problem
        return "" if self.bits & (CAN_ARM | IS_ARMED | CAN_FLY) else "its autopilot is not ready to arm"
