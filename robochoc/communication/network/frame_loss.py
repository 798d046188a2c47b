"""Frames that are permanently lost. The sender of a lost frame then counts as lost, but never another robot.

A robot whose frames to the master are lost counts as lost. An observer only loses its request. The loss of frames
between two robots is reported by one of them, but may be caused by wrong frame numbers from the other. So the loss
counts only if the search can never continue (`SearchState.is_stalled`): messages are missing, or the robot that reports
the loss cannot start. No later frame on that way is accepted either, so the loss counts in later searches too.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
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
        self._said: dict[tuple[str, str], str] = {}
        """The first report of each robot on each sender, by sender and reporter."""

    @property
    def is_reported(self) -> bool:
        """True if a robot of the team has reported a loss of frames from another robot of the team."""
        return bool(self._losses)

    @property
    def _losses(self) -> dict[tuple[str, str], str]:
        return {way: why for way, why in self._said.items() if self._members.robots.keys() >= {*way}}

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
            self._said.setdefault((gap.who, name), why)

    def explain(self, unready: Collection[str]) -> bool:
        """Mark senders of lost frames as lost, since the search can never continue. Return whether there are any.

        Before a search, robots send each other copies of constraints, without which none can start. So if robots are
        `unready`, only their reports count.

        Raises `RobotsLostError`.
        """
        guilty = {sender: why for (sender, name), why in self._losses.items() if not unready or name in unready}
        for sender, why in guilty.items():
            self._lose(sender, why, for_good=True)
        return bool(guilty)
