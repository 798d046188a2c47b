"""The message of GDBA that is not common to all local search (see `gdba.py`)."""

from __future__ import annotations

from robochoc.model.wording import Wording
from robochoc.protocols.local_search.messages.mgm import Gain, saving_in_words


class Improve(Gain, frozen=True):
    """The reduction of the sender's effective cost by its best move: broken hard constraints, and costs (`improve`)."""

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"as I weigh constraints by now, my move would save {saving_in_words(self.broken, self.cost)}"
