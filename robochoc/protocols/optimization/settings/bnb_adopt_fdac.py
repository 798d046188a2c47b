"""The settings of BnB-ADOPT+ with soft arc consistency (see `bnb_adopt_fdac.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.settings_base import Settings


class BnBADOPTFDACSettings(Settings, frozen=True):
    """`level`: how costs are moved before the search: `fdac` (full directional), or only out of constraints (`ac`)."""

    level: Literal["fdac", "ac"] = "fdac"
