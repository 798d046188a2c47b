"""The masters that a robot knows, in their order of priority, and the time since one of them led the robot."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence

SILENCE_S = 3.0
"""The time without a message after which a robot looks for another master, in seconds."""
HEARTBEAT_S = 0.5
"""The interval between two heartbeats of a master, in seconds."""
PROBE_S = 0.3
"""The longest wait for an answer of another master, in seconds."""
_ROUND_S = 0.5
"""The interval between two attempts to find another master, in seconds."""
_ATTEMPT_S, _LONGEST_ATTEMPT_S = 2.0, 8.0
"""The time to connect to a master that listens, in seconds: at first, and at most."""


def listens(endpoint: str) -> bool:
    """Return whether a program listens at `endpoint` (`HOST:PORT`)."""
    host, _, port = endpoint.rpartition(":")
    try:
        socket.create_connection((host, int(port)), PROBE_S).close()
    except OSError:
        return False
    return True


class Masters:
    """The masters at `endpoints`, of which a robot follows one (`current`).

    With a single master, nothing is measured, and the robot waits for this master as long as it can.

    Args:
        endpoints: The addresses (`HOST:PORT`), by priority.
        patience_s: The longest time without a leading master, in seconds.
        clock: Returns the time in seconds.
        is_listening: Returns whether a master listens at an address.
        sleep: Waits for a number of seconds.
    """

    def __init__(
        self,
        endpoints: Sequence[str],
        patience_s: float,
        clock: Callable[[], float] = time.monotonic,
        is_listening: Callable[[str], bool] = listens,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.current = endpoints[0]
        self.patience_s = patience_s
        self._endpoints = tuple(endpoints)
        self._clock = clock
        self._is_listening = is_listening
        self._sleep = sleep
        self._led_at = self._heard_at = clock()
        self._searched_at = 0.0
        self._attempt_s = _ATTEMPT_S
        self._refusal = ""
        self._has_moved = False

    @property
    def several(self) -> bool:
        """True if the robot knows several masters."""
        return len(self._endpoints) > 1

    @property
    def attempt_s(self) -> float:
        """The time to connect to the current master, in seconds."""
        return min(self._attempt_s, self.patience_s) if self.several else self.patience_s

    @property
    def is_over(self) -> bool:
        """True if no master has led the robot for longer than the patience."""
        return self.several and self._clock() - self._led_at > self.patience_s

    @property
    def failure(self) -> str:
        """The reason why the robot ends without a master."""
        why = f" (the last answer: {self._refusal})" if self._refusal else ""
        return f"no master leads: none of {', '.join(self._endpoints)} did for {self.patience_s:g} s{why}"

    def start(self) -> None:
        """Begin to follow the current master."""
        self._heard_at = self._clock()

    def hear(self) -> None:
        """Record a message of the current master."""
        self._led_at = self._heard_at = self._clock()
        self._attempt_s = _ATTEMPT_S

    def note_refusal(self, why: str) -> None:
        """Record why the current master does not lead the robot."""
        self._refusal = why

    def other_listens(self) -> bool:
        """Return whether the current master is silent and another one listens, which then is the current one."""
        now = self._clock()
        if not self.several or now - self._heard_at < SILENCE_S or now - self._searched_at < _ROUND_S:
            return False
        self._searched_at = now
        self._has_moved = self._move()
        return self._has_moved

    def leave(self) -> None:
        """Wait until another master, or at last the one that was left, listens, or the patience is over."""
        if self._has_moved:
            self._has_moved = False
            return
        self._attempt_s = min(2 * self._attempt_s, _LONGEST_ATTEMPT_S)
        while not self._move() and not self.is_over:
            self._sleep(_ROUND_S)
            if self._is_listening(self.current):
                return

    def _move(self) -> bool:
        """Change to the next master that listens. Return whether there is one.

        A stopped master also listens. The masters are tried in turn, so that it does not hide those after it.
        """
        place = self._endpoints.index(self.current)
        others = self._endpoints[place + 1 :] + self._endpoints[:place]
        found = next((one for one in others if self._is_listening(one)), None)
        self.current = found or self.current
        return found is not None
