"""Channel filters: they transform the content of a message between its sender and its receiver.

A filter comes from an installed package, under the entry point group `robochoc.filters`, as protocols do. Several can
be stacked: they seal in their order, and open in the reverse one. Two come with robochoc: `signed` and `sealed`. What
they protect from, and how to write one: docs/guides/security.md.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import cast

from robochoc.authority.keyring import KeyRing
from robochoc.formats.diagnostics import on_one_line
from robochoc.system.installed import entry_points_named, load_entry_point, not_installed_message

GROUP = "robochoc.filters"


class NotGenuineError(Exception):
    """The data is not what `sender` has sealed for this robot in this context. No part of it may be used."""


class UnknownFilterError(LookupError):
    """No installed package offers a filter of that name, or what it offers cannot be used."""


class ChannelFilter(ABC):
    """A filter for all messages of the robot whose keys are in `ring`.

    `context` is what both sides know of a message without being told in it: run, sender, receiver and sequence number,
    as bytes that the caller makes. It is not sent along; a message moved into another context does not open.
    """

    def __init__(self, ring: KeyRing) -> None:
        self.ring = ring

    @abstractmethod
    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """Return what is sent instead of `content`. Each call may give something else. Raises `UnknownPeerError`."""

    @abstractmethod
    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """Return what `sender` has sealed; `content` may be anything. Raises `NotGenuineError`."""


class FilterStack(ChannelFilter):
    """Filters one upon the other, as one. Without any, messages stay as they are."""

    def __init__(self, ring: KeyRing, filters: Sequence[type[ChannelFilter]]) -> None:
        super().__init__(ring)
        self._filters = tuple(kind(ring) for kind in filters)

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """Return what the last filter makes of what the first ones have made of `content`."""
        for each in self._filters:
            content = each.seal(receiver, content, context)
        return content

    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """Return what the first filter has sealed.

        A filter that fails in whatever way has not opened it: `NotGenuineError`.
        """
        for each in reversed(self._filters):
            try:
                content = each.open(sender, content, context)
            except NotGenuineError:
                raise
            except Exception as error:
                told = on_one_line(f"{type(each).__name__} failed: {type(error).__name__}: {error}")
                raise NotGenuineError(told) from error
        return content


def filter_named(name: str) -> type[ChannelFilter]:
    """Return the filter called `name`. Raises `UnknownFilterError`, which names those there are."""
    found = entry_points_named(GROUP, name)
    if not found:
        raise UnknownFilterError(not_installed_message(GROUP, "filter", name))
    loaded = load_entry_point(found[0], found, _fault)
    if loaded.broken:
        raise UnknownFilterError(f"{found[0].value}, installed as filter {name!r}, {loaded.broken}")
    return cast("type[ChannelFilter]", loaded.what)


def _fault(loaded: object) -> str:
    """Return the reason why `loaded` cannot be used as a filter. Empty if it can."""
    if not (isinstance(loaded, type) and issubclass(loaded, ChannelFilter)):
        return "is no subclass of ChannelFilter"
    if loaded.__abstractmethods__:
        return f"does not define {' and '.join(sorted(loaded.__abstractmethods__))}"
    return ""
