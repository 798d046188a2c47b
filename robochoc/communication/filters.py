"""Channel filters transform the content of a message between its sender and its receiver.

Like protocols, filters are registered by installed packages, in the entry point group `robochoc.filters`. Filters can
be stacked: they seal in their order, and open in the reverse order. robochoc contains two filters: `signed` and
`sealed`. docs/guides/security.md describes their protection, and how to write a filter.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import cast

from robochoc.authority.keyring import KeyRing
from robochoc.formats.diagnostics import on_one_line
from robochoc.system.errors import RobochocError
from robochoc.system.installed import entry_points_named, load_entry_point, not_installed_message

GROUP = "robochoc.filters"


class NotGenuineError(RobochocError):
    """Raised if the sender did not seal the data for this robot in this context. No part of the data may be used."""


class UnknownFilterError(RobochocError, LookupError):
    """Raised if no installed package has a filter of that name, or the filter cannot be used."""


class ChannelFilter(ABC):
    """A filter for all messages of a robot, whose keys are in `ring`.

    `context` encodes facts that both sides know without the message: run, sender, receiver and sequence number. It is
    not sent. A message that is moved to another context cannot be opened.
    """

    def __init__(self, ring: KeyRing) -> None:
        self.ring = ring

    @abstractmethod
    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """Return the bytes to send for `content`. They may differ in each call. Raises `UnknownPeerError`."""

    @abstractmethod
    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """Return the content sealed by `sender`. The argument may be any bytes. Raises `NotGenuineError`."""


class FilterStack(ChannelFilter):
    """Applies a stack of filters as one filter. An empty stack does not change messages."""

    def __init__(self, ring: KeyRing, filters: Sequence[type[ChannelFilter]]) -> None:
        super().__init__(ring)
        self._filters = tuple(kind(ring) for kind in filters)

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """See `ChannelFilter.seal`."""
        for each in self._filters:
            content = each.seal(receiver, content, context)
        return content

    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """Return the opened content. Any failure in a filter is raised as `NotGenuineError`."""
        for each in reversed(self._filters):
            try:
                content = each.open(sender, content, context)
            except NotGenuineError:
                raise
            except Exception as error:
                text = on_one_line(f"{type(each).__name__} failed: {type(error).__name__}: {error}")
                raise NotGenuineError(text) from error
        return content


def filter_named(name: str) -> type[ChannelFilter]:
    """Return the filter called `name`. Raises `UnknownFilterError`, which lists the installed filters."""
    found = entry_points_named(GROUP, name)
    if not found:
        raise UnknownFilterError(not_installed_message(GROUP, "filter", name))
    loaded = load_entry_point(found[0], found, _fault)
    if loaded.broken:
        raise UnknownFilterError(f"{found[0].value}, installed as filter {name!r}, {loaded.broken}")
    return cast("type[ChannelFilter]", loaded.what)


def _fault(loaded: object) -> str:
    """Return the reason why `loaded` cannot be used as a filter; empty if it can be used."""
    if not (isinstance(loaded, type) and issubclass(loaded, ChannelFilter)):
        return "is not a subclass of ChannelFilter"
    if loaded.__abstractmethods__:
        return f"does not define {' and '.join(sorted(loaded.__abstractmethods__))}"
    return ""
