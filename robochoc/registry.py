"""Protocols by name, as installed packages offer them under the entry point group `robochoc.protocols`."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from robochoc.protocols.protocol import DynamicProtocol, Protocol, Settings
from robochoc.protocols.traits import Traits

GROUP = "robochoc.protocols"


class UnknownProtocol(LookupError):  # noqa: N818 - named for what was asked for
    """No installed package offers a protocol of that name, or what it offers cannot be used."""


@dataclass(frozen=True)
class Offer:
    """What the package `package` offers as the protocol `name`: the class at `place`, or why there is none."""

    name: str
    place: str
    """Module and class, as the package names them: `robochoc.protocols.abt:ABT`."""
    package: str
    protocol: type[Protocol] | None
    broken: str = ""
    """Why it cannot be used; empty when it can."""


def protocol_names() -> tuple[str, ...]:
    """The names of all protocols that are installed, ours and others', sorted."""
    return tuple(sorted({entry.name for entry in entry_points(group=GROUP)}))


def offers() -> tuple[Offer, ...]:
    """All that installed packages offer, by name; what cannot be used too, with the reason."""
    found = sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
    return tuple(_offer(entry, [other for other in found if other.name == entry.name]) for entry in found)


def offer_named(name: str) -> Offer:
    """What is offered as `name`. Raises `UnknownProtocol`, which names those there are."""
    found = list(entry_points(group=GROUP, name=name))
    if not found:
        names = protocol_names()
        near = difflib.get_close_matches(name.lower(), names, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise UnknownProtocol(f"no protocol {name!r} is installed, only: {', '.join(names)}{hint}")
    return _offer(found[0], found)


def protocol_named(name: str) -> type[Protocol]:
    """The class of the protocol called `name`. Raises `UnknownProtocol`, which names those there are."""
    offer = offer_named(name)
    if offer.protocol is None:
        raise UnknownProtocol(f"{offer.place}, installed as protocol {name!r}, {offer.broken}")
    return offer.protocol


def _offer(entry: EntryPoint, namesakes: Sequence[EntryPoint]) -> Offer:
    """What stands behind `entry`: code of whoever wrote the package, which may fail in any way."""
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "unknown"
    if len(namesakes) > 1:
        places = " and ".join(sorted(f"{one.value} ({one.dist.name if one.dist else 'unknown'})" for one in namesakes))
        reason = f"is offered by several packages, and only one may: {places}"
        return Offer(entry.name, entry.value, package, None, reason)
    try:
        loaded = entry.load()
    except (Exception, SystemExit) as error:  # noqa: BLE001 - one broken package must not hide the others
        reason = f"cannot be imported: {type(error).__name__}: {error}"
        return Offer(entry.name, entry.value, package, None, reason)
    fault = _fault(loaded)
    return Offer(entry.name, entry.value, package, None if fault else loaded, fault)


def _fault(loaded: object) -> str:
    """Why `loaded` cannot be used as a protocol; empty when it can."""
    if not (isinstance(loaded, type) and issubclass(loaded, Protocol)):
        return "is no subclass of Protocol"
    if loaded.__abstractmethods__:
        return f"does not define {' and '.join(sorted(loaded.__abstractmethods__))}"
    if not hasattr(loaded, "messages"):
        return "does not declare its messages"
    declared: tuple[object, object] = (loaded.traits, loaded.settings)
    traits, settings = declared
    if not (isinstance(traits, Traits) and isinstance(settings, Settings)):
        wrong = "settings that are no Settings" if isinstance(traits, Traits) else "traits that are no Traits"
        return f"declares {wrong}"
    if traits.dynamic is not issubclass(loaded, DynamicProtocol):
        return "is to be dynamic if it is a DynamicProtocol, and only then"
    return ""
