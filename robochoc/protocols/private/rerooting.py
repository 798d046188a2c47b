"""Robots in a circle that take turns at the root, in an order that nobody knows (P3/2-DPOP and P2-DPOP).

The circle is along the first tree. Each robot has a number in it, from a random offset, a share of the team's key, and
a vector of encrypted bits, a bit for each turn: 0 where it is the root. The vector goes round, and everybody shuffles
it, in the same way for all vectors, and encrypts it anew. Then everybody but its owner takes its share of the key off,
and the owner reads in which turn it is the root. (Leaute, Faltings: "Protecting privacy through distributed computation
in multi-agent decision making", JAIR 47, 2013, rerooting.)
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
from robochoc.protocols.private.ed25519 import Ed25519, Group
from robochoc.protocols.private.elgamal import TeamKey
from robochoc.protocols.private.ring import Ring
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class Stage(IntEnum):
    """The rounds of a vector."""

    TO_FIRST = 0
    """From its owner to the first robot of the ring."""
    MIXING = 1
    """A whole round from there: each robot shuffles it."""
    HOME = 2
    """From the first robot to its owner."""
    OPENING = 3
    """A whole round from its owner: each other robot takes its share of the key off."""


class Join(Message, frozen=True):
    """Takes a robot into the ring: its `number`, and the sum of the public keys of the robots before it."""

    number: int
    key: bytes

    act = Act(Performative.REQUEST, "the receiver is to take the number, and to add its public key")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"take the next number in the ring, and add your key to {self.key[:2].hex()}"


class Setup(Message, frozen=True):
    """The team's public `key`; there are `turns`, and the number of each robot counts from `offset`."""

    key: bytes
    offset: int
    turns: int

    act = Act(Performative.INFORM, "the receiver learns the team's key")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"our key begins with {self.key[:2].hex()}, and there are {self.turns} turns"


class Vector(Message, frozen=True):
    """One robot's encrypted bits, a bit for each turn: 0 where it is the root. Nobody but its owner knows the `tag`."""

    stage: Stage
    tag: bytes
    ciphers: bytes

    act = Act(Performative.REQUEST, "the receiver is to shuffle it, to open it, or to pass it on")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        to_do = {
            Stage.TO_FIRST: "pass it on to the first of the ring",
            Stage.MIXING: "shuffle it",
            Stage.HOME: "pass it on to its owner",
            Stage.OPENING: "take your share of the key off",
        }
        return f"somebody's turns, encrypted ({self.tag[:2].hex()}): {to_do[self.stage]}"


class Next(Message, frozen=True):
    """The root has its value: the next turn begins."""

    act = Act(Performative.INFORM, "the turn is over")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "the next turn begins"


RerootingMessage = Join | Setup | Vector | Next
"""The messages by which roots take turns."""


TAG = 16
"""Bytes: two vectors have the same tag once in 2^128 pairs."""
NUMBER_BITS = 62


