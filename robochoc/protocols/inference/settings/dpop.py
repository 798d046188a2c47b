"""The settings of DPOP (see `dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings

GIB = 1 << 30


class DPOPSettings(Settings, frozen=True):
    """`memory`: the bytes that the tables of a robot may take. A run that needs more ends before it makes a table."""

    memory: int = GIB

    def __post_init__(self) -> None:
        """Raise `ValueError` unless `memory` is positive."""
        if self.memory < 1:
            raise ValueError(f"memory is a number of bytes, not {self.memory}")
