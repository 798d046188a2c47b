"""Files that robochoc has written itself, and that are given back to it: journals and results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from robochoc.cli.failure import INVALID, Failure

if TYPE_CHECKING:
    from robochoc.observers.journal import Journal

LARGEST_FILE = 1 << 30
"""1 GiB: a journal of hundreds of millions of messages, or one of millions as text."""
JOURNAL_STEP = "give what 'robochoc solve --journal' wrote"


def saved_content(file: Path, next_step: str) -> bytes:
    """What is in `file`. Raises `Failure`, which ends in `next_step`."""
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise _refused(file, str(error.strerror or error), next_step) from error
    if len(content) > LARGEST_FILE:
        raise _refused(file, f"it has more than {LARGEST_FILE:,} bytes", next_step)
    return content


def saved_journal(file: Path) -> Journal:
    """The journal in `file`. Raises `Failure`."""
    from robochoc.observers.journal import BadJournal, read_journal

    content = saved_content(file, JOURNAL_STEP)
    try:
        return read_journal(content)
    except BadJournal as wrong:
        raise _refused(file, str(wrong), JOURNAL_STEP) from wrong


def _refused(file: Path, why: str, next_step: str) -> Failure:
    from robochoc.formats import on_one_line

    return Failure(INVALID, on_one_line(f"{file}: {why} ({next_step})"))
