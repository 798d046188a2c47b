"""Key cards, and the filters that use them: what opens, and all that must not."""

from __future__ import annotations

import copy
import os
import pickle
import runpy
import tomllib
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from hypothesis import given
from hypothesis import strategies as st

from robochoc.authority.authority import Authority
from robochoc.authority.identity import Identity
from robochoc.authority.keyring import KeyCard, KeyCardError, KeyRing, UnknownPeerError, bound
from robochoc.communication import filters
from robochoc.communication.filters import (
    ChannelFilter,
    FilterStack,
    NotGenuineError,
    UnknownFilterError,
    filter_named,
)
from robochoc.communication.sealed import Sealed
from robochoc.communication.signed import Signed
from tests.support.authorities import HOUR, START, Clock, identity_of
from tests.support.cases import cases, looped
from tests.support.installed_packages import install_entry_points
from tests.support.program import ROOT

CONTEXT = b"run 7, A to B, 1"
STACKS: list[tuple[type[ChannelFilter], ...]] = [
    (Signed,),
    (Sealed,),
    (Signed, Sealed),
    (Sealed, Signed),
    (Sealed, Sealed),
]


@pytest.fixture(scope="module")
def identities(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Identity]:
    folder = tmp_path_factory.mktemp("filters")
    authority = Authority.create(folder / "authority", clock=Clock())
    return {name: identity_of(authority, name, folder / name) for name in "ABC"}


def rings(identities: dict[str, Identity], run: str = "7") -> dict[str, KeyRing]:
    """A key ring for each, with the cards of all others, as they come over the network."""
    made = {name: KeyRing(identity, run) for name, identity in identities.items()}
    for ring in made.values():
        for other in made.values():
            if other is not ring:
                ring.admit(KeyCard.decode(other.card.encode()), START)
    return made


@pytest.fixture(scope="module")
def three(identities: dict[str, Identity]) -> dict[str, KeyRing]:
    return rings(identities)


def resigned(card: KeyCard, identity: Identity) -> KeyCard:
    """`card` with a signature by the key of `identity`."""
    return msgspec.structs.replace(card, signature=identity.key.sign(card.signed_part(), ec.ECDSA(hashes.SHA256())))


@given(content=st.binary(max_size=200), context=st.binary(max_size=40))
def test_what_was_sealed_opens(three: dict[str, KeyRing], content: bytes, context: bytes) -> None:
    for stack in STACKS:
        sealed = FilterStack(three["A"], stack).seal("B", content, context)
        assert FilterStack(three["B"], stack).open("A", sealed, context) == content, stack


@given(content=st.binary(max_size=40), place=st.integers(0, 10**6), other=st.binary(max_size=200))
def test_any_flipped_bit_and_what_nobody_sealed_are_refused(
    three: dict[str, KeyRing], content: bytes, place: int, other: bytes
) -> None:
    for stack in STACKS:
        sealed = bytearray(FilterStack(three["A"], stack).seal("B", content, CONTEXT))
        bit = place % (8 * len(sealed))
        sealed[bit // 8] ^= 1 << bit % 8
        for bad in (bytes(sealed), other):
            with pytest.raises(NotGenuineError):
                FilterStack(three["B"], stack).open("A", bad, CONTEXT)


@looped("stack", STACKS)
def test_every_bit_and_every_part_of_one_message(
    three: dict[str, KeyRing], stack: Sequence[type[ChannelFilter]]
) -> None:
    opening = FilterStack(three["B"], stack)
    sealed = FilterStack(three["A"], stack).seal("B", b"Ok(3)", CONTEXT)
    flipped = ((int.from_bytes(sealed) ^ 1 << bit).to_bytes(len(sealed)) for bit in range(8 * len(sealed)))
    parts = (sealed[:size] for size in range(len(sealed)))
    for bad in (*flipped, *parts, sealed + b"\0", sealed[1:], sealed * 2):
        with pytest.raises(NotGenuineError):
            opening.open("A", bad, CONTEXT)


@looped("stack", STACKS)
def test_sender_receiver_and_context_are_bound(
    identities: dict[str, Identity], three: dict[str, KeyRing], stack: Sequence[type[ChannelFilter]]
) -> None:
    sealed = FilterStack(three["A"], stack).seal("B", b"Ok(3)", CONTEXT)
    at_b, at_c, at_a = (FilterStack(three[name], stack) for name in "BCA")
    for opening, sender, context in (
        (at_b, "C", CONTEXT),  # forged sender
        (at_c, "A", CONTEXT),  # another's inbox
        (at_a, "B", CONTEXT),  # sent back to where it came from
        (at_b, "A", b"run 7, A to B, 2"),  # a replay in another place
        (at_b, "A", b""),
        (at_b, "Stranger", CONTEXT),
        (FilterStack(rings(identities, "8")["B"], stack), "A", CONTEXT),  # another run
    ):
        with pytest.raises(NotGenuineError):
            opening.open(sender, sealed, context)
    assert at_b.open("A", sealed, CONTEXT) == b"Ok(3)"


def test_the_same_keys_in_another_run_would_not_open_either(identities: dict[str, Identity]) -> None:
    """The run's name is in what the two have agreed on, not only its fresh keys."""
    made = rings(identities)
    sealed = Sealed(made["A"]).seal("B", b"Ok(3)", CONTEXT)
    made["B"].run = "8"
    with pytest.raises(NotGenuineError):
        Sealed(made["B"]).open("A", sealed, CONTEXT)


def test_the_content_cannot_be_read_in_what_is_sealed(three: dict[str, KeyRing]) -> None:
    secret = b"my private constraint"
    assert secret not in FilterStack(three["A"], [Signed, Sealed]).seal("B", secret, CONTEXT)
    assert secret in Signed(three["A"]).seal("B", secret, CONTEXT)


def test_no_nonce_is_used_twice_also_by_two_filters_of_one_robot(three: dict[str, KeyRing]) -> None:
    """A message that is sent again is sealed again, perhaps with another content."""
    first, second = Sealed(three["A"]), Sealed(three["A"])
    sealed = [each.seal(to, b"same", CONTEXT) for _ in range(50) for each in (first, second) for to in "BC"]
    assert len({message[:8] for message in sealed}) == len(sealed) == len(set(sealed))


def test_the_two_directions_have_different_keys(three: dict[str, KeyRing]) -> None:
    there = three["A"].shared_secret("A", "B", b"x")
    assert there == three["B"].shared_secret("A", "B", b"x")
    others = [
        three["A"].shared_secret("B", "A", b"x"),
        three["A"].shared_secret("A", "C", b"x"),
        three["A"].shared_secret("A", "B", b"y"),
    ]
    assert len({there, *others}) == 4


def test_what_it_costs_on_the_wire(three: dict[str, KeyRing]) -> None:
    assert len(Signed(three["A"]).seal("B", b"12345", CONTEXT)) == 5 + 64
    assert len(Sealed(three["A"]).seal("B", b"12345", CONTEXT)) == 5 + 24


def test_a_key_ring_cannot_be_copied(three: dict[str, KeyRing]) -> None:
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="repeat its nonces"):
            copied(three["A"])


