"""Settings of protocols (`--set NAME=VALUE`): their base class, and a parser for values given as text."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from typing import ClassVar, cast

import msgspec

from robochoc.system.decode_errors import describe_decode_error
from robochoc.system.errors import RobochocError

MOST = 10**12
"""The largest number that a setting accepts, except `inf` for fields in `Settings.may_be_infinite`."""


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The base class for the settings of a protocol: fields of simple types, each with a default.

    A subclass explains its fields in its docstring, which `robochoc protocols NAME` shows. `__post_init__` raises
    `ValueError` for invalid values. `may_be_infinite` names the fields that accept `inf`.
    """

    may_be_infinite: ClassVar[frozenset[str]] = frozenset()


NO_SETTINGS = Settings()


class SettingsError(RobochocError, ValueError):
    """An unknown setting, or an invalid value of a setting."""


class HasSettings(typing.Protocol):
    """The attributes of a protocol that concern its settings (`protocol.py` imports this module)."""

    @property
    def settings(self) -> Settings:
        """The default settings, or the given settings after `equip`."""


def equip(protocol: HasSettings, given: Mapping[str, str]) -> None:
    """Apply the `given` settings to one robot's protocol. Raises `SettingsError`."""
    if given:
        # mypyc treats settings as an attribute of the class: only `setattr` stores them on an object.
        setattr(protocol, "settings", read_settings(type(protocol), given))  # noqa: B010


def read_settings(protocol: type[HasSettings], given: Mapping[str, str]) -> Settings:
    """Return the settings of `protocol`: the `given` settings, and defaults for all others. Raises `SettingsError`."""
    known = type(cast("Settings", protocol.settings))
    names = known.__struct_fields__
    for name in given:
        if name not in names:
            there = f"it has {', '.join(names)}" if names else "it has no settings"
            raise SettingsError(f"{name!r} is not a setting of this protocol: {there}")
    try:
        settings = msgspec.convert(dict(given), known, strict=False)
    except msgspec.ValidationError as error:
        raise SettingsError(describe_decode_error(error, known)) from None
    for name in given:
        value = getattr(settings, name)
        infinite = given[name] == "inf" and name in known.may_be_infinite
        if isinstance(value, int | float) and not (-MOST <= value <= MOST or infinite):
            raise SettingsError(f"{name} is {given[name][:40]}; it must be a number up to {MOST:,}")
    return settings
