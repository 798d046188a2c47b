"""The fleets that a dispatcher knows by their bids, and names under which two bidders bid."""

from __future__ import annotations

from robochoc.ros.rmf.messages import BidProposal

FLEETS_MAX = 100
BIDS_MAX = 1000
"""The number of stored bids; the oldest are dropped."""
_SILENT_NOTICES = 3
"""A fleet that has not bid for this number of notices is not waited for."""
CONFLICT_S = 60.0
"""The time for which the bids under a name are refused after two bidders have used it, in seconds."""


class Fleets:
    """The known fleets.

    A bidder bids once for each notice that is not a dry run. Two different bids under one name are those of two
    bidders, who would both execute the task.
    """

    def __init__(self) -> None:
        self._silent: dict[str, int] = {}
        """The number of notices since the last bid, by fleet."""
        self._bids: dict[tuple[str, str], BidProposal] = {}
        """The first bid for each notice, by notice and fleet."""
        self._conflict_s: dict[str, float] = {}
        """The time of the last conflict, by name."""

    def __len__(self) -> int:
        return len(self._silent)

    def ask(self) -> None:
        """Note that all fleets are asked for a bid, and forget silent ones."""
        self._silent = {fleet: count + 1 for fleet, count in self._silent.items() if count < _SILENT_NOTICES}

    def add(self, fleet: str) -> None:
        """Note that a fleet has bid, in time or late."""
        if fleet in self._silent or len(self._silent) < FLEETS_MAX:
            self._silent[fleet] = 0

    def compare_bid(self, notice_id: str, bid: BidProposal, now_s: float) -> None:
        """Compare a bid with the first one for the same notice, which was no dry run."""
        name = bid.fleet_name
        if self._bids.setdefault((notice_id, name), bid) != bid and len(self._conflict_s) < FLEETS_MAX:
            self._conflict_s[name] = now_s
        if len(self._bids) > BIDS_MAX:
            del self._bids[next(iter(self._bids))]

    def has_conflict(self, fleet: str, now_s: float) -> bool:
        """Return whether two bidders have used a name recently."""
        if now_s >= self._conflict_s.get(fleet, -CONFLICT_S) + CONFLICT_S:
            self._conflict_s.pop(fleet, None)
        return fleet in self._conflict_s

    def forget(self, fleet: str) -> None:
        """Wait no longer for a fleet."""
        self._silent.pop(fleet, None)
