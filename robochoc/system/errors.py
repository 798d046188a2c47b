"""The base class of all exceptions of robochoc, and the exceptions of invalid options."""

from __future__ import annotations

from typing import Any


class RobochocError(Exception):
    """The base class of all exceptions of robochoc.

    A copy in another process has the same type, message and attributes, also where the constructor of a subclass
    expects other arguments than the message. (By default, Python calls the class with the message.)
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _without_constructor, (type(self), self.args), self.__getstate__()


class OptionError(RobochocError, ValueError):
    """The value of an option is not allowed."""


class OptionTypeError(OptionError, TypeError):
    """The value of an option has a wrong type, or there is no such option."""


def _without_constructor(kind: type[RobochocError], args: tuple[object, ...]) -> RobochocError:
    error = kind.__new__(kind)
    error.args = args
    return error
