"""The group in which private protocols encrypt: the points of prime order on Edwards25519, by libsodium.

Only this module uses PyNaCl (the extra `private`), which wraps libsodium. Points and scalars are 32 bytes, opaque to
other modules. Points that libsodium rejects, because they are off the curve or of low order, cause a `ValueError`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

from robochoc.solver.errors import UnsupportedError

if TYPE_CHECKING:
    from types import ModuleType

NEEDS = ("nacl", "pip install 'robochoc[private]'")
"""The module of PyNaCl, and how to install it (`Traits.needs`)."""
NO_ELEMENT = "these bytes are not an element of the group"
Secret = Callable[[int], int]
"""The type of `Protocol.secret`."""


class PrimeGroup(ABC):
    """A group of prime order in which discrete logarithms are hard, written additively."""

    size: int
    """The number of bytes of an element."""
    zero: bytes
    """The neutral element."""
    one: bytes
    """The generator."""

    @abstractmethod
    def scalar(self, secret: Secret) -> bytes:
        """Draw a scalar; all scalars are equally likely."""

    @abstractmethod
    def multiple(self, scalar: bytes) -> bytes:
        """Return the generator multiplied by `scalar`."""

    @abstractmethod
    def times(self, scalar: bytes, element: bytes) -> bytes:
        """Return `element` multiplied by `scalar`. Raises `ValueError` if it is not an element."""

    @abstractmethod
    def check(self, element: bytes) -> None:
        """Raise `ValueError` unless `element` is an element other than the neutral one."""

    @abstractmethod
    def plus(self, first: bytes, second: bytes) -> bytes:
        """Return the sum of two checked elements."""

    @abstractmethod
    def minus(self, first: bytes, second: bytes) -> bytes:
        """Return the difference of two checked elements."""


class Ed25519(PrimeGroup):
    """Edwards25519 by libsodium. Raises `UnsupportedError` if PyNaCl is not installed."""

    size = 32
    zero = b"\x01" + bytes(31)

    def __init__(self) -> None:
        self._sodium = _bindings()
        self.one = self.multiple(b"\x01" + bytes(31))

    def __deepcopy__(self, _: object) -> Ed25519:
        return self  # it never changes, and modules cannot be copied

    def scalar(self, secret: Secret) -> bytes:
        """Draw a scalar: 512 bits, reduced by libsodium."""
        return bytes(self._sodium.crypto_core_ed25519_scalar_reduce(secret(512).to_bytes(64, "little")))

    def multiple(self, scalar: bytes) -> bytes:
        """Return the base point multiplied by `scalar`."""
        return bytes(self._sodium.crypto_scalarmult_ed25519_base_noclamp(scalar))

    def times(self, scalar: bytes, element: bytes) -> bytes:
        """Return `element` multiplied by `scalar`. Raises `ValueError` if it is not a point of prime order."""
        return self._by(self._sodium.crypto_scalarmult_ed25519_noclamp, scalar, element)

    def check(self, element: bytes) -> None:
        """Raise `ValueError` unless `element` is a point of prime order."""
        if len(element) != self.size or not self._sodium.crypto_core_ed25519_is_valid_point(element):
            raise ValueError(NO_ELEMENT)

    def plus(self, first: bytes, second: bytes) -> bytes:
        """Return the sum of two points; raises `ValueError` for some invalid points."""
        return self._by(self._sodium.crypto_core_ed25519_add, first, second)

    def minus(self, first: bytes, second: bytes) -> bytes:
        """Return the difference of two points; raises `ValueError` for some invalid points."""
        return self._by(self._sodium.crypto_core_ed25519_sub, first, second)

    @staticmethod
    def _by(function: Callable[[bytes, bytes], bytes], first: bytes, second: bytes) -> bytes:
        try:
            return bytes(function(first, second))
        except (RuntimeError, TypeError, ValueError) as refused:  # these are also the errors that PyNaCl raises itself
            raise ValueError(NO_ELEMENT) from refused


def _bindings() -> ModuleType:
    """Import PyNaCl late: listing protocols does not need it."""
    try:
        from nacl import bindings  # noqa: PLC0415
    except ModuleNotFoundError as missing:
        raise UnsupportedError(f"this protocol encrypts with PyNaCl, which is not installed: {NEEDS[1]}") from missing
    return bindings
