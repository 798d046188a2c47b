"""The settings of Max-Sum_AD (see `maxsum_ad.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.model.problem import INFINITE
from robochoc.protocols.shared.settings.cycles import CycleSettings


class MaxSumADSettings(CycleSettings, frozen=True):
    """`variant`: AD, ADVP or ADSSVP. `preference`: the maximum for a value. `cycles`: the number of phases."""

    variant: Literal["AD", "ADVP", "ADSSVP"] = "ADSSVP"
    preference: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.preference < INFINITE:
            raise ValueError(f"preference is {self.preference:g}; it must be a number, 0 or more")
