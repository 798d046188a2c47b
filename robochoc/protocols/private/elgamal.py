"""ElGamal encryption to a whole team, n out of n: a cipher can be opened only if all robots help.

Each robot has a share of the secret key, and sends its public half; the team's public key is the sum of these. A cipher
of an element M is the pair (r G, M + r H), for a random r, the generator G and the team's key H. Any robot can encrypt
a cipher again, so that it cannot be distinguished from others, and each can remove its own share. Without any shares, M
is left. (Desmedt, Frankel: "Threshold cryptosystems", CRYPTO 1989.)

Here M is a bit (the neutral element or the generator), or a sum of bits, which is 0 only if all bits are 0, because
there are fewer bits than group elements. The sum of ciphers is a cipher of the sum. Before a sum is opened it is
blinded: multiplied by random scalars, so that it shows only whether it is 0.
"""

from __future__ import annotations

from robochoc.protocols.private.ed25519 import PrimeGroup, Secret


class TeamKey:
    """One robot's share of the team's key, and operations on ciphers. `joint` is the team's key, once it is known."""

    def __init__(self, group: PrimeGroup, secret: Secret) -> None:
        self._group = group
        self._secret = secret
        self._own = group.scalar(secret)
        self.share = group.multiple(self._own)
        """The public half of this robot's share."""
        self.joint = group.zero
        self.size = 2 * group.size
        """The number of bytes of a cipher."""

    def added_to(self, shares: bytes) -> bytes:
        """Return the sum of public halves, including this robot's."""
        self._group.check(shares)
        return self._group.plus(shares, self.share)

    @property
    def nothing(self) -> tuple[bytes, bytes]:
        """A cipher of 0 that any robot can read, until it is encrypted again."""
        return self._group.zero, self._group.zero

    def encrypt(self, *, bit: bool) -> bytes:
        """Return a new cipher of a bit."""
        return self.renewed((self._group.zero, self._group.one) if bit else self.nothing)

    def renewed(self, pair: tuple[bytes, bytes]) -> bytes:
        """Return another cipher of the same element: `pair` encrypted again."""
        scalar = self._group.scalar(self._secret)
        pad = self._group.plus(pair[0], self._group.multiple(scalar))
        return pad + self._group.plus(pair[1], self._group.times(scalar, self.joint))

    def added(self, first: tuple[bytes, bytes], second: tuple[bytes, bytes]) -> tuple[bytes, bytes]:
        """Return a cipher of the sum of two elements. For two bits, the sum is 0 only if both are 0."""
        return self._group.plus(first[0], second[0]), self._group.plus(first[1], second[1])

    def blinded(self, pair: tuple[bytes, bytes]) -> tuple[bytes, bytes]:
        """Return a cipher of 0 if `pair` is a cipher of 0; otherwise a cipher of a random other element."""
        scalar = self._group.scalar(self._secret)
        return self._group.times(scalar, pair[0]), self._group.times(scalar, pair[1])

    def stripped(self, pair: tuple[bytes, bytes]) -> bytes:
        """Return a cipher without this robot's share of the key."""
        return pair[0] + self._group.minus(pair[1], self._group.times(self._own, pair[0]))

    def is_zero(self, stripped: bytes) -> bool:
        """Return whether a cipher without any share contains the bit 0."""
        return self.pairs(stripped)[0][1] == self._group.zero

    def checked(self, ciphers: bytes) -> list[tuple[bytes, bytes]]:
        """Return the halves of received ciphers. Raises `ValueError` for bytes that are not elements."""
        pairs = self.pairs(ciphers)
        for pair in pairs:
            for half in pair:
                self._group.check(half)
        return pairs

    def pairs(self, ciphers: bytes) -> list[tuple[bytes, bytes]]:
        """Return the halves of consecutive ciphers."""
        half = self._group.size
        return [
            (ciphers[at : at + half], ciphers[at + half : at + 2 * half]) for at in range(0, len(ciphers), self.size)
        ]
