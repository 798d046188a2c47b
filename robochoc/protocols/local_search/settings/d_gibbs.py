"""The settings of D-Gibbs (see `d_gibbs.py`)."""

from __future__ import annotations

import math

from robochoc.protocols.shared.settings.cycles import CycleCount


class DGibbsSettings(CycleCount, frozen=True):
    """`temperature`: the cost by which a value may be dearer and still be drawn e times less often.

    `cooling`: by what it is multiplied after each cycle. `hard`: a value that breaks a hard constraint more is drawn
    e^hard times less often. `cycles`: the number of samples.
    """

    temperature: float = 1.0
    cooling: float = 1.0
    hard: float = 4.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.temperature < math.inf:
            raise ValueError(f"temperature is {self.temperature:g}; it must be more than 0")
        if not 0 < self.cooling <= 1:
            raise ValueError(f"cooling is {self.cooling:g}; it must be more than 0 and at most 1")
        if not 0 <= self.hard < math.inf:
            raise ValueError(f"hard is {self.hard:g}; it must be 0 or more")
