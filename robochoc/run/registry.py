"""Protocols by name: from installed packages (entry points `robochoc.protocols`), and from the running program."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import NamedTuple, cast

from robochoc.protocols.dynamic import DynamicProtocol
from robochoc.protocols.local_search.rounds import Rounds
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.disac import DisAC
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import AUTO, CENTRAL, DEFAULT_COST_PROTOCOL, FIRST_FIT, PREPROCESSING, ROUNDS
from robochoc.system.entry_points import EntryPoint
from robochoc.system.errors import OptionError, OptionTypeError, RobochocError
from robochoc.system.installed import (
    all_entry_points,
    entry_point_names,
    entry_points_named,
    load_entry_point,
    not_installed_message,
)
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.pydcop_words import PROTOCOLS

GROUP = "robochoc.protocols"
_NAME = re.compile(r"[A-Za-z0-9]+(-[A-Za-z0-9]+)*")
_STAGES: dict[str, type[Protocol]] = {FIRST_FIT: FirstFit, PREPROCESSING: DisAC, ROUNDS: Rounds}
"""Protocols for single stages of a run, and for journals of games. Users cannot choose them."""


class UnknownProtocolError(RobochocError, LookupError):
    """Raised if no installed package offers a protocol with that name, or the protocol cannot be used."""


@dataclass(frozen=True)
class InstalledProtocol:
    """A protocol offered by a package: the class of `entry`, or the reason why it cannot be used."""

    entry: EntryPoint
    protocol: type[Protocol] | None
    broken: str = ""
    """The reason why the protocol cannot be used. Empty if it can be used."""

    @property
    def name(self) -> str:
        """The protocol's name."""
        return self.entry.name

    @property
    def place(self) -> str:
        """The module and the class, as declared by the package: `robochoc.protocols.satisfaction.abt:ABT`."""
        return self.entry.value

    @property
    def package(self) -> str:
        """The name and the version of the package."""
        return f"{self.entry.dist.name} {self.entry.dist.version}" if self.entry.dist else "this program"


class _Registered(NamedTuple):
    """A protocol registered by the running program, in the form of an entry point."""

    name: str
    protocol: type[Protocol]

    @property
    def value(self) -> str:
        return _place(self.protocol)

    @property
    def dist(self) -> None:
        return None

    def load(self) -> object:
        return self.protocol


REGISTERED: dict[str, _Registered] = {}
"""The protocols that the running program has registered."""


def register(name: str, protocol: type[Protocol]) -> None:
    """Register a protocol of this program under a name, as if an installed package offered it.

    The runtimes `simulator` and `processes` can use it; programs started by the runtime `network` cannot. Registering
    another class under the same name replaces the first class, so a notebook cell can be run again.

    Args:
        name: The protocol's name in `solve`: letters, digits and hyphens.
        protocol: A subclass of `robochoc.protocols.Protocol`.

    Raises:
        OptionError: if the class cannot be used, the name is invalid, or an installed package offers the name.
    """
    if fault := class_fault(protocol):
        raise OptionTypeError(f"{getattr(protocol, '__qualname__', repr(protocol))} {fault}")
    if not _NAME.fullmatch(name):
        raise OptionError(f"{name!r} is not a valid name of a protocol; use letters, digits and hyphens")
    if name in {CENTRAL, AUTO, *_STAGES} or entry_points_named(GROUP, name):
        raise OptionError(f"an installed protocol is called {name!r}: register this one under another name")
    REGISTERED[name] = _Registered(name, protocol)


def name_of_class(protocol: type[Protocol]) -> str:
    """Return the name of a protocol's class. A class that no package offers is registered under its name in lower case.

    Raises:
        OptionError: for the same reasons as in `register`.
    """
    installed = [entry.name for entry, _ in all_entry_points(GROUP) if entry.value == _place(protocol)]
    registered = [one.name for one in REGISTERED.values() if one.protocol is protocol]
    if names := installed + registered:
        return names[0]
    name = protocol.__name__.lower().replace("_", "-")
    register(name, protocol)
    return name


def is_registered(name: str) -> bool:
    """Return whether the running program has registered a protocol called `name`."""
    return name in REGISTERED


def _place(protocol: type[Protocol]) -> str:
    return f"{protocol.__module__}:{protocol.__qualname__}"


def _entries(name: str) -> Sequence[EntryPoint]:
    return [REGISTERED[name]] if name in REGISTERED else entry_points_named(GROUP, name)


def protocol_names() -> tuple[str, ...]:
    """Return the sorted names of all protocols: ours, those of other packages, and registered ones."""
    return tuple(sorted({*entry_point_names(GROUP), *REGISTERED}))


_SPELLINGS = {CENTRAL, AUTO}
"""A cache of names in the spelling of their packages, because looking up installed protocols takes 0.1 ms each time."""


def installed_spelling(name: str) -> str:
    """Return `name` in the spelling of its package (`ABT` becomes `abt`), or unchanged if no or several names match."""
    if name in _SPELLINGS or _entries(name):
        _SPELLINGS.add(name)
        return name
    spellings = [one for one in (*protocol_names(), CENTRAL, AUTO) if one.lower() == name.lower()]
    return spellings[0] if len(spellings) == 1 else name


def installed_protocols() -> tuple[InstalledProtocol, ...]:
    """Return all protocols offered by packages, sorted by name. Unusable ones are included, with the reason."""
    installed = [_offer(entry, namesakes) for entry, namesakes in all_entry_points(GROUP)]
    registered = [_offer(entry, [entry]) for entry in REGISTERED.values()]
    return tuple(sorted(installed + registered, key=lambda one: one.name))


def unknown_protocol(name: str) -> str:
    """Return the error text for the unknown protocol `name`, with suggestions."""
    if instead := PROTOCOLS.get(name.lower()):
        return f"no protocol {name!r} is installed; instead of this algorithm of pyDCOP, use {instead}"
    if name.lower() in {CENTRAL, AUTO}:
        return f"{name!r} cannot be used here; name a distributed protocol: 'robochoc protocols' lists them"
    return not_installed_message(GROUP, "protocol", name, also=(CENTRAL, AUTO), listed_by="robochoc protocols")


def installed_protocol(name: str) -> InstalledProtocol:
    """Return the protocol called `name`. Raises `UnknownProtocolError`, which suggests others."""
    found = _entries(name)
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
    """Return the protocol called `name`. It may be a stage that users cannot choose (`_STAGES`)."""
    return _STAGES[name] if name in _STAGES else protocol_named(name)


def protocol_by_class(class_name: str, likely: Iterable[str] = ()) -> tuple[str, type[Protocol]] | None:
    """Return the name and the class of the protocol whose class is called `class_name`, as in journals.

    Args:
        class_name: The name of the class.
        likely: Names of protocols that are tried first.

    Returns:
        The name and the class, or None if no installed protocol has such a class.
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
    found = load_entry_point(entry, namesakes, class_fault)
    return InstalledProtocol(entry, cast("type[Protocol] | None", found.what), found.broken)


def class_fault(loaded: object) -> str:
    """Return the reason why `loaded` cannot be used as a protocol; empty if it can be used."""
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
