"""Secret sharing in a prime field (Shamir: "How to share a secret", CACM 22, 1979).

A secret is the value at 0 of a random polynomial; the share of robot i (1, 2, ...) is its value at i. Robots that know
at most as many shares as the polynomial's degree learn nothing: for every secret there are equally many polynomials
with these shares. One more share determines the secret. Sums of shares are shares of the sum.

The field has 2^b - 1 elements, a Mersenne prime: a number of b random bits is a uniform element, except that 0 has two
representations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from operator import mul
from typing import Final

FIELD_BITS: Final = (3, 5, 7, 13, 17, 19, 31, 61, 89, 107, 127)
"""The supported values of b: 2^b - 1 is prime."""
_DRAWN_AT_ONCE: Final = 512


class Field:
    """The integers modulo the prime 2^`bits` - 1. Immutable."""

    def __init__(self, bits: int) -> None:
        if bits not in FIELD_BITS:
            raise ValueError(f"a field of 2^{bits} - 1 elements is not supported: use one of {FIELD_BITS} bits")
        self.bits = bits
        self.prime = (1 << bits) - 1
        self.width = math.ceil(bits / 8)
        """The number of bytes of an element in a message."""

    def __deepcopy__(self, _: object) -> Field:
        return self

    def draw(self, count: int, secret: Callable[[int], int]) -> list[int]:
        """Return `count` random elements; `secret` draws a number of a given bit length, at most 512."""
        bits, prime = self.bits, self.prime
        places = range(0, _DRAWN_AT_ONCE - bits + 1, bits)
        drawn = [secret(bits * len(places)) for _ in range(math.ceil(count / len(places)))]
        return [(number >> place & prime) % prime for number in drawn for place in places][:count]

    def share(self, secrets: Sequence[int], degree: int, robots: int, secret: Callable[[int], int]) -> list[list[int]]:
        """Return, for each of the `robots`, its shares of all `secrets`, by random polynomials of this `degree`."""
        prime, count = self.prime, len(secrets)
        random = self.draw(degree * count, secret)
        columns = [random[at : at + count] for at in range(0, degree * count, count)] + [secrets]
        found = []
        for place in range(1, robots + 1):
            values = columns[0]
            for column in columns[1:]:  # Horner's rule; the numbers stay small without a remainder in between
                values = [value * place + coefficient for value, coefficient in zip(values, column, strict=True)]
            found.append([value % prime for value in values])
        return found

    def combine(self, shares: Sequence[Sequence[int]]) -> list[int]:
        """Return the secrets, given the shares of robots 1, 2, ... (one more than the degree, or more)."""
        weights = _weights(self.prime, len(shares))
        return [sum(map(mul, weights, column)) % self.prime for column in zip(*shares, strict=True)]

    def pack(self, elements: Sequence[int]) -> bytes:
        """Return elements as bytes for a message."""
        return b"".join([one.to_bytes(self.width, "little") for one in elements])

    def unpack(self, packed: bytes, count: int) -> list[int]:
        """Return the elements in a message. Raises `ValueError` unless there are `count` elements of the field."""
        if len(packed) != count * self.width:
            raise ValueError(f"received {len(packed):,} bytes of shares, but expected {count * self.width:,}")
        found = [int.from_bytes(packed[at : at + self.width], "little") for at in range(0, len(packed), self.width)]
        if max(found, default=0) >= self.prime:
            raise ValueError("received a share that is not an element of the field")
        return found


@cache
def field_of(bits: int) -> Field:
    """Return the field with 2^`bits` - 1 elements."""
    return Field(bits)


@cache
def _weights(prime: int, points: int) -> tuple[int, ...]:
    """Return the factors of the values at 1, ..., `points` in the value at 0 of their polynomial (Lagrange)."""
    found = []
    for one in range(1, points + 1):
        above = math.prod(-other for other in range(1, points + 1) if other != one)
        below = math.prod(one - other for other in range(1, points + 1) if other != one)
        found.append(above * pow(below, -1, prime) % prime)
    return tuple(found)
