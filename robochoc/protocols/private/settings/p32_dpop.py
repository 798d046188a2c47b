"""The settings of P3/2-DPOP (see `p32_dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.private.settings.p_dpop import PDPOPSettings

MOST = 1_000


class P32DPOPSettings(PDPOPSettings, frozen=True):
    """`cells`: as for P-DPOP. `spare`: at most so many turns more than there are robots, to hide how many there are."""

    spare: int = 2

    def __post_init__(self) -> None:
        """Raise `ValueError` for numbers that cannot be."""
        super().__post_init__()
        if not 0 <= self.spare <= MOST:
            raise ValueError(f"spare is a number of turns from 0 to {MOST}, not {self.spare}")
