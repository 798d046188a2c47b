"""The settings of DBA (see `dba.py`)."""

from __future__ import annotations

from robochoc.protocols.shared.cycles import CycleSettings


class DBASettings(CycleSettings, frozen=True):
    """`cycles`: the number of cycles after which it gives up."""

    cycles: int = 1000
