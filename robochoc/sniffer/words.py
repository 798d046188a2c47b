"""What each message says, in words: `Robot2.1 says: as long as V1.1 = 2, V2.1 cannot be 3`.

Types of messages of robochoc's own protocols have words of their own; those of others are told by their names, their
fields, and what is done by them (`sniffer/performatives.py`). Whatever a journal holds, there are words for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from robochoc.sniffer import words_costs, words_values
from robochoc.sniffer.performatives import act_of
from robochoc.sniffer.phrases import MOST, Setting, row, short
from robochoc.sniffer.words_values import Wording
from robochoc.view.label import printable

_LONGEST = 1000
_encode = msgspec.json.Encoder(enc_hook=str).encode


def sentence(kind: str, content: Mapping[str, Any], setting: Setting, *, ours: bool = True) -> str:
    """What a message of type `kind` says.

    `ours`: whether it is of a protocol of robochoc; a user's type of the same name may mean something else.
    """
    told = None
    wording = wording_of(kind, content) if ours else None
    if wording is not None:
        try:
            told = f"{setting.sender} says: {wording(setting, content)}"
        except (TypeError, ValueError, LookupError, OverflowError):  # not what such a message holds
            told = None
    told = told or _generic(kind, content, setting)
    return _cut(told if told.isprintable() else printable(told))


def wording_of(kind: str, content: Mapping[str, Any]) -> Wording | None:
    """How a message of type `kind` with these fields is put into words; None: there is no special way."""
    match kind:
        case "CPA" if "bound" in content:
            return words_costs.CPA
        case "Accept" if "place" in content:
            return words_costs.ACCEPT
    return words_values.WORDS.get(kind) or words_costs.WORDS.get(kind)


def _generic(kind: str, content: Mapping[str, Any], setting: Setting) -> str:
    fields = [f"{name} = {short(_shown(value))}" for name, value in list(content.items())[: MOST + 2]]
    told = f": {row(fields)}" if fields else ""
    return f"{setting.sender} says {kind} ({act_of(kind).performative}){told}"


def _shown(value: object) -> str:
    if isinstance(value, str):
        return short(value)
    if isinstance(value, list | tuple | dict) and len(value) > MOST:
        return f"{len(value):,} entries"
    try:
        return _encode(value).decode()
    except (TypeError, ValueError, RecursionError):
        return type(value).__name__


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
