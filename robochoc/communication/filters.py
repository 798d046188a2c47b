"""Channel filters: what is done to a message's content between the robot that says it and the one that hears it.

A filter comes from an installed package, under the entry point group `robochoc.filters`, as protocols do. Several can
be stacked: they seal in their order, and open in the reverse one. Two come with robochoc: `signed` and `sealed`. What
they protect from, and how to write one: docs/guides/security.md.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from robochoc.authority.keyring import KeyRing
from robochoc.formats.diagnostics import on_one_line
from robochoc.system.entry_points import EntryPoint
from robochoc.system.installed import all_entry_points, entry_points_named, load_entry_point, not_installed_message

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


@dataclass(frozen=True)
class FilterOffer:
    """A package's offer of the filter `name`: the class at `place`, or the reason why there is none."""

    name: str
    place: str
    """Module and class, as the package names them."""
    filter: type[ChannelFilter] | None
    broken: str = ""
    """The reason why the filter cannot be used. Empty if it can."""


def filter_offers() -> tuple[FilterOffer, ...]:
    """Return all that installed packages offer, by name; what cannot be used too, with the reason."""
    return tuple(_offer(entry, namesakes) for entry, namesakes in all_entry_points(GROUP))


def filter_named(name: str) -> type[ChannelFilter]:
    """Return the filter called `name`. Raises `UnknownFilterError`, which names those there are."""
    found = entry_points_named(GROUP, name)
    if not found:
        raise UnknownFilterError(not_installed_message(GROUP, "filter", name))
    offer = _offer(found[0], found)
    if offer.filter is None:
        raise UnknownFilterError(f"{offer.place}, installed as filter {name!r}, {offer.broken}")
    return offer.filter


def _offer(entry: EntryPoint, namesakes: Sequence[EntryPoint]) -> FilterOffer:
    found = load_entry_point(entry, namesakes, _fault)
    return FilterOffer(entry.name, entry.value, cast("type[ChannelFilter] | None", found.what), found.broken)


def _fault(loaded: object) -> str:
    """Return the reason why `loaded` cannot be used as a filter. Empty if it can."""
    if not (isinstance(loaded, type) and issubclass(loaded, ChannelFilter)):
        return "is no subclass of ChannelFilter"
    if loaded.__abstractmethods__:
        return f"does not define {' and '.join(sorted(loaded.__abstractmethods__))}"
    return ""
