"""The settings of all synchronous local search."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings


class CycleSettings(Settings, frozen=True):
    """`cycles`: the number of cycles after which all robots stop."""

    cycles: int = 100

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise ValueError(f"cycles is {self.cycles}; it must be 1 or more")
