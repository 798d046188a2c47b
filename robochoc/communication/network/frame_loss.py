"""Frames that are lost for good: whose loss that is. Never that of others.

A gap in the frames to the master is the loss of their sender; who is no robot of the team loses only its request. A
gap between two robots is what one of them says, and may be a number that the other has made up: it counts once messages
turn out to be missing, which the counters of all robots show.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from robochoc.communication.network.control_messages import LostFrames
from robochoc.communication.network.inbox import FramesLost
from robochoc.communication.network.members import Members

TO_MASTER = "a frame to the master"


class _Lose(Protocol):
    def __call__(self, name: str, why: str, *, for_good: bool) -> None: ...


class LossTracker:
    """Gaps in a run of `members`. `refuse` is told of each (who, what, why); `lose` takes a robot out."""

    def __init__(self, members: Members, refuse: Callable[[str, str, str], None], lose: _Lose) -> None:
        self._members = members
        self._refuse = refuse
        self._lose = lose
        self._said: dict[str, str] = {}
        """Of whom robots say in this search that frames are lost, and the words for it."""

    def begin(self) -> None:
        """A search begins: what was said in another one is of no account."""
        self._said.clear()

    def note_at_master(self, missed: FramesLost) -> None:
        """Frames to the master are lost: its sender is, if it is a robot that takes part. Raises `RobotsLostError`."""
        name, many = missed.sender, f"{missed.frames:,} frames"
        why = f"{many} of it were more than it may send" if missed.dropped else f"{many} of it were lost for good"
        self._refuse(name, TO_MASTER, why)
        member = self._members.robots.get(name)
        if member and member.joined:
            self._lose(name, f"{why} on the way to the master", for_good=self._members.closed)

    def note_between(self, name: str, gap: LostFrames) -> None:
        """The robot `name` says that frames to it are lost."""
        why = f"{gap.frames:,} frames of it to {name} were lost for good ({name} says so)"
        self._refuse(gap.who, f"a frame to {name}", why)
        if gap.who in self._members.robots:
            self._said.setdefault(gap.who, why)

    def explain_missing(self) -> bool:
        """Protocol messages are missing: those are lost of whom frames are. Return whether there is anybody.

        Raises `RobotsLostError`.
        """
        for name, why in self._said.items():
            self._lose(name, why, for_good=True)
        return bool(self._said)
