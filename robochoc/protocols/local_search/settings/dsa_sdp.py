"""The settings of DSA-SDP (see `dsa_sdp.py`)."""

from __future__ import annotations

from robochoc.protocols.shared.settings.cycles import CycleSettings


class DSASDPSettings(CycleSettings, frozen=True):
    """`pa`, `pb`: the probability of a move that saves the part r of the own cost is pa + min(pb, r).

    `pc`, `pd`: that of one that costs the part r more, in a cycle of exploration, is max(pc, pd - r). `period`: every
    so many cycles is one of exploration. `cycles`: the number of cycles.
    """

    pa: float = 0.6
    pb: float = 0.15
    pc: float = 0.4
    pd: float = 0.8
    period: int = 40

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("pa", "pb", "pc", "pd"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g}; it must be from 0 to 1")
        if self.pa + self.pb > 1:
            raise ValueError(f"pa + pb is {self.pa + self.pb:g}; it must be at most 1")
        if self.period < 1:
            raise ValueError(f"period is {self.period}; it must be 1 or more")
