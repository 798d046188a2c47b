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

    circle                  `ring.Ring`              encrypt, open      `elgamal.TeamKey`
    numbers, key, vectors   `rerooting`              the next root      `start_turn`
    the table               `joined`                 the next turn      `_end_turn`

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

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from robochoc.protocols.disclosure import EveryValuePays, Hearing, Proof
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
    """`cells`: as for P-DPOP. `spare`: at most so many turns more than there are robots, to hide how many there are."""

    spare: int = 2

    def __post_init__(self) -> None:
        """Raise `ValueError` for numbers that cannot be."""
        super().__post_init__()
        if not 0 <= self.spare <= MOST:
            raise ValueError(f"spare is a number of turns from 0 to {MOST}, not {self.spare}")


class Table(UTIL, frozen=True):
    """A table of P-DPOP in the turn of one root; robots that have had theirs have their values."""

    turn: int

    def in_words(self, words: Wording) -> str:
        return f"{super().in_words(words)}, for turn {self.turn + 1}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: after the first turn nothing about every value of the sender.

        The sender may have had its turn since, and then the table is about one value.
        """
        found = super().proves(hearing)
        return found if self.turn == 0 else [one for one in found if not isinstance(one, EveryValuePays)]


class P32DPOP(RerootingProtocol, PDPOP):
    """One agent of P3/2-DPOP.

    State, besides the circle's and P-DPOP's, which is of the turn under way:

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

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.turn = 0
        self._done = False
        """The own table of this turn is told, or the own value taken."""
        self._waiting: list[tuple[str, Message]] = []

    @property
    def spare(self) -> int:
        """Return the largest number of turns that are played for show."""
        return self.settings.spare

    @property
    def findings(self) -> Findings:
        """Return the place in the last turn's tree; for its root also the optimum."""
        return super().findings if self.turn + 1 >= self.turns else NO_FINDINGS

    def receive(self, sender: str, message: Message) -> None:
        """Process what goes round the circle; keep what is of the next turn until that begins."""
        if self.verdict is not None:
            return
        match message:
            case Join() | Setup() | Vector():
                self.reroot(sender, message)
            case Next():
                if sender != self.parent or not self._done or self.turn + 1 >= self.turns:
                    raise ValueError(f"{sender} cannot end a turn")
                self._end_turn()
            case Wave():
                super().receive(sender, message)
            case _ if self._done:
                self._waiting.append((sender, message))
            case _:
                super().receive(sender, message)

    def start_in_tree(self) -> None:
        """In the first tree: remember the circle. Later: run P-DPOP in the tree of this turn."""
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
        """Be the root, if it is the own turn and known to be."""
        if not self.placed and self.own_turns is not None and self.turn in self.own_turns:
            self.enter(None)

    def send_table(self, parent: str, cells: bytes) -> None:
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
        self.start_turn()
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
