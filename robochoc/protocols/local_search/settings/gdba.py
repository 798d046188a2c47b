"""The settings of GDBA (see `gdba.py`)."""

from __future__ import annotations

from typing import Literal

from robochoc.protocols.shared.settings.cycles import CycleSettings


class GDBASettings(CycleSettings, frozen=True):
    """The rule by which a constraint that is violated in a quasi-local minimum weighs more from then on.

    `modifier`: A adds to what it charges, M multiplies it. `violation`: NZ (it charges anything), NM (more than its
    minimum) or MX (its maximum). `scope`: E changes one entry of its table, R those of all own values against the
    others' current ones, C those of the own value against all of theirs, T the whole table. `cycles`: the number of
    cycles.
    """

    modifier: Literal["A", "M"] = "M"
    violation: Literal["NZ", "NM", "MX"] = "NM"
    scope: Literal["E", "R", "C", "T"] = "T"
