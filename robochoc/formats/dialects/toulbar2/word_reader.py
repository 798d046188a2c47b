"""Read toulbar2's files word by word, with the line of each word. Compressed files are read up to a maximum size."""

from __future__ import annotations

import gzip
import io
import lzma
import re
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import NoReturn, TypeVar

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, MistakeError, encodable, shortened
from robochoc.formats.dialects.dialect import ImportOptions, ImportResult
from robochoc.formats.dialects.exact_costs import Amount
from robochoc.model.constraint import INFINITE

MAX_TEXT = 256 * 1024 * 1024
"""The maximum size of an uncompressed file, in bytes."""

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_DECIMAL = re.compile(r"[+-]?(?=[.0-9])[0-9]{0,18}(?:\.[0-9]{0,60})?")

Found = TypeVar("Found")
Words = Iterator[tuple[int, str]]
"""The words of a file, each with its line."""


class WordReader:
    """Reads the words of a file one by one, and stores the line of the last word."""

    def __init__(self, words: Words) -> None:
        self._words = words
        self.line = 1

    def word(self, what: str) -> str:
        """Return the next word. Raises `MistakeError`, which names `what`, at the end of the file."""
        found = next(self._words, None)
        if found is None:
            raise MistakeError(
                f"expected {what}, found the end of the file", "check that the file is complete", self.line
            )
        self.line, word = found
        return word

    def more(self) -> str | None:
        """Return the next word, or None at the end of the file."""
        found = next(self._words, None)
        if found is None:
            return None
        self.line, word = found
        return word

    def integer(self, what: str) -> int:
        """Return the next word as an integer."""
        return self.as_integer(self.word(what), what)

    def as_integer(self, word: str, what: str) -> int:
        """Return `word` as an integer. Raises `MistakeError`."""
        if not _INTEGER.fullmatch(word):
            self.refuse(f"expected {what}, found '{shortened(word)}'", "write an integer")
        return int(word)

    def amount(self, word: str) -> Amount:
        """Return `word` as a cost. Raises `MistakeError`."""
        if word == "inf":
            return INFINITE
        if not _DECIMAL.fullmatch(word) or word.strip("+-") == ".":
            self.refuse(f"expected a cost, found '{shortened(word)}'", "write a number such as 1.25, or inf")
        return Fraction(word) if "." in word else int(word)

    def refuse(self, message: str, hint: str) -> NoReturn:
        """Raise `MistakeError` with the line of the last word."""
        raise MistakeError(message, hint, self.line)


def read_words(words: Words, read: Callable[[WordReader], Found]) -> Found:
    """Return the result of `read` for the words of a file. Raises `MistakeError` if words remain."""
    source = WordReader(words)
    found = read(source)
    left = source.more()
    if left is not None:
        what = f"unexpected '{shortened(left)}' after the end of the problem"
        source.refuse(what, "delete it, or check the numbers before it")
    return found


def read_file(
    paths: Sequence[Path], options: ImportOptions, read: Callable[[str, str, ImportOptions], ImportResult]
) -> ImportResult:
    """Return the result of `read` for the text of the only file in `paths`, the stem of its name, and `options`.

    Raises:
        InvalidInputError: if `read` raises `MistakeError`. It contains the file and the line of the error.
    """
    path = paths[0]
    if len(paths) > 1:
        hint = "import one file at a time: a network is one file"
        raise InvalidInputError([Diagnostic(encodable(str(paths[1])), 0, "is a second network", hint)])
    try:
        return read(_text(path), path.name.split(".")[0], options)
    except MistakeError as mistake:
        where = encodable(str(path))
        raise InvalidInputError([Diagnostic(where, mistake.line, mistake.message, mistake.hint)]) from None


def has_suffix(path: Path, suffix: str) -> bool:
    """Return whether the name of a file ends in `suffix`, or in `suffix` and `.gz` or `.xz`."""
    return path.name.lower().endswith((suffix, f"{suffix}.gz", f"{suffix}.xz"))


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
        if content.startswith(b"\x1f\x8b"):
            with gzip.GzipFile(fileobj=io.BytesIO(content)) as packed:
                content = packed.read(MAX_TEXT + 1)
        elif content.startswith(b"\xfd7zXZ\x00"):
            with lzma.LZMAFile(io.BytesIO(content)) as xz:
                content = xz.read(MAX_TEXT + 1)
    except (OSError, EOFError, lzma.LZMAError) as error:
        raise MistakeError(f"cannot be read: {shortened(str(error))}", "check the file and its permissions") from None
    if len(content) > MAX_TEXT:
        raise MistakeError(f"is larger than {MAX_TEXT // 2**20} MiB", "import a smaller problem")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise MistakeError("is not UTF-8", "save it in UTF-8") from None
