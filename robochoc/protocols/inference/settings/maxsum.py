"""The settings of Max-Sum (see `maxsum.py`)."""

from __future__ import annotations

from robochoc.model.problem import INFINITE
from robochoc.protocols.shared.settings.cycles import CycleSettings

MAX_SPLIT = 0.5
"""With this share both halves of a function are alike."""


class MaxSumSettings(CycleSettings, frozen=True):
    """`damping`: the weight of the last Q. `preference`: the maximum for a value. `cycles`: the number of cycles.

    `split`: each function becomes two, and the share of each entry is drawn from `split` to 1 - `split`. 0: none is.
    """

    damping: float = 0.5
    preference: float = 0.01
    split: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.damping < 1:
            raise ValueError(f"damping is {self.damping:g}; it must be from 0 to below 1")
        if not 0 <= self.preference < INFINITE:
            raise ValueError(f"preference is {self.preference:g}; it must be a number, 0 or more")
        if not 0 <= self.split <= MAX_SPLIT:
            raise ValueError(f"split is {self.split:g}; it must be from 0 (none) to {MAX_SPLIT:g} (halves)")
