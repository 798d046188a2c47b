"""Robots in a circle that take turns as the root, in a secret order (P3/2-DPOP and P2-DPOP).

The circle follows the first tree. Each robot has a number in it, counted from a random offset, a share of the team's
key, and a vector of encrypted bits, one bit for each turn: 0 if it is the root in that turn. The vector goes round, and
every robot shuffles it, in the same way for all vectors, and encrypts it again. Then all robots but its owner remove
their shares of the key, and the owner reads its turn as the root. (Leaute, Faltings: "Protecting privacy through
distributed computation in multi-agent decision making", JAIR 47, 2013, rerooting.)
"""

from __future__ import annotations

from abc import abstractmethod
from enum import IntEnum
from typing import ClassVar, assert_never

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.anonymous_dfs import AnonymousTreeProtocol
from robochoc.protocols.private.ed25519 import Ed25519, PrimeGroup
from robochoc.protocols.private.elgamal import TeamKey
from robochoc.protocols.private.ring import Ring
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class VectorStage(IntEnum):
    """The rounds of a vector."""

    TO_FIRST = 0
    """From its owner to the first robot of the ring."""
    MIXING = 1
    """A whole round from the first robot: each robot shuffles it."""
    HOME = 2
    """From the first robot to its owner."""
    OPENING = 3
    """A whole round from its owner: each other robot removes its share of the key."""


class Join(Message, frozen=True):
    """A robot's position in the ring: its `number`, and the sum of the public keys of the robots before it."""

    number: int
    key: bytes

    act = Act(Performative.REQUEST, "the receiver adopts the number, and adds its public key")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"take the next number in the ring, and add your key to {self.key[:2].hex()}"


class Setup(Message, frozen=True):
    """The team's public `key`; the number of `turns`, and the `offset` of the robots' numbers."""

    key: bytes
    offset: int
    turns: int

    act = Act(Performative.INFORM, "the receiver learns the team's key")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"our key begins with {self.key[:2].hex()}, and there are {self.turns} turns"


class Vector(Message, frozen=True):
    """One robot's encrypted bits, one for each turn: 0 if it is the root then. Only its owner knows the `tag`."""

    stage: VectorStage
    tag: bytes
    ciphers: bytes

    act = Act(Performative.REQUEST, "the receiver shuffles the vector, opens it, or sends it on")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        to_do = {
            VectorStage.TO_FIRST: "pass it on to the first of the ring",
            VectorStage.MIXING: "shuffle it",
            VectorStage.HOME: "pass it on to its owner",
            VectorStage.OPENING: "take your share of the key off",
        }
        return f"somebody's turns, encrypted ({self.tag[:2].hex()}): {to_do[self.stage]}"


class Next(Message, frozen=True):
    """The root has its value: the next turn begins."""

    act = Act(Performative.INFORM, "the turn is over")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "the next turn begins"


RerootingMessage = Join | Setup | Vector | Next
"""The messages with which robots take turns as the root."""


TAG = 16
"""The number of bytes of a tag: two vectors have the same tag once in 2^128 pairs."""
NUMBER_BITS = 62


