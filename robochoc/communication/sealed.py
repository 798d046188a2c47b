"""The channel filter `sealed`: only the receiver can read a message, and only the two of them can have written it.

ChaCha20-Poly1305 (RFC 8439) under a key that sender and receiver have agreed on for this run and this direction
(`KeyRing.shared_secret`), with the context as associated data. The nonce is a number that the sender's key ring gives
once only, so that a message sealed again, and changed meanwhile, has another one. 24 bytes more a message.
"""

from __future__ import annotations

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

from robochoc.authority.keyring import KeyCard, KeyRing, UnknownPeerError
from robochoc.communication.filters import ChannelFilter, NotGenuineError

_PURPOSE = b"robochoc sealed 1"
_NUMBER_BYTES = 8
_PADDING = bytes(4)
"""A nonce has 12 bytes."""


class Sealed(ChannelFilter):
    """Encrypts the content, and puts the nonce's number before it."""

    def __init__(self, ring: KeyRing) -> None:
        super().__init__(ring)
        self._ciphers: dict[tuple[str, str], tuple[KeyCard, ChaCha20Poly1305]] = {}

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """Number, encrypted content, tag."""
        cipher = self._cipher(self.ring.name, receiver)
        number = self.ring.next_number().to_bytes(_NUMBER_BYTES, "big")
        return number + cipher.encrypt(_PADDING + number, content, context)

    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """Return the content, if `sender` has sealed it for this robot and `context`. Raises `NotGenuineError`."""
        number, encrypted = content[:_NUMBER_BYTES], content[_NUMBER_BYTES:]
        if len(number) < _NUMBER_BYTES:
            raise NotGenuineError("it is too short")
        try:
            return self._cipher(sender, self.ring.name).decrypt(_PADDING + number, encrypted, context)
        except UnknownPeerError as error:
            raise NotGenuineError(str(error)) from error
        except InvalidTag as error:
            raise NotGenuineError(
                "it was changed, or not sealed by this sender for this receiver and context"
            ) from error

    def _cipher(self, sender: str, receiver: str) -> ChaCha20Poly1305:
        """Return the cipher of this direction; made anew when the peer has a new card."""
        card = self.ring.card_of(receiver if sender == self.ring.name else sender)
        known = self._ciphers.get((sender, receiver))
        if known is None or known[0] is not card:
            known = (card, ChaCha20Poly1305(self.ring.shared_secret(sender, receiver, _PURPOSE)))
            self._ciphers[sender, receiver] = known
        return known[1]
