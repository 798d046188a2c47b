"""A bisection whose number of questions does not depend on the answers."""

from __future__ import annotations


class Bisection:
    """Finds the first of `places` for which something is true; from there on it is true for all.

    There are as many questions as it may take at most: once the place is found, the rest is asked for show.
    """

    def __init__(self, places: int) -> None:
        self._last = places - 1
        self._low = 0
        self._high = places
        self.left = places.bit_length()
        """The number of questions still to be asked."""

    @property
    def place(self) -> int:
        """The place to ask about next."""
        return min((self._low + self._high) // 2, self._last)

    def take(self, *, true: bool) -> None:
        """Take the answer for `place`."""
        if self._low < self._high:
            if true:
                self._high = self.place
            else:
                self._low = self.place + 1
        self.left -= 1

    @property
    def found(self) -> int:
        """The first place for which it is true, once no question is left; the number of places if there is none."""
        return self._low
