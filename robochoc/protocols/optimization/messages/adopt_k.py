"""The messages of ADOPT(k), besides BnB-ADOPT's (see `adopt_k.py`)."""

from __future__ import annotations

import math

from robochoc.model.wording import Wording, cost_text
from robochoc.protocols.optimization.messages import bnb_adopt
from robochoc.protocols.optimization.messages.bounding import Number


class Value(bnb_adopt.Value, frozen=True):
    """The sender's value, the number of its changes (ID), and the receiver's thresholds (TH^B, and TH^A, `allowance`).

    The receiver keeps its value while its lower bound is less than k above the allowance, and below the threshold.
    """

    allowance: Number = 0

    def in_words(self, words: Wording) -> str:
        change = f"{words.own_value(self.value)} from now on (change {self.counter})"
        if not self.allowance and math.isinf(self.threshold):
            return change
        dear = "" if math.isinf(self.threshold) else f", or {cost_text(self.threshold)}"
        return f"{change}; try other values once yours costs k more than {cost_text(self.allowance)}{dear}"