class RerootingProtocol(AnonymousTreeProtocol):
    """One agent that takes its place in the circle, and finds out when it is the root.

    State, besides the tree's:

    - `ring`: the place in the circle;
    - `number` in it; `turns`, how many there are; `own_turns`, in which this robot is the root.
    """

    group: ClassVar[type[Group]] = Ed25519

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
        """Return the largest number of turns that are played for show."""

    @abstractmethod
    def start_turn(self) -> None:
        """Be the root, if it is the own turn and known to be. Called once the own turns are known."""

    def join_ring(self, ring: Ring) -> TeamKey:
        """Take a place in the circle; draw the own share of the team's key, and return it."""
        self.ring = ring
        self._key = TeamKey(self._elements, self.secret)
        return self._key

    def in_ring(self) -> tuple[Ring, TeamKey]:
        """Return the place in the circle, and the own share of the key. Raises `ValueError` before there are any."""
        if self.ring is None or self._key is None:
            raise ValueError("the first tree is not built yet")
        return self.ring, self._key

    def open_ring(self) -> None:
        """As the first robot: send round who is in the circle."""
        ring, key = self.in_ring()
        self.number = self.secret(NUMBER_BITS)
        self.send(ring.onward, Join(self.number + 1, key.share))

    def reroot(self, sender: str, message: Join | Setup | Vector) -> None:
        """Process what goes round before the first turn."""
        ring, _ = self.in_ring()
        match message:
            case Setup() as setup:
                if sender != ring.parent:
                    raise ValueError(f"{sender} has no key to tell")
                self._set_up(setup)
            case Join() | Vector() as rest:
                onward = ring.on_its_way(sender)
                if onward is not None:
                    self.send(onward, rest)
                elif isinstance(rest, Join):
                    self._join(rest)
                else:
                    self._pass_vector(rest)
            case never:
                assert_never(never)

    def _join(self, join: Join) -> None:
        """Take the number; the first robot gets the key of all, and tells it."""
        ring, key = self.in_ring()
        if key.joint != self._elements.zero or len(join.key) != self._elements.size:
            raise ValueError("a place in the ring that cannot be")
        if not ring.is_first:
            self.number = join.number
            self.send(ring.onward, Join(join.number + 1, key.added_to(join.key)))
            return
        robots = join.number - self.number
        if not 1 < robots <= len(self.order.names):
            raise ValueError(f"a ring of {robots} robots")
        turns = robots + self.secret(64) % (self.spare + 1)
        offset = self.number - self.secret(64) % turns
        self._set_up(Setup(join.key, offset, turns))
        self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
        mine = {self.number - offset, *((self.number + more - offset) % turns for more in range(robots, turns))}
        self._mix(Vector(Stage.TO_FIRST, self._tag, self._vector(mine)))

    def _set_up(self, setup: Setup) -> None:
        """Know the key, and tell it below; all but the first robot send their vectors off."""
        ring, key = self.in_ring()
        if self.turns or not 1 < setup.turns <= len(self.order.names) + self.spare:
            raise ValueError(f"a key for {setup.turns} turns")
        self._elements.check(setup.key)
        key.joint = setup.key
        self.turns = setup.turns
        self._shuffle = shuffled(range(self.turns), self.secret)
        for child in ring.children:
            self.send(child, setup)
        if not ring.is_first:
            self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
            mine = {(self.number - setup.offset) % self.turns}
            self.send(ring.onward, Vector(Stage.TO_FIRST, self._tag, self._vector(mine)))

    # Vectors

    def _vector(self, mine: set[int]) -> bytes:
        """Return the own vector, before it is shuffled."""
        _, key = self.in_ring()
        return b"".join([key.encrypt(bit=place not in mine) for place in range(self.turns)])

    def _pass_vector(self, vector: Vector) -> None:
        """Shuffle, open, or pass on a vector that has come to this robot in the circle."""
        ring, key = self.in_ring()
        if len(vector.ciphers) != self.turns * key.size or len(vector.tag) != TAG:
            raise ValueError("a vector that cannot be")
        mine = vector.tag == self._tag
        match vector.stage:
            case Stage.TO_FIRST if ring.is_first:
                self._mix(vector)
            case Stage.MIXING if not ring.is_first:
                self._mix(vector)
            case Stage.MIXING | Stage.HOME if mine:
                self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
                self.send(ring.onward, Vector(Stage.OPENING, self._tag, vector.ciphers))
            case Stage.MIXING:
                self.send(ring.onward, Vector(Stage.HOME, vector.tag, vector.ciphers))
            case Stage.OPENING if mine:
                self._read(vector.ciphers)
            case Stage.OPENING:
                opened = b"".join([key.stripped(pair) for pair in key.checked(vector.ciphers)])
                self.send(ring.onward, Vector(Stage.OPENING, vector.tag, opened))
            case _:
                self.send(ring.onward, vector)

    def _mix(self, vector: Vector) -> None:
        """Put the vector in the own order, the same for all vectors, and encrypt it anew."""
        ring, key = self.in_ring()
        pairs = key.checked(vector.ciphers)
        mixed = b"".join([key.renewed(pairs[place]) for place in self._shuffle])
        self.send(ring.onward, Vector(Stage.MIXING, vector.tag, mixed))

    def _read(self, ciphers: bytes) -> None:
        """Take the own share off, and read in which turns this robot is the root."""
        _, key = self.in_ring()
        if self.own_turns is not None:
            raise ValueError("a vector that was opened before")
        opened = [key.stripped(pair) for pair in key.checked(ciphers)]
        self.own_turns = frozenset(turn for turn, one in enumerate(opened) if key.is_zero(one))
        if not self.own_turns:
            raise ValueError("a vector without a turn")
        self.start_turn()
