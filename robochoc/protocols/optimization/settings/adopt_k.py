"""The settings of ADOPT(k) (see `adopt_k.py`)."""

from __future__ import annotations

from typing import ClassVar

from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.settings.bnb_adopt import BnBADOPTSettings


class ADOPTkSettings(BnBADOPTSettings, frozen=True):
    """`k`: a value is left when its lower bound is k above the threshold; 1: as ADOPT does, `inf`: as BnB-ADOPT.

    `heuristic`: where lower bounds begin: at 0 (`none`), or at what children say before the search (`dp`).
    """

    may_be_infinite: ClassVar[frozenset[str]] = frozenset({"k"})

    k: int | float = 1000

    def __post_init__(self) -> None:
        """Raise `ValueError` unless `k` is a whole number from 1, or infinite."""
        if self.k != INFINITE and (self.k < 1 or not isinstance(self.k, int)):
            raise ValueError(f"k is {self.k}; it must be a whole number, 1 or more, or inf")
