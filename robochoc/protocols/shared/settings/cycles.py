"""The settings of protocols that go through cycles."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.settings_base import Settings


class CycleCount(Settings, frozen=True):
    """`cycles`: the number of cycles after which all robots stop."""

    cycles: int = 100

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise ValueError(f"cycles is {self.cycles}; it must be 1 or more")


class CycleSettings(CycleCount, frozen=True):
    """`cycles`: the number of cycles after which all robots stop.

    `anytime`: whether the robots themselves find the best cycle, by messages, and end with their values in it.
    """

    anytime: Literal["no", "yes"] = "no"
