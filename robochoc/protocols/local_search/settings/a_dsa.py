"""The settings of A-DSA (see `a_dsa.py`)."""

from __future__ import annotations

from robochoc.protocols.local_search.settings.dsa import DSASettings


class ADSASettings(DSASettings, frozen=True):
    """Those of `dsa`, but `cycles` are ticks of a robot; no `anytime`, as robots do not go in step."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.anytime == "yes":
            raise ValueError("anytime is for robots that go through cycles together; here each has ticks of its own")
