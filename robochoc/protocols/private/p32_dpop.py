"""P3/2-DPOP: P-DPOP in which no robot sends its value; the robots take turns at the root.

In P-DPOP tables go up, protected by keys, and only the root sees the consequences of its values. Here nothing goes
down: the root chooses its best value, and keeps it; from then on its tables are the tables for that value. Then another
robot becomes the root, of another tree over the same constraints, until each robot has been the root. Only the robot
itself knows its turn. To achieve this, the robots form a circle, along the first tree. Each robot has a vector of
encrypted bits, one bit for each turn. The vector goes round, and every robot shuffles it, in the same way for all
vectors, and encrypts it again. Then all robots but its owner remove their shares of the key, and the owner reads its
turn as the root.

- **When to use**: costs, and no robot, not even a neighbour, may learn a value. The price: one P-DPOP for each robot,
  and messages for the vectors that grow with the square of the number of robots.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Robots are assumed
  to follow the protocol, not to combine their knowledge, and to have channels that nobody else reads.
- **Parameters (`--set`)**: `cells`, the maximum number of cells in a table (default 1,000,000). `spare`, the largest
  number of additional turns (default 2), which hide the number of robots: only the first robot in the ring knows how
  many there are.
- **References**: Leaute, Faltings: "Protecting privacy through distributed computation in multi-agent decision making",
  JAIR 47, 2013. Desmedt, Frankel: "Threshold cryptosystems", CRYPTO 1989.

Disclosed and hidden information, besides that in `p-dpop`:

- Messages contain no values. However, a robot whose subtree shares constraints only with the receiver reveals its
  table, and, after its turn, the table for its value alone: the receiver may derive the value from the difference.
- All robots learn the optimum (each has been the root), and the number of connected robots, up to `spare`.
- In each turn a robot learns the direction of the root.

Encryption: ElGamal with a share of the key for each robot, in the group Edwards25519, by libsodium (PyNaCl: the extra
`private`). Keys come from `Protocol.secret`, as in P-DPOP.

The methods:

    circle                  `ring.Ring`              encrypt, open      `elgamal.TeamKey`
    numbers, key, vectors   `rerooting`              the next root      `start_turn`
    the table               `joined`                 the next turn      `_end_turn`

Choices that the paper leaves open, and differences:

- Numbers in the circle count from a random offset, so that a number does not reveal the robot's position; in the paper
  each robot adds a random step, which makes vectors longer by that factor.
- A robot has its whole vector opened at once, and so knows its turn from the start; it learns nothing else.
- Additional turns belong to the first robot: it is the root again.
- Ties go to the first value in its domain.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), P32DPOP, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from robochoc.protocols.disclosure import EveryValuePays, Proof, Reception
from robochoc.protocols.findings import NO_FINDINGS, Findings
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.anonymous_dfs import AnonymousTreeMessage, Wave
from robochoc.protocols.private.ed25519 import NEEDS
from robochoc.protocols.private.p_dpop import PDPOP, UTIL, CellTable, Codes, PDPOPSettings
from robochoc.protocols.private.rerooting import Join, Next, RerootingMessage, RerootingProtocol, Setup, Vector
from robochoc.protocols.private.ring import Ring
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem

MOST = 1_000


class P32DPOPSettings(PDPOPSettings, frozen=True):
    """`cells`: as for P-DPOP. `spare`: the maximum number of additional turns, which hide the number of robots."""

    spare: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.spare <= MOST:
            raise ValueError(f"spare is {self.spare}; it must be from 0 to {MOST} turns")


class Table(UTIL, frozen=True):
    """A table of P-DPOP in the turn of one root; robots that have had their turns have fixed values."""

    turn: int

    def in_words(self, words: Wording) -> str:
        return f"{super().in_words(words)}, for turn {self.turn + 1}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the proofs of P-DPOP; after the first turn, none about every value of the sender.

        The sender may have had its turn in the meantime, and then the table is about one value.
        """
        found = super().proves(reception)
        return found if self.turn == 0 else [one for one in found if not isinstance(one, EveryValuePays)]


class P32DPOP(RerootingProtocol, PDPOP):
    """One agent of P3/2-DPOP.

    State besides that of the circle, and that of P-DPOP in the present turn:

    - `turn`: the number of completed turns.
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

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.turn = 0
        self._done = False
        """True if this robot has sent its table in this turn, or chosen its value."""
        self._waiting: list[tuple[str, Message]] = []

    @property
    def spare(self) -> int:
        """The largest number of additional turns, which hide the number of robots."""
        return self.settings.spare

    @property
    def findings(self) -> Findings:
        """This robot's position in the tree of the last turn; for the root of that tree, also the optimum."""
        return super().findings if self.turn + 1 >= self.turns else NO_FINDINGS

    def receive(self, sender: str, message: Message) -> None:
        """Process messages of the circle; store messages of the next turn until it begins."""
        if self.verdict is not None:
            return
        match message:
            case Join() | Setup() | Vector():
                self.reroot(sender, message)
            case Next():
                if sender != self.parent or not self._done or self.turn + 1 >= self.turns:
                    raise ValueError(f"{sender} sent an unexpected Next")
                self._end_turn()
            case Wave():
                super().receive(sender, message)
            case _ if self._done:
                self._waiting.append((sender, message))
            case _:
                super().receive(sender, message)

    def start_in_tree(self) -> None:
        """In the first tree: join the circle. Later: run P-DPOP in the tree of this turn."""
        if self.ring is not None or not self.problem.neighbours:
            super().start_in_tree()
            return
        ring = Ring(self.parent, self.children)
        self.join_ring(ring)
        self.leave_tree()
        if ring.is_first:
            self.open_ring()

    # Turns

    def start_turn(self) -> None:
        """Be the root, if it is known to be this robot's turn."""
        if not self.placed and self.own_turns is not None and self.turn in self.own_turns:
            self.enter(None)

    def send_table(self, parent: str, cells: bytes) -> None:
        """Send this robot's table to the parent, which will not reply with a value."""
        self.send(parent, Table(self.axes, cells, self.turn))
        self._done = True

    def joined(self) -> CellTable:
        """Return the sums of P-DPOP; once there is a value, only the sums for this value."""
        joined = super().joined()
        return joined if self.value is None else joined[self.value : self.value + 1]

    def decide_as_root(self) -> None:
        """Choose the best value, unless one has been chosen already, without sending it."""
        if self.value is None and self.choices is not None:
            self.value = int(self.choices.item())
        self._done = True
        if self.turn + 1 < self.turns:
            self._end_turn()

    def _end_turn(self) -> None:
        """Inform the children, forget this turn's state, and start the next turn."""
        for child in self.children:
            self.send(child, Next())
        self.leave_tree()
        self.turn += 1
        self.start_turn()
        waiting, self._waiting = self._waiting, []
        for sender, message in waiting:
            self.receive(sender, message)

    def leave_tree(self) -> None:
        """Forget the tree, and the state of P-DPOP in it. This robot's value remains."""
        super().leave_tree()
        self.above = {}
        self.utils = {}
        self.axes = {}
        self.choices = None
        self.optimum = None
        self._done = False
