"""Numbers of settings have limits, for all protocols."""

from __future__ import annotations

import pytest

from robochoc.protocols.settings import MOST, SettingsError, read_settings
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.cases import cases


def test_no_number_is_beyond_the_limit() -> None:
    numbers = [
        (name, field)
        for name in protocol_names()
        for field in protocol_named(name).settings.__struct_fields__
        if isinstance(getattr(protocol_named(name).settings, field), int | float)
    ]
    with cases() as each:
        for protocol, field in numbers:
            with each((protocol, field)):
                for value in (str(MOST + 1), "9" * 60, str(-MOST - 1), "1e400", "nan"):
                    with pytest.raises(SettingsError, match=field):
                        read_settings(protocol_named(protocol), {field: value})


def test_the_limit_is_told_and_a_long_number_cut() -> None:
    with pytest.raises(SettingsError, match=r"^cycles is 9{40}; it must be a number up to 1,000,000,000,000$"):
        read_settings(protocol_named("dsa"), {"cycles": "9" * 60})
    assert getattr(read_settings(protocol_named("dsa"), {"cycles": str(MOST)}), "cycles") == MOST  # noqa: B009 - of a subclass


def test_tables_that_no_machine_holds_cannot_be_asked_for() -> None:
    for protocol, field, most in [("p2-dpop", "ciphers", 10**6), ("p-dpop", "cells", 10**8)]:
        assert getattr(read_settings(protocol_named(protocol), {field: str(most)}), field) == most
        for wrong in (0, most + 1):
            with pytest.raises(SettingsError, match=f"{field} is {wrong}; it must be from 1 to {most:,}"):
                read_settings(protocol_named(protocol), {field: str(wrong)})
