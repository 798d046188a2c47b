"""The channel filter `signed`: everybody can read a message, but only its sender can have written it.

Each message contains an Ed25519 signature (RFC 8032) of sender, receiver, context and content. It adds 64 bytes.
"""

from __future__ import annotations

from robochoc.authority.keyring import UnknownPeerError, bound
from robochoc.communication.filters import ChannelFilter, NotGenuineError

_PURPOSE = b"robochoc signed 1"
_SIGNATURE_BYTES = 64


class Signed(ChannelFilter):
    """Signs the content, and prepends the signature."""

    def seal(self, receiver: str, content: bytes, context: bytes) -> bytes:
        """See `ChannelFilter.seal`."""
        signature = self.ring.sign(_signed_part(self.ring.name, receiver, content, context))
        return signature + content

    def open(self, sender: str, content: bytes, context: bytes) -> bytes:
        """See `ChannelFilter.open`."""
        signature, plain = content[:_SIGNATURE_BYTES], content[_SIGNATURE_BYTES:]
        part = _signed_part(sender, self.ring.name, plain, context)
        try:
            genuine = self.ring.is_signed(sender, signature, part)
        except UnknownPeerError as error:
            raise NotGenuineError(str(error)) from error
        if not genuine:
            raise NotGenuineError("the signature is wrong")
        return plain


def _signed_part(sender: str, receiver: str, content: bytes, context: bytes) -> bytes:
    return bound(_PURPOSE, sender.encode(), receiver.encode(), context, content)
