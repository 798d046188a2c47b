"""The settings of P-DPOP (see `p_dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings

MOST_CELLS = 100_000_000
"""A table of as many takes gigabytes."""


class PDPOPSettings(Settings, frozen=True):
    """`cells`: the number of cells that a table may have. A run that needs more ends."""

    cells: int = 1_000_000

    def __post_init__(self) -> None:
        """Raise `ValueError` for numbers that cannot be."""
        if not 1 <= self.cells <= MOST_CELLS:
            raise ValueError(f"cells is a number of cells from 1 to {MOST_CELLS:,}, not {self.cells}")
