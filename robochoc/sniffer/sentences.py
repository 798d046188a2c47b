"""Messages in words: `Robot2.1 says: as long as V1.1 = 2, V2.1 cannot be 3`.

The words stand with the message's class (`Message.in_words`). A message without words, or of a protocol that is not
installed, is shown by its type, its FIPA act and its fields. So any journal can be shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from robochoc.protocols.acts import INFORM
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording
from robochoc.sniffer.recorded_messages import message_of
from robochoc.system.plain_text import MOST_LISTED, listed, printable

_MAX_CHARACTERS = 1000
_MAX_VALUE_CHARACTERS = 60
_encode = msgspec.json.Encoder(enc_hook=str).encode


def sentence(kind: str, content: Mapping[str, Any], words: Wording, message_type: type[Message] | None) -> str:
    """Return a recorded message as a sentence of its sender.

    Args:
        kind: The name of its type.
        content: Its fields by name, as a journal holds them.
        words: Its sender and receiver, and the names of the team.
        message_type: Its class; None: the protocol is not installed, or has no such message.
    """
    said = _in_words(content, words, message_type) if message_type else ""
    text = f"{words.sender} says: {said}" if said else _by_fields(kind, content, words.sender, message_type)
    return _cut(text if text.isprintable() else printable(text), _MAX_CHARACTERS)


def _in_words(content: Mapping[str, Any], words: Wording, message_type: type[Message]) -> str:
    message = message_of(message_type, content)
    if message is None:
        return ""
    try:
        return message.in_words(words)
    except Exception:  # noqa: BLE001 - fields may be altered, and the protocol another package's
        return ""


def _by_fields(kind: str, content: Mapping[str, Any], sender: str, message_type: type[Message] | None) -> str:
    act = message_type.act if message_type else INFORM
    fields = [f"{name} = {_cut(_shown(value))}" for name, value in list(content.items())[: MOST_LISTED + 2]]
    return f"{sender} says {kind} ({act.performative}){f': {listed(fields)}' if fields else ''}"


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
