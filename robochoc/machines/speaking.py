"""Protocols by the names that a master says to robots: those that are installed, and the one for stepping aside."""

from __future__ import annotations

from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.registry import protocol_named

FIRST_FIT = "first-fit"


def spoken(name: str) -> type[Protocol]:
    """The protocol that a master calls `name`. Raises `UnknownProtocol`."""
    return FirstFit if name == FIRST_FIT else protocol_named(name)
