"""Protocols by name, as installed packages offer them under the entry point group `robochoc.protocols`."""

from __future__ import annotations

import difflib
from importlib.metadata import entry_points

from robochoc.protocols.protocol import Protocol

GROUP = "robochoc.protocols"


class UnknownProtocol(LookupError):  # noqa: N818 - named for what was asked for
    """No installed package offers a protocol of that name."""


def protocol_names() -> tuple[str, ...]:
    """The names of all protocols that are installed, ours and others', sorted."""
    return tuple(sorted(entry.name for entry in entry_points(group=GROUP)))


def protocol_named(name: str) -> type[Protocol]:
    """The class of the protocol called `name`. Raises `UnknownProtocol`, which names those there are."""
    found = list(entry_points(group=GROUP, name=name))
    if not found:
        names = protocol_names()
        near = difflib.get_close_matches(name, names, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise UnknownProtocol(f"no protocol {name!r} is installed, only: {', '.join(names)}{hint}")
    loaded = found[0].load()
    if not (isinstance(loaded, type) and issubclass(loaded, Protocol)):
        raise UnknownProtocol(f"{found[0].value}, installed as protocol {name!r}, is no subclass of Protocol")
    return loaded
