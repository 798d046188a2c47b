"""The settings of MB-DPOP (see `mb_dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.inference.settings.dpop import DPOPSettings


class MBDPOPSettings(DPOPSettings, frozen=True):
    """`k`: the most dimensions of a table. `memory`: the bytes that the tables of a robot may take."""

    k: int = 4

    def __post_init__(self) -> None:
        """Raise `ValueError` unless `memory` and `k` are positive."""
        super().__post_init__()
        if self.k < 1:
            raise ValueError(f"k is {self.k}; a table has at least one dimension")
