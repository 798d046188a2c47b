"""The base of exceptions that other processes receive unchanged."""

from __future__ import annotations

from typing import Any


class TransferableError(Exception):
    """An exception whose copy in another process has the same type, message and attributes.

    By default, Python copies an exception by a call of its class with the message. An exception whose constructor
    expects other arguments has this class as its first base.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _without_constructor, (type(self), self.args), self.__getstate__()


def _without_constructor(kind: type[TransferableError], args: tuple[object, ...]) -> TransferableError:
    error = kind.__new__(kind)
    error.args = args
    return error
