"""The page about journals documents the fields of each entry: all that exist, and no others."""

from __future__ import annotations

import re
from typing import get_args

import msgspec

from robochoc.journal.entries import Ended, Header, JournalEntry
from tests.support.program import ROOT

PAGE = (ROOT / "docs" / "guides" / "journal.md").read_text(encoding="utf-8")
EVERYWHERE = {"t"}
"""The fields of every entry, which are documented once."""


def fields_of(entry: type[msgspec.Struct]) -> set[str]:
    """Return the fields of an entry in the text form."""
    return {field.encode_name for field in msgspec.structs.fields(entry)} - EVERYWHERE


def table(heading: str) -> list[list[str]]:
    """Return the rows of the table with this first line, as lists of cells."""
    rows = PAGE.partition(f"{heading}\n|---|")[2].partition("\n\n")[0].splitlines()[1:]
    return [row.strip("| ").split(" | ") for row in rows]


def test_the_fields_of_the_header_are_documented() -> None:
    assert {row[0].strip("`") for row in table("| field | meaning |")} == fields_of(Header)


def test_the_fields_of_events_are_documented() -> None:
    events = [one for one in get_args(JournalEntry) if one not in {Header, Ended}]
    rows = table("| entry | fields | meaning |")
    documented = {row[0].strip("`"): {*re.findall(r"`(\w+)`", row[1])} for row in rows}
    assert documented == {str(one.__struct_config__.tag): fields_of(one) for one in events}


def test_the_fields_of_the_last_entry_are_documented() -> None:
    paragraph = PAGE.partition("The last entry is `Ended`.")[2].partition("\n\n")[0]
    assert fields_of(Ended) <= {*re.findall(r"`(\w+)`", paragraph)}
