"""The gate: when the router has to be opened anew, and with which rules."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import timedelta
from pathlib import Path

import pytest

from robochoc.authority.authority import Authority
from robochoc.authority.certificates import new_key, signing_request
from robochoc.authority.registry import Right, Role
from robochoc.communication.network.master_connection import ConnectionPolicy
from robochoc.communication.network.router import Router
from tests.support.authorities import Clock, identity_of

Rules = tuple[dict[str, tuple[str, ...]], Collection[str] | None]


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Rules]:
    """The rules of each router that is opened, one after the other; it is not."""
    rules: list[Rules] = []

    def note(_: Router, reach: Mapping[str, Sequence[str]], sniffers: Collection[str] | None = None) -> None:
        rules.append(({name: tuple(others) for name, others in reach.items()}, sniffers))

    monkeypatch.setattr(Router, "open", note)
    return rules


@pytest.fixture
def gate(authority: Authority, opened: list[Rules]) -> Iterator[ConnectionPolicy]:
    gate = ConnectionPolicy(authority, authority.master_identity(("127.0.0.1",)), "127.0.0.1:1", None, 1000)
    gate.sniffable = True
    gate.open()
    assert opened.pop() == ({}, ())
    yield gate
    gate.close()


def redeem(authority: Authority, secret: bytes, name: str) -> None:
    authority.redeem(secret, signing_request(new_key(), name))


def test_who_comes_with_a_token_from_before_needs_no_other_router(
    authority: Authority, gate: ConnectionPolicy, opened: list[Rules]
) -> None:
    token = authority.enrol("A")
    eye = authority.enrol("Eye", Role.OBSERVER, may=[Right.SNIFF])
    gate.follow()
    assert not gate.is_robot("A")
    assert not gate.may_sniff("Eye")
    redeem(authority, token.secret, "A")
    redeem(authority, eye.secret, "Eye")
    gate.follow()
    assert gate.is_robot("A")
    assert gate.may_sniff("Eye")
    assert opened == [({"A": (), "Eye": ()}, ("Eye",))]


def test_who_was_revoked_stays_out_until_the_new_token_is_shown(
    authority: Authority, gate: ConnectionPolicy, opened: list[Rules], tmp_path: Path
) -> None:
    """The router knows names only, and there is still a certificate in this one."""
    identity_of(authority, "A", tmp_path / "a")
    gate.follow()
    authority.revoke("A")
    gate.follow()
    token = authority.enrol("A")
    gate.follow()
    assert [rules for rules, _ in opened] == [{"A": ()}, {}]
    redeem(authority, token.secret, "A")
    gate.follow()
    assert opened[2:] == [({"A": ()}, ())]


def test_who_was_revoked_before_it_came_is_not_let_in(
    authority: Authority, gate: ConnectionPolicy, opened: list[Rules]
) -> None:
    authority.enrol("A")
    gate.follow()
    authority.revoke("A")
    gate.follow()
    assert [rules for rules, _ in opened] == [{"A": ()}, {}]


def test_a_certificate_that_has_expired_lets_nobody_in(
    authority: Authority, gate: ConnectionPolicy, opened: list[Rules], clock: Clock, tmp_path: Path
) -> None:
    identity_of(authority, "A", tmp_path / "a")
    gate.follow()
    clock.now += timedelta(days=2).total_seconds()
    authority.enrol("A")
    gate.follow()
    assert [rules for rules, _ in opened] == [{"A": ()}, {}]
