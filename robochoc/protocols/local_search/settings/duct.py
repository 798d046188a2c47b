"""The settings of DUCT (see `duct.py`)."""

from __future__ import annotations

import math
from typing import Literal

from robochoc.protocols.settings_base import Settings


class DUCTSettings(Settings, frozen=True):
    """`samples`: after how many samples a robot chooses its value at the latest.

    `by`: whether values are compared by the `mean` cost of their samples, or by the `best` one. `bound`: by what the
    confidence bound is multiplied; more tries dear values more often. `error` and `confidence`: a robot also chooses
    when, with this confidence, no other value is better by more than this part of what its subtree can cost at most.
    `contexts`: how many combinations of values above it a robot keeps samples of.
    """

    samples: int = 300
    by: Literal["mean", "best"] = "mean"
    bound: float = 1.0
    error: float = 0.1
    confidence: float = 0.9
    contexts: int = 10_000

    def __post_init__(self) -> None:
        for name, number in (("samples", self.samples), ("contexts", self.contexts)):
            if number < 1:
                raise ValueError(f"{name} is {number}; it must be 1 or more")
        for name, measure in (("bound", self.bound), ("error", self.error)):
            if not 0 <= measure < math.inf:
                raise ValueError(f"{name} is {measure:g}; it must be 0 or more")
        if not 0 < self.confidence < 1:
            raise ValueError(f"confidence is {self.confidence:g}; it must be between 0 and 1")
