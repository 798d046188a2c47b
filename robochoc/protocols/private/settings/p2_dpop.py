"""The settings of P2-DPOP (see `p2_dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.private.settings.p32_dpop import MOST
from robochoc.protocols.settings_base import Settings

MOST_CIPHERS = 1_000_000
"""A table of as many takes 64 MB, and each robot about eight minutes in each turn."""


class P2DPOPSettings(Settings, frozen=True):
    """`ciphers`: the number of ciphers that a table may have; a run that needs more ends. `spare`: as for P3/2-DPOP."""

    ciphers: int = 20_000
    spare: int = 2

    def __post_init__(self) -> None:
        """Raise `ValueError` for numbers that cannot be."""
        if not 1 <= self.ciphers <= MOST_CIPHERS:
            raise ValueError(f"ciphers is a number of ciphers from 1 to {MOST_CIPHERS:,}, not {self.ciphers}")
        if not 0 <= self.spare <= MOST:
            raise ValueError(f"spare is a number of turns from 0 to {MOST}, not {self.spare}")
