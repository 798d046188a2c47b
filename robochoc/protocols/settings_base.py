"""The base of all protocols' settings."""

from __future__ import annotations

from typing import ClassVar

import msgspec


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The base of a protocol's settings (`--set NAME=VALUE`): fields of simple types, each with its default.

    A subclass's docstring explains its fields; `robochoc protocols NAME` shows it. `__post_init__` raises `ValueError`
    for values that are not allowed. `may_be_infinite` names the fields that take `inf`.
    """

    may_be_infinite: ClassVar[frozenset[str]] = frozenset()


NO_SETTINGS = Settings()
