"""The settings of a protocol, as text: which ones there are, and whether they have values that it accepts."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings_base import Settings
from robochoc.system.decode_errors import describe_decode_error


class SettingsError(ValueError):
    """A setting that the protocol does not have, or a value that it does not accept."""


MOST = 10**12
"""No number of a setting is higher, but for `inf` where the protocol takes it (`Settings.may_be_infinite`)."""


def equip(protocol: Protocol, given: Mapping[str, str]) -> None:
    """Give one robot's protocol the settings that are `given`. Raises `SettingsError`."""
    if given:
        # For mypyc the class has the settings, and its objects have no others. Those with settings are not compiled.
        setattr(protocol, "settings", settings_of(type(protocol), given))  # noqa: B010


def settings_of(protocol: type[Protocol], given: Mapping[str, str]) -> Settings:
    """Return the settings of `protocol`: the `given` ones, and defaults for the others. Raises `SettingsError`."""
    known = type(protocol.settings)
    names = known.__struct_fields__
    for name in given:
        if name not in names:
            there = f"it has {', '.join(names)}" if names else "it has no settings"
            raise SettingsError(f"{name!r} is no setting of this protocol: {there}")
    try:
        settings = msgspec.convert(dict(given), known, strict=False)
    except msgspec.ValidationError as error:
        raise SettingsError(describe_decode_error(error, known)) from None
    for name in given:
        value = getattr(settings, name)
        infinite = given[name] == "inf" and name in known.may_be_infinite
        if isinstance(value, int | float) and not (-MOST <= value <= MOST or infinite):
            raise SettingsError(f"{name} is a number up to {MOST:,}, not {given[name][:40]}")
    return settings
