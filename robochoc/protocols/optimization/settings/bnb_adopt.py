"""The settings of BnB-ADOPT+ (see `bnb_adopt.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.settings_base import Settings


class BnBADOPTSettings(Settings, frozen=True):
    """`heuristic`: where lower bounds begin: at 0 (`none`), or at what children say before the search (`dp`)."""

    heuristic: Literal["none", "dp"] = "none"
