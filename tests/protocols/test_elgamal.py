"""Ciphers that are opened by all robots together, in the real group and in the one that tests are quick with."""

from __future__ import annotations

import sys

import pytest

from robochoc.protocols.key_stream import KeyStream
from robochoc.protocols.private.ed25519 import Ed25519, PrimeGroup
from robochoc.protocols.private.elgamal import TeamKey
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.toy_group import ToyGroup

GROUPS = looped("group", [Ed25519, ToyGroup])


def team(group: type[PrimeGroup], robots: int) -> list[TeamKey]:
    """Robots with their shares, which know the key of all."""
    keys = [TeamKey(group(), KeyStream(7, f"R{number}")) for number in range(robots)]
    joint = keys[0].share
    for key in keys[1:]:
        joint = key.added_to(joint)
    for key in keys:
        key.joint = joint
    return keys


@GROUPS
def test_a_bit_is_read_once_all_shares_are_off_and_not_before(group: type[PrimeGroup]) -> None:
    keys = team(group, 4)
    for bit in (True, False):
        cipher = keys[0].encrypt(bit=bit)
        for key in keys:
            assert not key.is_zero(cipher)
            cipher = key.stripped(key.pairs(cipher)[0])
        assert keys[0].is_zero(cipher) is not bit


@GROUPS
def test_a_renewed_cipher_is_of_the_same_bit_and_looks_different(group: type[PrimeGroup]) -> None:
    keys = team(group, 3)
    ciphers = [keys[0].encrypt(bit=False)]
    for key in keys:
        ciphers.append(key.renewed(key.pairs(ciphers[-1])[0]))
    halves = [half for cipher in ciphers for half in keys[0].pairs(cipher)[0]]
    assert len({*halves}) == len(halves)
    last = ciphers[-1]
    for key in keys:
        last = key.stripped(key.pairs(last)[0])
    assert keys[0].is_zero(last)


@GROUPS
@looped("wrong", [b"", b"\xff" * 8, b"\xff" * 32, b"\x02" + bytes(31)])
def test_what_is_no_element_is_refused(group: type[PrimeGroup], wrong: bytes) -> None:
    if group is ToyGroup and len(wrong) == Ed25519.size:
        wrong = wrong[:9]
    real = group()
    for refused in (
        lambda: team(group, 1)[0].added_to(wrong),
        lambda: team(group, 1)[0].checked(real.one + wrong),
        lambda: real.times(real.one, wrong),
        lambda: real.check(wrong),
    ):
        with pytest.raises(ValueError, match="not an element of the group"):
            refused()


def test_a_key_of_low_order_is_refused() -> None:
    # The neutral element, and the point (0, -1) of order 2.
    for point in (Ed25519.zero, ((1 << 255) - 20).to_bytes(32, "little")):
        with pytest.raises(ValueError, match="not an element of the group"):
            Ed25519().check(point)


def test_scalars_are_reduced_and_follow_from_the_keys() -> None:
    order = (1 << 252) + 27742317777372353535851937790883648493
    drawn = [Ed25519().scalar(KeyStream(seed, "A")) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]
    assert all(int.from_bytes(scalar, "little") < order for scalar in drawn)


def test_without_pynacl_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nacl", None)
    with pytest.raises(UnsupportedError, match=r"PyNaCl.*pip install 'robochoc\[private\]'"):
        Ed25519()
