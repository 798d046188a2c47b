"""The settings of all synchronous local search."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.settings_base import Settings


class CycleSettings(Settings, frozen=True):
    """`cycles`: the number of cycles after which all robots stop.

    `anytime`: whether the robots themselves find the best cycle, and end with their values in it (see `anytime.py`).
    """

    cycles: int = 100
    anytime: Literal["no", "yes"] = "no"

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise ValueError(f"cycles is {self.cycles}; it must be 1 or more")
