"""The channel filter `sealed`: only the receiver can read a message, and only sender or receiver can have written it.

Messages are encrypted by ChaCha20-Poly1305 (RFC 8439) with a key that sender and receiver have agreed on for this run
and this direction (`KeyRing.shared_secret`). The context is the associated data. The sender's key ring uses each nonce
only once, so a message that is changed and sealed again has another nonce. A message grows by 24 bytes.
"""

from __future__ import annotations

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

from robochoc.authority.keyring import KeyCard, KeyRing, UnknownPeerError
from robochoc.communication.filters import ChannelFilter, NotGenuineError

_PURPOSE = b"robochoc sealed 1"
_NUMBER_BYTES = 8
_PADDING = bytes(4)
"""Pads the number to a nonce of 12 bytes."""


class Sealed(ChannelFilter):
    """Encrypts the content, and prepends the nonce."""

    def __init__(self, ring: KeyRing) -> None:
        super().__init__(ring)
        self._ciphers: dict[tuple[str, str], tuple[KeyCard, ChaCha20Poly1305]] = {}

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """See `ChannelFilter.seal`."""
        cipher = self._cipher(self.ring.name, receiver)
        number = self.ring.next_number().to_bytes(_NUMBER_BYTES, "big")
        return number + cipher.encrypt(_PADDING + number, content, context)

    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """See `ChannelFilter.open`."""
        number, encrypted = content[:_NUMBER_BYTES], content[_NUMBER_BYTES:]
        if len(number) < _NUMBER_BYTES:
            raise NotGenuineError("the message is too short")
        try:
            return self._cipher(sender, self.ring.name).decrypt(_PADDING + number, encrypted, context)
        except UnknownPeerError as error:
            raise NotGenuineError(str(error)) from error
        except InvalidTag as error:
            text = "the message was changed, or not sealed by this sender for this receiver and context"
            raise NotGenuineError(text) from error

    def _cipher(self, sender: str, receiver: str) -> ChaCha20Poly1305:
        """Return the cipher for this direction, derived from the peer's current key card."""
        card = self.ring.card_of(receiver if sender == self.ring.name else sender)
        known = self._ciphers.get((sender, receiver))
        if known is None or known[0] is not card:
            known = (card, ChaCha20Poly1305(self.ring.shared_secret(sender, receiver, _PURPOSE)))
            self._ciphers[sender, receiver] = known
        return known[1]
