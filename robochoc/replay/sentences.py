"""A message as a sentence, such as `Robot2.1 says: as long as V1.1 = 2, V2.1 cannot be 3`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from robochoc.protocols.acts import Act
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording
from robochoc.replay.inspection import safely
from robochoc.system.plain_text import MOST_LISTED, listed, printable

_MAX_CHARACTERS = 1000
_MAX_VALUE_CHARACTERS = 60
_encode = msgspec.json.Encoder(enc_hook=str).encode


def sentence_of(message: Message, words: Wording, content: Mapping[str, Any] | None = None) -> str:
    """Return a message as a sentence spoken by its sender; `Message.in_words` may fail.

    `content`: the fields by name, shown if there is no sentence. None: those of `message`.
    """
    said = safely(lambda: message.in_words(words), "")
    if said:
        return _shown_text(f"{words.sender} says: {said}")
    fields = msgspec.structs.asdict(message) if content is None else content
    return fields_in_words(type(message).__name__, fields, words.sender, message.act)


def fields_in_words(kind: str, content: Mapping[str, Any], sender: str, act: Act) -> str:
    """Return a message without a sentence as text: its type, FIPA act and fields."""
    fields = [f"{name} = {_cut(_shown(value))}" for name, value in list(content.items())[: MOST_LISTED + 2]]
    return _shown_text(f"{sender} says {kind} ({act.performative}){f': {listed(fields)}' if fields else ''}")


def _shown_text(text: str) -> str:
    return _cut(text if text.isprintable() else printable(text), _MAX_CHARACTERS)


def _shown(value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple | dict) and len(value) > MOST_LISTED:
        return f"{len(value):,} entries"
    try:
        return _encode(value).decode()
    except (TypeError, ValueError, RecursionError):
        return type(value).__name__


def _cut(text: str, most: int = _MAX_VALUE_CHARACTERS) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