class RerootingProtocol(AnonymousTreeProtocol):
    """One agent that finds its position in the circle, and learns its turns as the root.

    State besides that of the tree:

    - `ring`: the position in the circle;
    - `number`, the robot's number in it; `turns`, the number of turns; `own_turns`, those in which this robot is the
      root.
    """

    group: ClassVar[type[PrimeGroup]] = Ed25519

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.ring: Ring | None = None
        self.number = 0
        self.turns = 0
        self.own_turns: frozenset[int] | None = None
        self._elements = self.group()
        self._key: TeamKey | None = None
        self._shuffle: list[int] = []
        self._tag = b""

    @property
    @abstractmethod
    def spare(self) -> int:
        """The largest number of additional turns, which hide the number of robots."""

    @abstractmethod
    def start_turn(self) -> None:
        """Be the root, if it is known to be this robot's turn. Called once its turns are known."""

    def join_ring(self, ring: Ring) -> TeamKey:
        """Join the circle; draw this robot's share of the team's key, and return it."""
        self.ring = ring
        self._key = TeamKey(self._elements, self.secret)
        return self._key

    def in_ring(self) -> tuple[Ring, TeamKey]:
        """Return the position in the ring, and this robot's share of the key. Raises `ValueError` if there are none."""
        if self.ring is None or self._key is None:
            raise ValueError("the first tree is not complete yet")
        return self.ring, self._key

    def open_ring(self) -> None:
        """As the first robot: start the round in which robots join the circle."""
        ring, key = self.in_ring()
        self.number = self.secret(NUMBER_BITS)
        self.send(ring.onward, Join(self.number + 1, key.share))

    def reroot(self, sender: str, message: Join | Setup | Vector) -> None:
        """Process a message of the circle before the first turn."""
        ring, _ = self.in_ring()
        match message:
            case Setup() as setup:
                if sender != ring.parent:
                    raise ValueError(f"{sender} sent an unexpected Setup")
                self._set_up(setup)
            case Join() | Vector() as rest:
                onward = ring.on_its_way(sender)
                if onward is not None:
                    self.send(onward, rest)
                elif isinstance(rest, Join):
                    self._join(rest)
                else:
                    self._process_vector(rest)
            case never:
                assert_never(never)

    def _join(self, join: Join) -> None:
        """Adopt the number; the first robot receives the sum of all keys, and sends it to all."""
        ring, key = self.in_ring()
        if key.joint != self._elements.zero or len(join.key) != self._elements.size:
            raise ValueError("received an unexpected or invalid Join")
        if not ring.is_first:
            self.number = join.number
            self.send(ring.onward, Join(join.number + 1, key.added_to(join.key)))
            return
        robots = join.number - self.number
        if not 1 < robots <= len(self.order.names):
            raise ValueError(f"the ring has {robots} robots; it must have from 2 to {len(self.order.names)}")
        turns = robots + self.secret(64) % (self.spare + 1)
        offset = self.number - self.secret(64) % turns
        self._set_up(Setup(join.key, offset, turns))
        self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
        own = {self.number - offset, *((self.number + more - offset) % turns for more in range(robots, turns))}
        self._mix(Vector(VectorStage.TO_FIRST, self._tag, self._vector(own)))

    def _set_up(self, setup: Setup) -> None:
        """Store the key, and send it down; all robots but the first send off their vectors."""
        ring, key = self.in_ring()
        if self.turns or not 1 < setup.turns <= len(self.order.names) + self.spare:
            raise ValueError(f"received an unexpected or invalid Setup of {setup.turns} turns")
        self._elements.check(setup.key)
        key.joint = setup.key
        self.turns = setup.turns
        self._shuffle = shuffled(range(self.turns), self.secret)
        for child in ring.children:
            self.send(child, setup)
        if not ring.is_first:
            self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
            own = {(self.number - setup.offset) % self.turns}
            self.send(ring.onward, Vector(VectorStage.TO_FIRST, self._tag, self._vector(own)))

    # Vectors

    def _vector(self, own: set[int]) -> bytes:
        """Return this robot's vector, before it is shuffled; `own` are its turns."""
        _, key = self.in_ring()
        return b"".join([key.encrypt(bit=turn not in own) for turn in range(self.turns)])

    def _process_vector(self, vector: Vector) -> None:
        """Shuffle, open, or send on a vector that has arrived at this robot in the circle."""
        ring, key = self.in_ring()
        if len(vector.ciphers) != self.turns * key.size or len(vector.tag) != TAG:
            raise ValueError(f"received an invalid vector of {len(vector.ciphers):,} bytes for {self.turns:,} turns")
        is_own = vector.tag == self._tag
        match vector.stage:
            case VectorStage.TO_FIRST if ring.is_first:
                self._mix(vector)
            case VectorStage.MIXING if not ring.is_first:
                self._mix(vector)
            case VectorStage.MIXING | VectorStage.HOME if is_own:
                self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
                self.send(ring.onward, Vector(VectorStage.OPENING, self._tag, vector.ciphers))
            case VectorStage.MIXING:
                self.send(ring.onward, Vector(VectorStage.HOME, vector.tag, vector.ciphers))
            case VectorStage.OPENING if is_own:
                self._read(vector.ciphers)
            case VectorStage.OPENING:
                opened = b"".join([key.stripped(pair) for pair in key.checked(vector.ciphers)])
                self.send(ring.onward, Vector(VectorStage.OPENING, vector.tag, opened))
            case _:
                self.send(ring.onward, vector)

    def _mix(self, vector: Vector) -> None:
        """Shuffle the vector, in the same way for all vectors, and encrypt it again."""
        ring, key = self.in_ring()
        pairs = key.checked(vector.ciphers)
        mixed = b"".join([key.renewed(pairs[place]) for place in self._shuffle])
        self.send(ring.onward, Vector(VectorStage.MIXING, vector.tag, mixed))

    def _read(self, ciphers: bytes) -> None:
        """Remove this robot's share, and read its turns as the root."""
        _, key = self.in_ring()
        if self.own_turns is not None:
            raise ValueError("received this robot's vector for the second time")
        opened = [key.stripped(pair) for pair in key.checked(ciphers)]
        self.own_turns = frozenset(turn for turn, one in enumerate(opened) if key.is_zero(one))
        if not self.own_turns:
            raise ValueError("this robot's vector contains no turn")
        self.start_turn()
