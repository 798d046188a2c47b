"""Diagnostics of inputs: all errors are reported together, one per line, with a location and a suggestion."""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType

from robochoc.model.priorities import natural_key
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import on_one_line as on_one_line  # noqa: PLC0414 - from here, too

MAX_PER_FILE = 100
"""The maximum number of errors reported for a file."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One error. `line` is 0 if no single line is wrong, `hint` is a suggestion to the user."""

    file: str
    line: int
    message: str
    hint: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return on_one_line(f"{place}: {self.message} ({self.hint})")


class InvalidInputError(RobochocError):
    """Raised for an invalid input. `diagnostics` contains every error found, sorted by file and line."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(sorted(diagnostics, key=_place))
        super().__init__("\n".join(map(str, self.diagnostics)))


def invalid_input(path: Path | str, message: str, hint: str, line: int = 0) -> InvalidInputError:
    """Return an exception with a single error in the file `path`, or in an input with this name."""
    return InvalidInputError([Diagnostic(encodable(str(path)), line, message, hint)])


class MistakeError(RobochocError):
    """Raised for an error in one element. `DiagnosticCollector`, which knows the file and the line, catches it."""

    def __init__(self, message: str, hint: str, line: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.line = line


class DiagnosticCollector:
    """Collects the errors in a file while it is read."""

    def __init__(self, file: str) -> None:
        self.file = file
        self._found: list[Diagnostic] = []

    def add(self, line: int, message: str, hint: str) -> None:
        """Add an error. Raises `InvalidInputError` when the limit on errors is reached."""
        if len(self._found) == MAX_PER_FILE:
            self._found.append(Diagnostic(self.file, line, "more mistakes from here on", "fix those above first"))
            raise InvalidInputError(self._found)
        self._found.append(Diagnostic(self.file, line, message, hint))

    def at(self, line: int) -> AbstractContextManager[None, bool | None]:
        """Add a `MistakeError` raised inside, and continue after the block: the next element may have errors, too."""
        return _MistakesAt(self, line)

    def finish(self) -> None:
        """Raise `InvalidInputError` if any error was added."""
        if self._found:
            raise InvalidInputError(self._found)


class _MistakesAt(AbstractContextManager[None, bool | None]):
    """The context manager of `DiagnosticCollector.at`. It is entered for every element, and faster than a generator."""

    __slots__ = ("_line", "_report")

    def __init__(self, report: DiagnosticCollector, line: int) -> None:
        self._report = report
        self._line = line

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if not isinstance(error, MistakeError):
            return None
        self._report.add(error.line or self._line, error.message, error.hint)
        return True


def suggestion(word: str, known: Collection[str], what: str) -> str:
    """Return a hint for an unknown name: the most similar known name, or all of them. `what` is the plural noun."""
    if not known:
        return f"there are no {what}"
    import difflib  # noqa: PLC0415 - start-up: only mistakes need it

    some = list(itertools.islice(known, 100))
    close = difflib.get_close_matches(word[:40], some, n=1)
    return f"did you mean '{close[0]}'?" if close else f"known {what}: {shortened(' '.join(some))}"


def shortened(text: str) -> str:
    """Return `text`, truncated if it is too long for a message."""
    return text if len(text) <= 60 else f"{text[:57]}..."  # noqa: PLR2004 - characters


def _place(diagnostic: Diagnostic) -> tuple[object, int]:
    """Return a sort key: file and line. Paths of more than 4096 characters could contain numbers too long for `int`."""
    return natural_key(diagnostic.file[:4096]), diagnostic.line


def encodable(path: str) -> str:
    """Return `path` as text that can be encoded in UTF-8, because file names need not be valid UTF-8."""
    return os.fsencode(path).decode("utf-8", "replace")
