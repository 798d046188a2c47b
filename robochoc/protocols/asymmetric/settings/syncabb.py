"""The settings of Synchronous Asymmetric Branch and Bound (see `syncabb.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.settings_base import Settings


class SyncABBSettings(Settings, frozen=True):
    """`phases`: 1, each new value is priced by the robots before at once; 2, only a complete CPA is."""

    phases: Literal[1, 2] = 1
