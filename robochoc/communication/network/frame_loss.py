"""Frames that are permanently lost. The sender of a lost frame then counts as lost, but never another robot.

A robot whose frames to the master are lost counts as lost. An observer only loses its request. The loss of frames
between two robots is reported by one of them, but may be caused by wrong frame numbers from the other. So the loss
counts only if messages are missing according to the counters of all robots, or, before the search, if the robot that
reports it does not become ready.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from robochoc.communication.network.control_messages import LostFrames
from robochoc.communication.network.inbox import FramesLost
from robochoc.communication.network.members import NetworkMembers

TO_MASTER = "a frame to the master"


class _Lose(Protocol):
    def __call__(self, name: str, why: str, *, for_good: bool) -> None: ...


class _Loss(NamedTuple):
    """A loss that the robot `reporter` has reported, with the time of its report on the monotonic clock."""

    why: str
    reporter: str
    since: float


class LossTracker:
    """Tracks lost frames in a run of `members`. `refuse` reports each loss (who, what, why); `lose` removes a robot."""

    def __init__(self, members: NetworkMembers, refuse: Callable[[str, str, str], None], lose: _Lose) -> None:
        self._members = members
        self._refuse = refuse
        self._lose = lose
        self._said: dict[str, _Loss] = {}
        """The first loss of each sender's frames reported in this search."""

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
            self._said.setdefault(gap.who, _Loss(why, name, time.monotonic()))

    def explain_missing(self) -> bool:
        """Mark the senders of lost frames as lost, since protocol messages are missing. Return whether there are any.

        Raises `RobotsLostError`.
        """
        for name, loss in self._said.items():
            self._lose(name, loss.why, for_good=True)
        return bool(self._said)

    def explain_unready(self, is_ready: Callable[[str], bool], patience_s: float) -> None:
        """Mark the senders of lost frames as lost if the robot that lacks them has not become ready for `patience_s`.

        Before a search, robots send each other copies of constraints, without which none can start.

        Raises `RobotsLostError`.
        """
        now = time.monotonic()
        for name, loss in self._said.items():
            if now - loss.since > patience_s and not is_ready(loss.reporter):
                self._lose(name, loss.why, for_good=True)
