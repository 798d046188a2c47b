"""A cache of limited size for answers that are slow to compute."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable


class Cache:
    """The most recently used answers, with at most `most` bytes in total."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._size = 0
        self._answers: OrderedDict[Hashable, bytes] = OrderedDict()

    def get(self, key: Hashable) -> bytes | None:
        """Return the answer for `key`, or None if it is not cached."""
        if key not in self._answers:
            return None
        self._answers.move_to_end(key)
        return self._answers[key]

    def put(self, key: Hashable, answer: bytes) -> bytes:
        """Store `answer`, unless it is larger than the cache, and return it."""
        self._size -= len(self._answers.pop(key, b""))
        if len(answer) < self._most:
            self._answers[key] = answer
            self._size += len(answer)
        while self._size > self._most:
            self._size -= len(self._answers.popitem(last=False)[1])
        return answer
