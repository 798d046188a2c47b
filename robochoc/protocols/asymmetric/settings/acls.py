"""The settings of ACLS (see `acls.py`)."""

from __future__ import annotations

from robochoc.protocols.shared.cycles import CycleCount


class ACLSSettings(CycleCount, frozen=True):
    """`coordination` (c): a proposal is taken if c times its cost is less than now; 1: only if it is cheaper.

    `probability` (p): the probability of a move. `cycles`: the number of cycles.
    """

    coordination: float = 0.8
    probability: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.coordination <= 1:
            raise ValueError(f"coordination is {self.coordination:g}; it must be more than 0 and at most 1")
        if not 0 < self.probability <= 1:
            raise ValueError(f"probability is {self.probability:g}; it must be more than 0 and at most 1")
