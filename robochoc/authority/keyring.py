"""Key cards and key rings, with which robots authenticate each other's messages end to end.

For each run, a robot creates two new key pairs: Ed25519 (RFC 8032) for signatures, X25519 (RFC 7748) for agreement on
secrets. The private keys never leave its memory. The robot's card contains the public keys, signed with the key of its
certificate. Everyone with the Authority's certificate can check a card, however it was transferred. After the run the
private keys are deleted, so recorded messages cannot be decrypted later, even with the key of a certificate.
"""

from __future__ import annotations

import os
from itertools import count
from typing import NoReturn, Self, SupportsIndex

import msgspec
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from robochoc.authority.certificates import CertificateError, check_issued, holder_of, pem, read_certificate, utc_time
from robochoc.authority.identity import Identity
from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.system.errors import RobochocError

_PUBLIC_BYTES = 32
_LARGEST_CARD_BYTES = 8192
_SECRET_BYTES = 32


class KeyCardError(RobochocError, ValueError):
    """The key card is not valid."""


class UnknownPeerError(RobochocError, LookupError):
    """No card has been admitted for the robot."""


class KeyCard(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The public keys of the robot `name` for the run `run`, signed (ECDSA, SHA-256) with its certificate's key."""

    name: str
    run: str
    signing: bytes
    """Ed25519, 32 bytes."""
    sealing: bytes
    """X25519, 32 bytes."""
    certificate: bytes
    """PEM."""
    signature: bytes

    def encode(self) -> bytes:
        """Return the card as msgpack, about 1,000 bytes."""
        return msgspec.msgpack.encode(self)

    @classmethod
    def decode(cls, content: bytes) -> Self:
        """Return the card in `content`, to be checked by `KeyRing.admit`. Raises `KeyCardError`."""
        if len(content) > _LARGEST_CARD_BYTES:
            raise KeyCardError(f"the key card has {len(content)} bytes, more than the maximum of {_LARGEST_CARD_BYTES}")
        try:
            return msgspec.msgpack.decode(content, type=cls)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            raise KeyCardError(f"invalid key card: {error}") from error

    def signed_part(self) -> bytes:
        """Return the signed bytes of the card."""
        return bound(b"robochoc key card 1", self.name.encode(), self.run.encode(), self.signing, self.sealing)


class KeyRing:
    """The keys of the robot `own` for `run`, and the cards of its peers.

    A key ring belongs to one process and cannot be copied, or used in a forked child, since a copy would repeat numbers
    that must be unique.
    """

    def __init__(self, own: Identity, run: str) -> None:
        self.name = own.name
        self.run = run
        self._ca = own.ca
        self._signing = Ed25519PrivateKey.generate()
        self._sealing = X25519PrivateKey.generate()
        self._peers: dict[str, KeyCard] = {}
        self._numbers = count()
        self._process = os.getpid()
        public = (self._signing.public_key().public_bytes_raw(), self._sealing.public_key().public_bytes_raw())
        unsigned = KeyCard(own.name, run, *public, pem(own.certificate), b"")
        signature = own.key.sign(unsigned.signed_part(), ec.ECDSA(hashes.SHA256()))
        self.card = msgspec.structs.replace(unsigned, signature=signature)

    def admit(self, card: KeyCard, now: float) -> None:
        """Accept `card` at the Unix time `now`, replacing an older card of the robot.

        Raises `KeyCardError` if the card's certificate was not issued by the Authority, is not valid now or has another
        name, if the signature is wrong, or if the card is from another run.
        """
        who = on_one_line(shortened(card.name))
        try:
            certificate = read_certificate(card.certificate)
            proven = check_issued(certificate, self._ca, utc_time(now))
            holder_of(certificate).verify(card.signature, card.signed_part(), ec.ECDSA(hashes.SHA256()))
        except CertificateError as error:
            raise KeyCardError(f"the key card of {who}: {error}") from error
        except (InvalidSignature, UnicodeEncodeError) as error:
            raise KeyCardError(f"the key card of {who} is not signed with the key in its certificate") from error
        if proven != card.name:
            raise KeyCardError(f"the key card of {who} contains the certificate of {on_one_line(shortened(proven))}")
        if card.run != self.run:
            raise KeyCardError(f"the key card of {who} is from another run")
        if {len(card.signing), len(card.sealing)} != {_PUBLIC_BYTES}:
            raise KeyCardError(f"the keys on the card of {who} must have {_PUBLIC_BYTES} bytes each")
        try:
            self._sealing.exchange(X25519PublicKey.from_public_bytes(card.sealing))
        except ValueError as error:  # a point of small order, for which the agreed secret would be public
            raise KeyCardError(f"the sealing key on the card of {who} is not a valid key") from error
        self._peers[card.name] = card

    def dismiss(self, name: str) -> None:
        """Remove the card of the robot `name`, which was revoked or has left."""
        self._peers.pop(name, None)

    def card_of(self, name: str) -> KeyCard:
        """Return the card of `name`. Raises `UnknownPeerError`."""
        try:
            return self._peers[name]
        except KeyError:
            raise UnknownPeerError(f"no key card of {on_one_line(shortened(name))} has been accepted") from None

    def sign(self, content: bytes) -> bytes:
        """Return an Ed25519 signature of `content` (64 bytes)."""
        return self._signing.sign(content)

    def is_signed(self, name: str, signature: bytes, content: bytes) -> bool:
        """Return whether `signature` is a signature of `content` by `name`. Raises `UnknownPeerError`."""
        card = self.card_of(name)
        try:
            Ed25519PublicKey.from_public_bytes(card.signing).verify(signature, content)
        except (InvalidSignature, ValueError):
            return False
        return True

    def shared_secret(self, sender: str, receiver: str, purpose: bytes) -> bytes:
        """Return the 32 secret bytes shared by `sender` and `receiver`, one of which is this robot.

        The secret results from X25519, then HKDF with SHA-256 (RFC 5869) over the run, names, public keys and
        `purpose`. The opposite direction has another secret. Raises `UnknownPeerError`.
        """
        peer = self.card_of(receiver if sender == self.name else sender)
        cards = (self.card, peer) if sender == self.name else (peer, self.card)
        agreed = bound(
            purpose, self.run.encode(), sender.encode(), receiver.encode(), *(card.sealing for card in cards)
        )
        secret = self._sealing.exchange(X25519PublicKey.from_public_bytes(peer.sealing))
        return HKDF(hashes.SHA256(), _SECRET_BYTES, salt=None, info=agreed).derive(secret)

    def next_number(self) -> int:
        """Return a number, for nonces, that this key ring has not returned before.

        Raises `RuntimeError` in a forked child, where numbers would be repeated.
        """
        if os.getpid() != self._process:
            raise RuntimeError(
                "a key ring can only be used in the process that created it: create another one in the child process"
            )
        return next(self._numbers)

    def __reduce_ex__(self, _protocol: SupportsIndex) -> NoReturn:
        raise TypeError("a key ring cannot be copied, since the copy would repeat its nonces: create another key ring")


def bound(*parts: bytes) -> bytes:
    """Return an injective encoding of `parts`: different lists never have the same encoding."""
    return b"".join(len(part).to_bytes(8, "big") + part for part in parts)
