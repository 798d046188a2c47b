"""The settings of HS-CAI (see `hs_cai.py`)."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings


class HSCAISettings(Settings, frozen=True):
    """The amount of inference before and during the search.

    `k`: the most robots above that a table may be over. With as many as the tree's induced width, all bounds are exact.
    `t`: a robot has its bounds inferred anew when a value above has stayed the same for more than `t` searches.
    """

    k: int = 4
    t: int = 1

    def __post_init__(self) -> None:
        for name, number in (("k", self.k), ("t", self.t)):
            if number < 1:
                raise ValueError(f"{name} is {number}; it must be 1 or more")
