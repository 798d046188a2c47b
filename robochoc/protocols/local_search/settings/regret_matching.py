"""The settings of regret matching (see `regret_matching.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.shared.settings.cycles import CycleSettings


class RegretMatchingSettings(CycleSettings, frozen=True):
    """`variant`: rm, or rm+, in which regrets never fall below 0.

    `weight` (rho): what part of a regret the last cycle makes up; 0: all cycles count alike. `inertia`: the probability
    that a robot keeps its value whatever it regrets. `cycles`: the number of cycles.
    """

    variant: Literal["rm", "rm+"] = "rm+"
    weight: float = 0.1
    inertia: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.weight <= 1:
            raise ValueError(f"weight is {self.weight:g}; it must be from 0 to 1")
        if not 0 <= self.inertia < 1:
            raise ValueError(f"inertia is {self.inertia:g}; it must be 0 or more, and less than 1")
