"""A group with the interface of the real one, whose discrete logarithms anybody sees: quick, and no secret is safe."""

from __future__ import annotations

from robochoc.protocols.private.ed25519 import NO_ELEMENT, PrimeGroup, Secret

PRIME = (1 << 61) - 1


class ToyGroup(PrimeGroup):
    """The numbers below a prime, added."""

    size = 8
    zero = bytes(8)
    one = (1).to_bytes(8, "little")

    def scalar(self, secret: Secret) -> bytes:
        """Draw a scalar."""
        return _element(1 + secret(125) % (PRIME - 1))

    def multiple(self, scalar: bytes) -> bytes:
        """Return the scalar itself: the generator is 1."""
        return scalar

    def times(self, scalar: bytes, element: bytes) -> bytes:
        """Return the product."""
        return _element(_number(scalar) * _number(element))

    def check(self, element: bytes) -> None:
        """Refuse 0, and what is no number below the prime."""
        if not _number(element):
            raise ValueError(NO_ELEMENT)

    def plus(self, first: bytes, second: bytes) -> bytes:
        """Return the sum."""
        return _element(_number(first) + _number(second))

    def minus(self, first: bytes, second: bytes) -> bytes:
        """Return the difference."""
        return _element(_number(first) - _number(second))


def _number(element: bytes) -> int:
    number = int.from_bytes(element, "little")
    if len(element) != ToyGroup.size or number >= PRIME:
        raise ValueError(NO_ELEMENT)
    return number


def _element(number: int) -> bytes:
    return (number % PRIME).to_bytes(ToyGroup.size, "little")
