"""The entries of a journal in words, as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robochoc.journal.journal import lines_of, read_journal


def entries_of(file: Path) -> list[dict[str, Any]]:
    """The entries of a journal that is whole, as JSON objects."""
    journal = read_journal(file.read_bytes())
    assert journal.damage is None
    return [json.loads(line) for line in lines_of(journal)]
