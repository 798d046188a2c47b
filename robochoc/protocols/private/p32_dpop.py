"""P3/2-DPOP: P-DPOP in which no robot tells its value; the robots take turns at the root.

P-DPOP's tables go up, under keys, and only the root sees what its own values lead to. Here nothing goes down: the root
takes its best value, and keeps it; from then on its tables are those of that value. Then another robot is the root, of
another tree over the same constraints, until each has been it. Nobody knows whose turn it is but the robot itself. For
that the robots stand in a circle, along the first tree. Each has a vector of encrypted bits, a bit for each turn; it
goes round, and everybody shuffles it, in the same way for all vectors, and encrypts it anew. Then everybody but its
owner takes its share of the key off, and the owner reads in which turn it is the root.

- **When to use**: costs, and nobody, not even a neighbour, may be told a value. The price: as many times P-DPOP as
  there are robots, and messages for the vectors by the square of that number.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Robots are taken
  to keep to the protocol, not to put their knowledge together, and to have channels that nobody else reads.
- **Parameters (`--set`)**: `cells`, the number of cells that a table may have (default 1,000,000). `spare`, the largest
  number of turns that are played for show (default 2): only the first of the ring knows how many there are.
- **References**: Leaute, Faltings: "Protecting privacy through distributed computation in multi-agent decision making",
  JAIR 47, 2013. Desmedt, Frankel: "Threshold cryptosystems", CRYPTO 1989.

What stays hidden, and what does not, besides what `p-dpop` says:

- No message tells a value. A robot whose subtree shares constraints with the receiver alone shows its table all the
  same, and once it has had its turn, the table of its value alone: the receiver may read the value from the difference.
- All robots learn the optimum (each has been the root), and how many robots are connected, but for `spare`.
- In each turn a robot learns on which side of it the root is.

Encryption: ElGamal with one share of the key for each robot, in the group Edwards25519, by libsodium (PyNaCl: the extra
`private`). Keys come from `Protocol.secret`, as P-DPOP's.

The methods:

    circle         `ring.Ring`                       encrypt, open      `elgamal.TeamKey`
    numbers, key   `_join`, `_set_up`                the next root      `_begin_turn`
    vectors        `_pass_vector`                    the table          `joined`

Choices that the paper leaves open, and differences:

- Numbers in the circle count from a random offset, so that a number tells nobody its place; the paper lets each robot
  add a random step, which makes vectors longer by that factor.
- A robot has its whole vector opened at once, and so knows from the start when its turn is; it learns nothing else.
- Spare turns are the first robot's: it is the root again.
- Ties go to the first value in its domain.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), P32DPOP, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, assert_never, cast

from robochoc.model.message import Message
from robochoc.protocols.findings import NOTHING, Findings
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.ed25519 import NEEDS, Ed25519, Group
from robochoc.protocols.private.elgamal import TeamKey
from robochoc.protocols.private.messages.anonymous_dfs import AnonymousTreeMessage, Wave
from robochoc.protocols.private.messages.p32_dpop import Join, Next, RerootingMessage, Setup, Stage, Table, Vector
from robochoc.protocols.private.messages.p_dpop import Codes
from robochoc.protocols.private.p_dpop import PDPOP, CellTable
from robochoc.protocols.private.ring import Ring
from robochoc.protocols.private.settings.p32_dpop import P32DPOPSettings
from robochoc.solver.compiled import LocalProblem

TAG = 16
"""Bytes: two vectors have the same tag once in 2^128 pairs."""
NUMBER_BITS = 62


class P32DPOP(PDPOP):
    """One agent of P3/2-DPOP.

    State, besides P-DPOP's, which is of the turn under way:

    - `ring`: the place in the circle, which is along the first tree;
    - `number` in it; `turns`, how many there are; `own_turns`, in which this robot is the root;
    - `turn`: how many turns are over.
    """

    messages = AnonymousTreeMessage | Codes | Table | RerootingMessage
    traits = replace(
        PDPOP.traits,
        paper="Leaute & Faltings 2013",
        needs=NEEDS,
        privacy="constraints of others, who they are, and their values",
        use_when="costs, and neighbours must not be told values either",
    )
    settings: ClassVar[P32DPOPSettings] = P32DPOPSettings()
    group: ClassVar[type[Group]] = Ed25519

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.ring: Ring | None = None
        self.number = 0
        self.turns = 0
        self.own_turns: frozenset[int] | None = None
        self.turn = 0
        self._elements = self.group()
        self._key: TeamKey | None = None
        self._shuffle: list[int] = []
        self._tag = b""
        self._done = False
        """The own table of this turn is told, or the own value taken."""
        self._waiting: list[tuple[str, Message]] = []

    @property
    def findings(self) -> Findings:
        """Return the place in the last turn's tree; for its root also the optimum."""
        return super().findings if self.turn + 1 >= self.turns else NOTHING

    def receive(self, sender: str, message: Message) -> None:
        """Process what goes round the circle; keep what is of the next turn until that begins."""
        if self.verdict is not None:
            return
        match message:
            case Join() | Setup() | Vector() | Next():
                self._reroot(sender, message)
            case Wave():
                super().receive(sender, message)
            case _ if self._done:
                self._waiting.append((sender, message))
            case _:
                super().receive(sender, message)

    def _reroot(self, sender: str, message: Message) -> None:
        """Dispatch on the type of what is not P-DPOP's."""
        ring, _ = self._placed()
        match cast("RerootingMessage", message):
            case Setup() as setup:
                if sender != ring.parent:
                    raise ValueError(f"{sender} has no key to tell")
                self._set_up(setup)
            case Next():
                if sender != self.parent or not self._done or self.turn + 1 >= self.turns:
                    raise ValueError(f"{sender} cannot end a turn")
                self._end_turn()
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

    def _placed(self) -> tuple[Ring, TeamKey]:
        """Return the place in the circle, and the own share of the key."""
        if self.ring is None or self._key is None:
            raise ValueError("the first tree is not built yet")
        return self.ring, self._key

    # The circle: numbers, and the team's key

    def begin(self) -> None:
        """In the first tree: remember the circle. Later: run P-DPOP in the tree of this turn."""
        if self.ring is not None or not self.problem.neighbours:
            super().begin()
            return
        ring = Ring(self.parent, self.children)
        key = self.take_place(ring)
        self.leave_tree()
        if ring.is_first:
            self.number = self.secret(NUMBER_BITS)
            self.send(ring.onward, Join(self.number + 1, key.share))

    def take_place(self, ring: Ring) -> TeamKey:
        """Take a place in the circle; draw the own share of the team's key, and return it."""
        self.ring = ring
        self._key = TeamKey(self._elements, self.secret)
        return self._key

    def _join(self, join: Join) -> None:
        """Take the number; the first robot gets the key of all, and tells it."""
        ring, key = self._placed()
        if key.joint != self._elements.zero or len(join.key) != self._elements.size:
            raise ValueError("a place in the ring that cannot be")
        if not ring.is_first:
            self.number = join.number
            self.send(ring.onward, Join(join.number + 1, key.added_to(join.key)))
            return
        robots = join.number - self.number
        if not 1 < robots <= len(self.order.names):
            raise ValueError(f"a ring of {robots} robots")
        turns = robots + self.secret(64) % (self.settings.spare + 1)
        offset = self.number - self.secret(64) % turns
        self._set_up(Setup(join.key, offset, turns))
        self._tag = self.secret(8 * TAG).to_bytes(TAG, "little")
        mine = {self.number - offset, *((self.number + more - offset) % turns for more in range(robots, turns))}
        self._mix(Vector(Stage.TO_FIRST, self._tag, self._vector(mine)))

    def _set_up(self, setup: Setup) -> None:
        """Know the key, and tell it below; all but the first robot send their vectors off."""
        ring, key = self._placed()
        if self.turns or not 1 < setup.turns <= len(self.order.names) + self.settings.spare:
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
        _, key = self._placed()
        return b"".join([key.encrypt(bit=place not in mine) for place in range(self.turns)])

    def _pass_vector(self, vector: Vector) -> None:
        """Shuffle, open, or pass on a vector that has come to this robot in the circle."""
        ring, key = self._placed()
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
        ring, key = self._placed()
        pairs = key.checked(vector.ciphers)
        mixed = b"".join([key.renewed(pairs[place]) for place in self._shuffle])
        self.send(ring.onward, Vector(Stage.MIXING, vector.tag, mixed))

    def _read(self, ciphers: bytes) -> None:
        """Take the own share off, and read in which turns this robot is the root."""
        _, key = self._placed()
        if self.own_turns is not None:
            raise ValueError("a vector that was opened before")
        opened = [key.stripped(pair) for pair in key.checked(ciphers)]
        self.own_turns = frozenset(turn for turn, one in enumerate(opened) if key.is_zero(one))
        if not self.own_turns:
            raise ValueError("a vector without a turn")
        self._begin_turn()

    # Turns

    def _begin_turn(self) -> None:
        """Be the root, if it is the own turn and known to be."""
        if not self.placed and self.own_turns is not None and self.turn in self.own_turns:
            self.enter(None)

    def tell(self, parent: str, cells: bytes) -> None:
        """Send the own table to the parent. No value will come back."""
        self.send(parent, Table(self.axes, cells, self.turn))
        self._done = True

    def joined(self) -> CellTable:
        """Return P-DPOP's sums; those of the own value alone once there is one."""
        joined = super().joined()
        return joined if self.value is None else joined[self.value : self.value + 1]

    def decide_as_root(self) -> None:
        """Take the best value, unless there is one, and tell nobody."""
        if self.value is None and self.choices is not None:
            self.value = int(self.choices.item())
        self._done = True
        if self.turn + 1 < self.turns:
            self._end_turn()

    def _end_turn(self) -> None:
        """Tell it the children, forget the turn, and begin the next one."""
        for child in self.children:
            self.send(child, Next())
        self.leave_tree()
        self.turn += 1
        self._begin_turn()
        waiting, self._waiting = self._waiting, []
        for sender, message in waiting:
            self.receive(sender, message)

    def leave_tree(self) -> None:
        """Forget the tree, and P-DPOP's state in it. The own value stays."""
        super().leave_tree()
        self.above = {}
        self.utils = {}
        self.axes = {}
        self.choices = None
        self.optimum = None
        self._done = False
