"""Comparison of shared secrets, without opening anything that depends on them (Nishide, Ohta, PKC 2007).

For x in a field with an odd number p of elements, x < p/2 exactly if 2x mod p is even. A random number r, shared bit by
bit, is added to 2x, and the sum z is opened: it is uniform. The lowest bit of 2x is that of z - r, or of z - r + p if
z < r. Whether z < r is computed from the shared bits of r and the known bits of z, in a tree of depth log2 b.
"""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols.private.shamir import Field


def products_per_comparison(bits: int) -> int:
    """Return the number of multiplications of shares that one comparison needs, besides those for its random bits."""
    segments, count = bits, 1
    while segments > 1:
        pairs = segments // 2
        count += 2 * pairs - (segments % 2 == 0)
        segments -= pairs
    return count


class Comparison:
    """One robot's part of several comparisons at once: `x < p/2` for each shared `x`.

    The robots open `masked`, pass the result to `begin`, and multiply as long as there are `products`. Then `results`
    are this robot's shares of the answers (1: true).

    Args:
        field: The field.
        secrets: This robot's shares of the numbers.
        random_bits: For each number, this robot's shares of random bits, the lowest first.
    """

    def __init__(self, field: Field, secrets: Sequence[int], random_bits: Sequence[Sequence[int]]) -> None:
        self._prime = prime = field.prime
        self._random_bits = random_bits
        self.masked = [
            (2 * one + sum(bit << place for place, bit in enumerate(bits))) % prime
            for one, bits in zip(secrets, random_bits, strict=True)
        ]
        self._lowest: list[int] = []
        self._segments: list[list[tuple[int, int]]] = []
        """For each comparison, its segments of bits, the highest first: shares of z = r and of z < r in the segment."""
        self.products: list[int] = []
        """This robot's products of shares, which the robots must turn into shares of their sums; empty at the end."""
        self.results: list[int] = []

    def begin(self, opened: Sequence[int]) -> None:
        """Use the opened sums z."""
        prime = self._prime
        for known, bits in zip(opened, self._random_bits, strict=True):
            segments = []
            for place in reversed(range(len(bits))):
                bit, is_set = bits[place], known >> place & 1
                segments.append((bit, 0) if is_set else ((1 - bit) % prime, bit))
            self._segments.append(segments)
            self._lowest.append((1 - bits[0]) % prime if known & 1 else bits[0])
        self._multiply()

    def advance(self, reduced: Sequence[int]) -> None:
        """Use the shares of all `products`."""
        values = iter(reduced)
        if len(self._segments[0]) == 1:
            for lowest, segments in zip(self._lowest, self._segments, strict=True):
                odd = lowest + segments[0][1] - 2 * next(values)
                self.results.append((1 - odd) % self._prime)
            self.products = []
            return
        for number, segments in enumerate(self._segments):
            joined: list[tuple[int, int]] = []
            for place in range(0, len(segments) - 1, 2):
                less = (segments[place][1] + next(values)) % self._prime
                joined.append((0 if place + 2 == len(segments) else next(values), less))
            self._segments[number] = joined + segments[len(segments) // 2 * 2 :]
        self._multiply()

    def _multiply(self) -> None:
        """Compute the next products: joined segments, or finally the lowest bit with z < r."""
        self.products = []
        for lowest, segments in zip(self._lowest, self._segments, strict=True):
            if len(segments) == 1:
                self.products.append(lowest * segments[0][1] % self._prime)
            for place in range(0, len(segments) - 1, 2):
                (equal, _), (lower_equal, lower_less) = segments[place : place + 2]
                self.products.append(equal * lower_less % self._prime)
                if place + 2 < len(segments):  # equality of the lowest segment is not needed
                    self.products.append(equal * lower_equal % self._prime)
