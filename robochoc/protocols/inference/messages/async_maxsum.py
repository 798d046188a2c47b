"""The messages of asynchronous Max-Sum (see `async_maxsum.py`)."""

from __future__ import annotations

from robochoc.model.wording import Wording
from robochoc.protocols.inference.messages import maxsum


class R(maxsum.R, frozen=True):
    """The costs of `maxsum.R`; `settled`: they are not damped. Otherwise the receiver answers, and more follows."""

    settled: bool

    act = maxsum.R.act

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{super().in_words(words)}{'' if self.settled else MORE}"


class Q(maxsum.Q, frozen=True):
    """The costs of `maxsum.Q`; `settled`: they are not damped. Otherwise the receiver answers, and more follows."""

    settled: bool

    act = maxsum.Q.act

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{super().in_words(words)}{'' if self.settled else MORE}"


MORE = " for the moment"
