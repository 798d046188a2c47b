"""The settings of asynchronous Max-Sum (see `async_maxsum.py`)."""

from __future__ import annotations

from robochoc.model.problem import INFINITE
from robochoc.protocols.settings_base import Settings


class AsyncMaxSumSettings(Settings, frozen=True):
    """`damping`: the weight of the last message. `preference`: the maximum for a value.

    `tolerance`: smaller changes are not told. `limit`: the number of messages to each neighbour.
    """

    damping: float = 0.5
    preference: float = 0.01
    tolerance: float = 0.0001
    limit: int = 200

    def __post_init__(self) -> None:
        if not 0 <= self.damping < 1:
            raise ValueError(f"damping is {self.damping:g}; it must be from 0 to below 1")
        for name in ("preference", "tolerance"):
            given = getattr(self, name)
            if not 0 <= given < INFINITE:
                raise ValueError(f"{name} is {given:g}; it must be a number, 0 or more")
        if self.limit < 1:
            raise ValueError(f"limit is {self.limit}; it must be 1 or more")
