"""Protocols by name, as installed packages offer them under the entry point group `robochoc.protocols`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import cast

from robochoc.protocols.dynamic import DynamicProtocol
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.disac import DisAC
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import AUTO, CENTRAL, DEFAULT_COST_PROTOCOL, FIRST_FIT, PREPROCESSING
from robochoc.system.entry_points import EntryPoint
from robochoc.system.errors import RobochocError
from robochoc.system.installed import (
    all_entry_points,
    entry_point_names,
    entry_points_named,
    load_entry_point,
    not_installed_message,
)

GROUP = "robochoc.protocols"
_STAGES: dict[str, type[Protocol]] = {FIRST_FIT: FirstFit, PREPROCESSING: DisAC}
"""Protocols of single stages of a run. Users cannot choose them."""


class UnknownProtocolError(RobochocError, LookupError):
    """No installed package offers a protocol of that name, or the protocol cannot be used."""


@dataclass(frozen=True)
class InstalledProtocol:
    """A protocol that a package offers: the class of `entry`, or the reason why it cannot be used."""

    entry: EntryPoint
    protocol: type[Protocol] | None
    broken: str = ""
    """The reason why the protocol cannot be used. Empty if it can."""

    @property
    def name(self) -> str:
        """The protocol's name."""
        return self.entry.name

    @property
    def place(self) -> str:
        """Module and class, as the package names them: `robochoc.protocols.satisfaction.abt:ABT`."""
        return self.entry.value

    @property
    def package(self) -> str:
        """Name and version of the package."""
        return f"{self.entry.dist.name} {self.entry.dist.version}" if self.entry.dist else "unknown"


def protocol_names() -> tuple[str, ...]:
    """Return the names of all protocols that are installed, ours and others', sorted."""
    return entry_point_names(GROUP)


_SPELLINGS = {CENTRAL, AUTO}
"""A cache of names in the spelling of their packages: each look-up of installed protocols takes 0.1 ms."""


def installed_spelling(name: str) -> str:
    """Return `name` as its package spells it (`ABT` is `abt`), or `name` itself if it matches none or several."""
    if name in _SPELLINGS or entry_points_named(GROUP, name):
        _SPELLINGS.add(name)
        return name
    spellings = [one for one in (*protocol_names(), CENTRAL, AUTO) if one.lower() == name.lower()]
    return spellings[0] if len(spellings) == 1 else name


def installed_protocols() -> tuple[InstalledProtocol, ...]:
    """Return all protocols that packages offer, sorted by name; also those that cannot be used, with the reason."""
    return tuple(_offer(entry, namesakes) for entry, namesakes in all_entry_points(GROUP))


def unknown_protocol(name: str) -> str:
    """Return the error text that no protocol of that name is installed, with suggestions."""
    return not_installed_message(GROUP, "protocol", name, also=(CENTRAL, AUTO), listed_by="robochoc protocols")


def installed_protocol(name: str) -> InstalledProtocol:
    """Return the protocol that is offered as `name`. Raises `UnknownProtocolError`, which suggests others."""
    found = entry_points_named(GROUP, name)
    if not found:
        raise UnknownProtocolError(unknown_protocol(name))
    return _offer(found[0], found)


def protocol_named(name: str) -> type[Protocol]:
    """Return the class of the protocol called `name`. Raises `UnknownProtocolError`, which suggests others."""
    offer = installed_protocol(name)
    if offer.protocol is None:
        raise UnknownProtocolError(f"{offer.place}, installed as protocol {name!r}, {offer.broken}")
    return offer.protocol


def protocol_or_stage(name: str) -> type[Protocol]:
    """Return the protocol of that name, including the stages that users cannot choose: `FIRST_FIT`, `PREPROCESSING`."""
    return _STAGES[name] if name in _STAGES else protocol_named(name)


def protocol_by_class(class_name: str, likely: Iterable[str] = ()) -> tuple[str, type[Protocol]] | None:
    """Return name and class of the protocol whose class is called `class_name`, as in journals.

    Args:
        class_name: The name of the class.
        likely: Names of protocols that are tried first.

    Returns:
        Name and class, or None if no installed protocol has such a class.
    """
    for name in (*likely, *_STAGES, DEFAULT_COST_PROTOCOL):
        with suppress(UnknownProtocolError):
            protocol = protocol_or_stage(name)
            if protocol.__name__ == class_name:
                return name, protocol
    for offer in installed_protocols():
        if offer.protocol is not None and offer.protocol.__name__ == class_name:
            return offer.name, offer.protocol
    return None


def _offer(entry: EntryPoint, namesakes: Sequence[EntryPoint]) -> InstalledProtocol:
    found = load_entry_point(entry, namesakes, _fault)
    return InstalledProtocol(entry, cast("type[Protocol] | None", found.what), found.broken)


def _fault(loaded: object) -> str:
    """Return why `loaded` cannot be used as a protocol; empty if it can."""
    if not (isinstance(loaded, type) and issubclass(loaded, Protocol)):
        return "is not a subclass of Protocol"
    # Methods of a compiled class are never marked as abstract.
    missing = {name for name in ("start", "receive") if getattr(loaded, name) is getattr(Protocol, name)}
    missing.update(getattr(loaded, "__abstractmethods__", ()))
    if missing:
        return f"does not define {' and '.join(sorted(missing))}"
    if not hasattr(loaded, "messages"):
        return "does not declare its messages"
    declared: tuple[object, object] = (loaded.traits, loaded.settings)
    traits, settings = declared
    if not (isinstance(traits, Traits) and isinstance(settings, Settings)):
        wrong = (
            "settings that are not of the class Settings"
            if isinstance(traits, Traits)
            else "traits that are not of the class Traits"
        )
        return f"declares {wrong}"
    if traits.dynamic is not issubclass(loaded, DynamicProtocol):
        return "must be dynamic if, and only if, it is a DynamicProtocol"
    return ""
