"""The settings of P-DPOP (see `p_dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings


class PDPOPSettings(Settings, frozen=True):
    """`cells`: the number of cells that a table may have. A run that needs more ends."""

    cells: int = 1_000_000

    def __post_init__(self) -> None:
        """Raise `ValueError` unless `cells` is positive."""
        if self.cells < 1:
            raise ValueError(f"cells is a number of cells, not {self.cells}")
