"""The words of toulbar2's files, with their lines; compressed files are read up to a bound."""

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
"""The maximum number of bytes of a file, unpacked."""

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_DECIMAL = re.compile(r"[+-]?(?=[.0-9])[0-9]{0,18}(?:\.[0-9]{0,60})?")

Found = TypeVar("Found")
Words = Iterator[tuple[int, str]]
"""The words of a file, each with its line."""


class WordReader:
    """Takes one word after the other."""

    def __init__(self, words: Words) -> None:
        self._words = words
        self.line = 1

    def word(self, what: str) -> str:
        """Return the next word, which is to be `what`. Raises `MistakeError` where the file ends."""
        found = next(self._words, None)
        if found is None:
            raise MistakeError(f"the file ends where {what} should stand", "is it complete?", self.line)
        self.line, word = found
        return word

    def more(self) -> str | None:
        """Return the next word. None: there is none."""
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
            self.refuse(f"'{shortened(word)}' where {what} should stand", "write an integer")
        return int(word)

    def amount(self, word: str) -> Amount:
        """Return `word` as a cost. Raises `MistakeError`."""
        if word == "inf":
            return INFINITE
        if not _DECIMAL.fullmatch(word) or word.strip("+-") == ".":
            self.refuse(f"'{shortened(word)}' where a cost should stand", "write a number such as 1.25, or inf")
        return Fraction(word) if "." in word else int(word)

    def refuse(self, message: str, hint: str) -> NoReturn:
        """Raise `MistakeError` for the line of the word that was read last."""
        raise MistakeError(message, hint, self.line)


def read_words(words: Words, read: Callable[[WordReader], Found]) -> Found:
    """Return the result of `read` for the words of a file. Raises `MistakeError` if words remain."""
    source = WordReader(words)
    found = read(source)
    left = source.more()
    if left is not None:
        source.refuse(f"'{shortened(left)}' after the end of the problem", "delete it, or check the numbers before it")
    return found


def read_file(
    paths: Sequence[Path], options: ImportOptions, read: Callable[[str, str, ImportOptions], ImportResult]
) -> ImportResult:
    """Return what `read` makes of the text of the one file in `paths`, its stem and `options`.

    Raises:
        InvalidInputError: with the file and the line of its mistake.
    """
    path = paths[0]
    if len(paths) > 1:
        hint = "a network is one file: import them one by one"
        raise InvalidInputError([Diagnostic(encodable(str(paths[1])), 0, "is a second file", hint)])
    try:
        return read(_text(path), path.name.split(".")[0], options)
    except MistakeError as mistake:
        where = encodable(str(path))
        raise InvalidInputError([Diagnostic(where, mistake.line, mistake.message, mistake.hint)]) from None


def has_suffix(path: Path, suffix: str) -> bool:
    """Return whether a file is called `*SUFFIX`, compressed or not."""
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
