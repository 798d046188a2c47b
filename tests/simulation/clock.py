"""The clock of a simulation. Nothing else may decide when time is over: not the machine, and not its load."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from random import Random
from unittest.mock import patch

from robochoc.protocols.private.rerooting import RerootingProtocol
from tests.support.toy_group import ToyGroup

HANG_S = 1e9
"""No run may last so long, in virtual seconds (32 years)."""
MOST_READINGS, READINGS_A_SECOND = 1_000_000, 20_000
"""No run reads the clock so often, and so often a virtual second: about once for each message."""


class HangError(BaseException):
    """A run does not end. No handler of errors in the program may catch this."""


class VirtualClock:
    """A monotonic clock that is moved by its readings, by `advance_to`, and by jumps.

    Args:
        tick_s: The seconds that pass with each reading.
        jumps: Pairs of a time and the seconds by which the clock then jumps forward: the machine was suspended.
    """

    def __init__(self, tick_s: float, jumps: tuple[tuple[float, float], ...] = ()) -> None:
        self.now = 0.0
        self._tick_s = tick_s
        self._jumps = sorted(jumps)
        self._readings = 0

    def monotonic(self) -> float:
        """Return the virtual time in seconds. Raises `HangError`."""
        self._readings += 1
        self.advance_to(self.now + self._tick_s)
        if self._readings > MOST_READINGS + READINGS_A_SECOND * self.now:
            raise HangError(f"the clock was read {self._readings:,} times")
        return self.now

    def advance_to(self, time_s: float) -> None:
        """Let the time pass until `time_s`, and longer if the clock jumps before. Raises `HangError`."""
        self.now = max(self.now, time_s)
        while self._jumps and self._jumps[0][0] <= self.now:
            self.now += self._jumps.pop(0)[1]
        if self.now > HANG_S:
            raise HangError(f"the run has lasted {self.now:,.0f} virtual seconds")


def _no_watch(*_arguments: object) -> None:
    """Do nothing, in place of the thread that interrupts computations when their real time is over."""


@contextmanager
def virtual_time(clock: VirtualClock, seed: int) -> Iterator[None]:
    """Let the program of this process use `clock`, and no entropy but that of `seed`."""
    chance = Random(f"entropy {seed}")
    replaced: list[tuple[str, Callable[..., object]]] = [
        ("time.monotonic", clock.monotonic),
        ("robochoc.system.time_limit._watch", _no_watch),
        ("secrets.randbits", chance.getrandbits),
        ("secrets.token_hex", lambda size=8: chance.randbytes(size).hex()),
    ]
    with ExitStack() as patches:
        for name, function in replaced:
            patches.enter_context(patch(name, function))
        patches.enter_context(patch.object(RerootingProtocol, "group", ToyGroup))
        patches.enter_context(patch.object(logging.getLogger("robochoc"), "disabled", new=True))
        yield