def test_a_key_ring_does_not_serve_in_another_process(
    identities: dict[str, Identity], monkeypatch: pytest.MonkeyPatch
) -> None:
    sealed = Sealed(rings(identities)["A"])
    sealed.seal("B", b"", CONTEXT)
    monkeypatch.setattr(os, "getpid", lambda: -1)
    with pytest.raises(RuntimeError, match="in the child"):
        sealed.seal("B", b"", CONTEXT)


def test_without_a_card_nothing_is_sealed_and_nothing_opens(identities: dict[str, Identity]) -> None:
    made = rings(identities)
    sealed = FilterStack(made["A"], [Signed, Sealed]).seal("B", b"Ok(3)", CONTEXT)
    made["A"].dismiss("B")
    made["B"].dismiss("A")
    with pytest.raises(UnknownPeerError, match="no key card of B"):
        Sealed(made["A"]).seal("B", b"Ok(3)", CONTEXT)
    for stack in ([Signed], [Sealed], [Signed, Sealed]):
        with pytest.raises(NotGenuineError, match="no key card of A"):
            FilterStack(made["B"], stack).open("A", sealed, CONTEXT)


def test_a_robot_that_comes_back_has_a_new_card(identities: dict[str, Identity]) -> None:
    made = rings(identities)
    opening = FilterStack(made["B"], [Signed, Sealed])
    old = FilterStack(made["A"], [Signed, Sealed]).seal("B", b"old", CONTEXT)
    assert opening.open("A", old, CONTEXT) == b"old"
    back = KeyRing(identities["A"], "7")
    back.admit(made["B"].card, START)
    made["B"].admit(back.card, START)
    assert opening.open("A", FilterStack(back, [Signed, Sealed]).seal("B", b"new", CONTEXT), CONTEXT) == b"new"
    with pytest.raises(NotGenuineError):
        opening.open("A", old, CONTEXT)


