"""Tokens, which a person carries from the Authority to a new robot so that the two can authenticate each other.

A token contains a secret, which the robot uses once, and the fingerprint of the Authority's certificate, by which the
robot recognises the Authority before it has a certificate. The text of a token is base32 in lower case (RFC 4648),
which can be read aloud, and in which no letter resembles a digit.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import secrets

from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

SECRET_BYTES = 20
FINGERPRINT_BYTES = 32


class TokenError(RobochocError, ValueError):
    """The text is not a complete token."""


@dataclass(frozen=True, repr=False)
class EnrolmentToken:
    """A single-use secret, and the SHA-256 fingerprint of the Authority's certificate."""

    secret: bytes
    fingerprint: bytes

    @classmethod
    def new(cls, fingerprint: bytes) -> EnrolmentToken:
        """Return a token with a random secret of 160 bits."""
        return cls(secrets.token_bytes(SECRET_BYTES), fingerprint)

    @classmethod
    def parse(cls, text: str) -> EnrolmentToken:
        """Parse a token, ignoring surrounding whitespace and case. Raises `TokenError`."""
        secret, dot, fingerprint = text.strip().partition(".")
        try:
            token = cls(_decoded(secret), _decoded(fingerprint))
        except (ValueError, binascii.Error):
            token = cls(b"", b"")
        if not dot or (len(token.secret), len(token.fingerprint)) != (SECRET_BYTES, FINGERPRINT_BYTES):
            raise TokenError("the token is incomplete: copy the whole output of 'robochoc authority enrol'")
        return token

    def __str__(self) -> str:
        return f"{_encoded(self.secret)}.{_encoded(self.fingerprint)}"

    def __repr__(self) -> str:
        """Return a text without the secret, since a token may appear in a traceback or a log."""
        return f"<Token of the Authority {self.fingerprint.hex()[:16]}>"


def digest(secret: bytes) -> str:
    """Return the digest of a secret, for storage by the Authority. A digest cannot be redeemed."""
    return hashlib.sha256(b"robochoc token\0" + secret).hexdigest()


def _encoded(content: bytes) -> str:
    return base64.b32encode(content).decode().rstrip("=").lower()


def _decoded(text: str) -> bytes:
    return base64.b32decode(text.upper() + "=" * (-len(text) % 8))
