"""The settings of MGM-2 (see `mgm2.py`)."""

from __future__ import annotations

from robochoc.protocols.shared.settings.cycles import CycleSettings


class MGM2Settings(CycleSettings, frozen=True):
    """`threshold` (q): the probability of being an offerer. `cycles`: the number of cycles."""

    threshold: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.threshold <= 1:
            raise ValueError(f"threshold is {self.threshold:g}; it must be from 0 to 1")
