"""Where users made what they made: errors of a model name the line of the user's file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

from robochoc.system.errors import TransferableError

_HERE = str(Path(__file__).resolve().parent.parent)


class Place(NamedTuple):
    """A line of the user's program."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class ModelError(TransferableError, ValueError):
    """A model says what cannot be. The message names the line of the program that said so."""

    def __init__(self, message: str, hint: str = "", place: Place | None = None) -> None:
        super().__init__(f"{place or here()}: {message}" + (f" ({hint})" if hint else ""))


class ModelTypeError(ModelError, TypeError):
    """Things of a model are put together that do not go together, such as a colour and a number."""


class UnknownNameError(ModelError, KeyError):
    """A model or a solution has nothing of that name."""

    def __str__(self) -> str:
        return str(self.args[0])


def here() -> Place:
    """Return the line that called this package: the innermost one outside of it."""
    frame = sys._getframe(1)  # noqa: SLF001 - `inspect.stack` reads the files of all frames
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        frame = frame.f_back
    return Place(frame.f_code.co_filename, frame.f_lineno)
