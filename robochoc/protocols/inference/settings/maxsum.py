"""The settings of Max-Sum (see `maxsum.py`)."""

from __future__ import annotations

from robochoc.model.problem import INFINITE
from robochoc.protocols.shared.settings.cycles import CycleSettings


class MaxSumSettings(CycleSettings, frozen=True):
    """`damping`: the weight of the last Q. `preference`: the maximum for a value. `cycles`: the number of cycles."""

    damping: float = 0.5
    preference: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.damping < 1:
            raise ValueError(f"damping is {self.damping:g}; it must be from 0 to below 1")
        if not 0 <= self.preference < INFINITE:
            raise ValueError(f"preference is {self.preference:g}; it must be a number, 0 or more")
