"""Errors of models, which name the line of the user's program."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from robochoc.system.errors import RobochocError

_HERE = str(Path(__file__).resolve().parent.parent)


class SourceLine(NamedTuple):
    """A line of the user's program."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class ModelError(RobochocError, ValueError):
    """A model is invalid. The message contains the line of the user's program."""

    def __init__(self, message: str, hint: str = "", place: SourceLine | None = None) -> None:
        super().__init__(f"{place or calling_line()}: {message}" + (f" ({hint})" if hint else ""))


class ModelTypeError(ModelError, TypeError):
    """A value or term has the wrong type or kind, such as a colour compared with a number."""


class UnknownNameError(ModelError, KeyError):
    """A model or a solution has no robot or variable with that name."""

    def __str__(self) -> str:
        return str(self.args[0])


def calling_line() -> SourceLine:
    """Return the line that called robochoc: the innermost frame outside of robochoc and CPMpy."""
    frame = sys._getframe(1)  # noqa: SLF001 - `inspect.stack` reads the files of all frames
    while frame.f_back is not None and (frame.f_code.co_filename.startswith(_HERE) or _is_of_cpmpy(frame)):
        frame = frame.f_back
    return SourceLine(frame.f_code.co_filename, frame.f_lineno)


def is_called_by_cpmpy() -> bool:
    """Return whether a function of CPMpy called robochoc, usually because it received a variable of robochoc."""
    frame: FrameType | None = sys._getframe(1)  # noqa: SLF001 - see `calling_line`
    while frame is not None and frame.f_code.co_filename.startswith(_HERE):
        frame = frame.f_back
    return frame is not None and _is_of_cpmpy(frame)


def _is_of_cpmpy(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__")).split(".", 1)[0] == "cpmpy"
