"""The settings of listing DPOP (see `list_dpop.py`)."""

from __future__ import annotations

from robochoc.protocols.inference.settings.dpop import DPOPSettings

MOST_LISTED = 10_000


class ListDPOPSettings(DPOPSettings, frozen=True):
    """`limit`: the most optima that are listed. `memory`: the bytes that the tables of a robot may take."""

    limit: int = 100

    def __post_init__(self) -> None:
        """Raise `ValueError` unless `memory` is positive, and `limit` is too and not too large."""
        super().__post_init__()
        if not 1 <= self.limit <= MOST_LISTED:
            raise ValueError(f"limit is a number of optima from 1 to {MOST_LISTED:,}, not {self.limit}")
