"""The settings of DSA (see `dsa.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.shared.settings.cycles import CycleSettings


class DSASettings(CycleSettings, frozen=True):
    """`variant`: A, B, C, D or E. `probability` (p): the probability of a move. `cycles`: the number of cycles."""

    variant: Literal["A", "B", "C", "D", "E"] = "B"
    probability: float = 0.7

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.probability <= 1:
            raise ValueError(f"probability is {self.probability:g}; it must be more than 0 and at most 1")
