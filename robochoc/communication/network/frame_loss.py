"""Frames that are permanently lost. The sender of a lost frame then counts as lost, but never another robot.

A robot whose frames to the master are lost counts as lost. An observer only loses its request. The loss of frames
between two robots is reported by one of them, but may be caused by wrong frame numbers from the other. So the loss
counts only if messages are missing according to the counters of all robots.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from robochoc.communication.network.control_messages import LostFrames
from robochoc.communication.network.inbox import FramesLost
from robochoc.communication.network.members import NetworkMembers

TO_MASTER = "a frame to the master"


class _Lose(Protocol):
    def __call__(self, name: str, why: str, *, for_good: bool) -> None: ...


class LossTracker:
    """Tracks lost frames in a run of `members`. `refuse` reports each loss (who, what, why); `lose` removes a robot."""

    def __init__(self, members: NetworkMembers, refuse: Callable[[str, str, str], None], lose: _Lose) -> None:
        self._members = members
        self._refuse = refuse
        self._lose = lose
        self._said: dict[str, str] = {}
        """The losses reported in this search: the reason, by sender."""

    def start_search(self) -> None:
        """Start a search, and discard the reports from previous searches."""
        self._said.clear()

    @property
    def is_reported(self) -> bool:
        """True if a robot has reported a loss of frames from another robot in this search."""
        return bool(self._said)

    def note_at_master(self, missed: FramesLost) -> None:
        """Report the loss of frames to the master, and mark their sender as lost if it participates.

        Raises `RobotsLostError`.
        """
        name, many = missed.sender, f"{missed.frames:,} frames"
        why = f"{many} of it exceeded its quota" if missed.dropped else f"{many} of it were lost for good"
        self._refuse(name, TO_MASTER, why)
        member = self._members.robots.get(name)
        if member and member.joined:
            self._lose(name, f"{why} on the way to the master", for_good=self._members.closed)

    def note_between(self, name: str, gap: LostFrames) -> None:
        """Record a report by the robot `name` that frames to it were lost."""
        why = f"{gap.frames:,} frames of it to {name} were lost for good (reported by {name})"
        self._refuse(gap.who, f"a frame to {name}", why)
        if gap.who in self._members.robots:
            self._said.setdefault(gap.who, why)

    def explain_missing(self) -> bool:
        """Mark the senders of lost frames as lost, since protocol messages are missing. Return whether there are any.

        Raises `RobotsLostError`.
        """
        for name, why in self._said.items():
            self._lose(name, why, for_good=True)
        return bool(self._said)