def test_cards_that_prove_nothing(identities: dict[str, Identity], tmp_path: Path) -> None:
    a, b = identities["A"], identities["B"]
    ring, card = KeyRing(b, "7"), KeyRing(a, "7").card
    changed = msgspec.structs.replace
    other = Authority.create(tmp_path / "other", clock=Clock())
    stranger = KeyRing(identity_of(other, "A", tmp_path / "a"), "7").card
    own = ring.card

    bad: list[tuple[KeyCard, str, float]] = [
        (stranger, "has not issued", START),
        (card, "not now", START + 25 * HOUR),
        (card, "not now", START - HOUR),
        (changed(card, name="C"), "not signed", START),
        (resigned(changed(card, name="C"), a), "certificate of A", START),
        (changed(card, certificate=own.certificate), "not signed", START),
        (resigned(card, b), "not signed", START),
        (changed(card, signing=own.signing), "not signed", START),
        (changed(card, sealing=own.sealing), "not signed", START),
        (changed(card, run="8"), "not signed", START),
        (changed(card, signature=b""), "not signed", START),
        (changed(card, certificate=b"rubbish"), "not a certificate", START),
        (KeyRing(a, "6").card, "another run", START),
        (resigned(changed(card, signing=b"short"), a), "32 bytes", START),
        (resigned(changed(card, sealing=bytes(33)), a), "32 bytes", START),
        (resigned(changed(card, sealing=bytes(32)), a), "is not a valid key", START),  # the point 0: of small order
    ]
    with cases() as each:
        for number, (one, why, now) in enumerate(bad):
            with each(f"{number} {why}"), pytest.raises(KeyCardError, match=why):
                ring.admit(one, now)
    with pytest.raises(UnknownPeerError):
        ring.card_of("A")
    ring.admit(card, START)
    assert ring.card_of("A") == card


@given(st.binary(max_size=200))
def test_no_bytes_make_decoding_a_card_fail_otherwise(content: bytes) -> None:
    with pytest.raises(KeyCardError):
        KeyCard.decode(content)


def test_a_card_is_small(identities: dict[str, Identity]) -> None:
    assert len(KeyRing(identities["A"], "7").card.encode()) < 1200
    with pytest.raises(KeyCardError, match="more than the maximum"):
        KeyCard.decode(bytes(9000))


@given(st.lists(st.binary(max_size=5)), st.lists(st.binary(max_size=5)))
def test_parts_that_are_bound_together_can_be_told_apart(one: list[bytes], other: list[bytes]) -> None:
    assert (bound(*one) == bound(*other)) == (one == other)


class Backwards(ChannelFilter):
    """A user's own; it fails on what is empty."""

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        del receiver, context
        return content[::-1]

    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        del sender, context
        return bytes([content[0], *content[1:]])[::-1]


class Half(ChannelFilter):
    """It cannot open."""

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        del receiver, context
        return content


def test_filters_seal_in_their_order_and_open_in_reverse(three: dict[str, KeyRing]) -> None:
    sealed = FilterStack(three["A"], [Backwards, Signed]).seal("B", b"Ok(3)", CONTEXT)
    assert sealed.endswith(b")3(kO")
    assert FilterStack(three["B"], [Backwards, Signed]).open("A", sealed, CONTEXT) == b"Ok(3)"
    with pytest.raises(NotGenuineError):
        FilterStack(three["B"], [Signed, Backwards]).open("A", sealed, CONTEXT)
    assert FilterStack(three["A"], []).seal("B", b"Ok(3)", CONTEXT) == b"Ok(3)"


def test_a_filter_that_fails_has_not_opened(three: dict[str, KeyRing]) -> None:
    with pytest.raises(NotGenuineError, match="Backwards failed: IndexError"):
        FilterStack(three["B"], [Backwards]).open("A", b"", CONTEXT)


def test_the_filter_in_the_docs_works(three: dict[str, KeyRing], tmp_path: Path) -> None:
    text = (ROOT / "docs" / "guides" / "security.md").read_text()
    (tmp_path / "packed.py").write_text(text.partition("```python\n")[2].partition("```")[0])
    packed = runpy.run_path(str(tmp_path / "packed.py"))["Packed"]
    sealing, opening = (FilterStack(three[name], [packed, Sealed]) for name in "AB")
    assert opening.open("A", sealing.seal("B", b"Ok(3)" * 100, CONTEXT), CONTEXT) == b"Ok(3)" * 100
    for bad in (sealing.seal("B", bytes(2_000_000), CONTEXT), Sealed(three["A"]).seal("B", b"not packed", CONTEXT)):
        with pytest.raises(NotGenuineError):
            opening.open("A", bad, CONTEXT)


def test_the_package_offers_the_two(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"][filters.GROUP]
    install_entry_points(monkeypatch, filters.GROUP, **ours)
    assert filter_named("sealed") is Sealed
    assert filter_named("signed") is Signed
    with pytest.raises(UnknownFilterError, match="only: sealed, signed; did you mean 'signed'"):
        filter_named("Sigend")


def test_what_others_offer_may_be_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    install_entry_points(
        monkeypatch,
        filters.GROUP,
        backwards="tests.unit.authority.test_filters:Backwards",
        half="tests.unit.authority.test_filters:Half",
        gone="nowhere.to:Find",
        function="tests.support.installed_packages:install_entry_points",
        twice=["tests.unit.authority.test_filters:Backwards", "tests.unit.authority.test_filters:Half"],
    )
    assert filter_named("backwards").__name__ == "Backwards"
    for name, why in {
        "half": "does not define open",
        "gone": "cannot be imported: ModuleNotFoundError",
        "function": "is not a subclass of ChannelFilter",
        "twice": "several packages",
    }.items():
        with pytest.raises(UnknownFilterError, match=why):
            filter_named(name)
