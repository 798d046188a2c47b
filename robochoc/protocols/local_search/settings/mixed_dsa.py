"""The settings of MixedDSA (see `mixed_dsa.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.shared.settings.cycles import CycleSettings


class MixedDSASettings(CycleSettings, frozen=True):
    """`hard`: the probability of a move where hard constraints are violated. `soft`: that of any other move.

    `variant`: A, B or C. `cycles`: the number of cycles.
    """

    hard: float = 0.7
    soft: float = 0.5
    variant: Literal["A", "B", "C"] = "B"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("hard", "soft"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g}; it must be more than 0 and at most 1")
