"""The base of all protocols' settings."""

from __future__ import annotations

import msgspec


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The base of a protocol's settings (`--set NAME=VALUE`): fields of simple types, each with its default.

    A subclass's docstring explains its fields; `robochoc protocols NAME` shows it. `__post_init__` raises `ValueError`
    for values that are not allowed.
    """


NO_SETTINGS = Settings()
