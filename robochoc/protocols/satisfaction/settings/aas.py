"""The settings of AAS (see `aas.py`)."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings


class AASSettings(Settings, frozen=True):
    """`largest`: the most values in an aggregate. With 1 it is ABT."""

    largest: int = 4

    def __post_init__(self) -> None:
        if self.largest < 1:
            raise ValueError(f"largest is {self.largest}; it must be 1 or more")
