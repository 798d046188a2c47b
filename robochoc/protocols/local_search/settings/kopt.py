"""The settings of k-opt (see `kopt.py`)."""

from __future__ import annotations

from robochoc.protocols.shared.settings.cycles import CycleSettings

MOST = 8
"""More robots at once than this are a search of their own."""


class KOptSettings(CycleSettings, frozen=True):
    """`k`: how many robots may move together. `cycles`: the number of cycles."""

    k: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.k <= MOST:
            raise ValueError(f"k is {self.k}; it must be from 1 to {MOST}")
