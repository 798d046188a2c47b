"""Addresses of masters, as they are written on command lines."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.run.networked.address import DEFAULT_PORT, Address, AddressError


def test_a_host_and_perhaps_a_port() -> None:
    for text, place in [
        ("192.168.1.14", Address("192.168.1.14", DEFAULT_PORT)),
        ("192.168.1.14:7000", Address("192.168.1.14", 7000)),
        ("master.example:7447", Address("master.example", 7447)),
        ("[fe80::1]:7447", Address("fe80::1", 7447)),
        ("[::1]", Address("::1", DEFAULT_PORT)),
        ("::1", Address("::1", DEFAULT_PORT)),
        ("host:", Address("host", DEFAULT_PORT)),
    ]:
        assert Address.parse(text) == place
        assert Address.parse(str(place)) == place


def test_anything_else_is_told_what_was_expected() -> None:
    for text in ["", ":7447", "host:0", "host:65535", "host:x", "a b:1", "tcp/host:1", "host:7447:1", "-h:1", "h-:1"]:
        with pytest.raises(AddressError, match="HOST:PORT"):
            Address.parse(text)


@given(st.text(max_size=40))
def test_no_text_does_worse_than_to_be_refused(text: str) -> None:
    try:
        place = Address.parse(text)
    except AddressError:
        return
    assert 0 < place.port < place.enrolment_port < 65536


def test_an_address_that_stands_for_all_is_the_name_of_none() -> None:
    for host, anywhere in [("127.0.0.1", False), ("0.0.0.0", True), ("::", True), ("master.example", False)]:  # noqa: S104
        assert Address(host).anywhere is anywhere
