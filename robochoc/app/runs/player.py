"""The position and speed at which a conversation is played back."""

from __future__ import annotations

from math import isnan

LEAST_S, MOST_S, PER_MOMENT_S = 3.0, 10.0, 0.15
"""The limits on the playing time of a conversation, and the time for one moment, in seconds."""
SPEEDS = (0.25, 0.5, 1.0, 2.0)
LARGE_S = 1.0
"""The interval in seconds at which the picture of a large team is drawn, since drawing is slow."""


class Player:
    """Plays `count` moments. There is at least one.

    Attributes:
        count: The number of moments.
        playing: True if the player is running.
        speed: The speed, relative to the normal speed.
    """

    def __init__(self, count: int) -> None:
        self.count = max(count, 1)
        self.playing = False
        self.speed = 1.0
        self._at = 0.0

    @property
    def moment(self) -> int:
        """The index of the shown moment, from 0."""
        return min(int(self._at), self.count - 1)

    @property
    def seconds(self) -> float:
        """The playing time at the normal speed, in seconds."""
        return min(max(self.count * PER_MOMENT_S, LEAST_S), MOST_S)

    @property
    def ended(self) -> bool:
        """True if the last moment is shown."""
        return self.moment == self.count - 1

    def toggle(self) -> None:
        """Pause or continue. At the end, start again from the beginning."""
        if not self.playing and self.ended:
            self._at = 0.0
        self.playing = not self.playing

    def advance(self, seconds: float) -> None:
        """Advance by a number of seconds."""
        if not self.playing:
            return
        self._at = min(self._at + max(seconds, 0.0) * self.speed * self.count / self.seconds, float(self.count))
        self.playing = self._at < self.count

    def step(self, by: int) -> None:
        """Pause, and move by a number of moments."""
        self.seek(self.moment + by)

    def seek(self, moment: object) -> None:
        """Pause at a moment. An invalid value, which a browser could send, is ignored."""
        if isinstance(moment, (int, float)) and not (isinstance(moment, float) and isnan(moment)):
            self.playing = False
            self._at = float(min(max(moment, 0), self.count - 1))

    def set_speed(self, speed: object) -> None:
        """Set the speed, if it is one of `SPEEDS`."""
        if speed in SPEEDS and isinstance(speed, (int, float)):
            self.speed = float(speed)


class Frames:
    """Decides when the picture of a conversation must be drawn again."""

    def __init__(self) -> None:
        self._drawn = -LARGE_S

    def is_due(self, now: float, *, large: bool, playing: bool) -> bool:
        """Return whether to draw the picture.

        Args:
            now: A time in seconds.
            large: True if the team is large.
            playing: True if the player is running. If not, the picture is always drawn, since it stays visible.
        """
        if large and playing and now - self._drawn < LARGE_S:
            return False
        self._drawn = now
        return True
