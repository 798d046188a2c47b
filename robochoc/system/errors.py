"""The base class of all exceptions in robochoc, and the exceptions for invalid options."""

from __future__ import annotations

from typing import Any


class RobochocError(Exception):
    """The base class of all exceptions in robochoc.

    A copy in another process has the same type, message and attributes, even if the constructor of a subclass expects
    arguments other than the message. (By default, Python calls the class with the message.)
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _without_constructor, (type(self), self.args), self.__getstate__()


class OptionError(RobochocError, ValueError):
    """Raised if the value of an option is not allowed."""


class OptionTypeError(OptionError, TypeError):
    """Raised if the value of an option has a wrong type, or no such option exists."""


def _without_constructor(kind: type[RobochocError], args: tuple[object, ...]) -> RobochocError:
    error = kind.__new__(kind)
    error.args = args
    return error
