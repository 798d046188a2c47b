"""Where a conversation that is played back is: at which of its moments, and how fast it goes on."""

from __future__ import annotations

from math import isnan

LEAST_S, MOST_S, PER_MOMENT_S = 3.0, 10.0, 0.15
"""A conversation is played in this time, however many moments it has."""
SPEEDS = (0.25, 0.5, 1.0, 2.0)
LARGE_S = 1.0
"""The picture of a large team that is played is drawn so often: it takes a while, and others want a turn."""


class Player:
    """Plays `count` moments, of which there is at least one.

    Attributes:
        count: How many there are.
        playing: Whether it goes on by itself.
        speed: How many times as fast as usual.
    """

    def __init__(self, count: int) -> None:
        self.count = max(count, 1)
        self.playing = False
        self.speed = 1.0
        self._at = 0.0

    @property
    def moment(self) -> int:
        """The moment that is shown, from 0."""
        return min(int(self._at), self.count - 1)

    @property
    def seconds(self) -> float:
        """How long all of it takes at the usual speed."""
        return min(max(self.count * PER_MOMENT_S, LEAST_S), MOST_S)

    @property
    def ended(self) -> bool:
        """Whether the last moment is shown."""
        return self.moment == self.count - 1

    def toggle(self) -> None:
        """Play, from the beginning if it was at the end; or pause."""
        if not self.playing and self.ended:
            self._at = 0.0
        self.playing = not self.playing

    def advance(self, seconds: float) -> None:
        """Let time go by."""
        if not self.playing:
            return
        self._at = min(self._at + max(seconds, 0.0) * self.speed * self.count / self.seconds, float(self.count))
        self.playing = self._at < self.count

    def step(self, by: int) -> None:
        """Pause, and go so many moments on, or back."""
        self.seek(self.moment + by)

    def seek(self, moment: object) -> None:
        """Pause at a moment; what is none, as browsers may say anything, changes nothing."""
        if isinstance(moment, (int, float)) and not (isinstance(moment, float) and isnan(moment)):
            self.playing = False
            self._at = float(min(max(moment, 0), self.count - 1))

    def hurry(self, speed: object) -> None:
        """Set the speed, if it is one of `SPEEDS`."""
        if speed in SPEEDS and isinstance(speed, (int, float)):
            self.speed = float(speed)


class Frames:
    """Says when the picture of a conversation is to be drawn again."""

    def __init__(self) -> None:
        self._drawn = -LARGE_S

    def is_due(self, now: float, *, large: bool, playing: bool) -> bool:
        """Return whether to draw it.

        Args:
            now: A time in seconds.
            large: Whether the team is large.
            playing: Whether the conversation goes on by itself; where it stands still, what is shown stays.
        """
        if large and playing and now - self._drawn < LARGE_S:
            return False
        self._drawn = now
        return True
