"""P2-DPOP: DPOP on tables that no robot can read; robots do not send their values, domains or costs.

As in P3/2-DPOP the robots form a circle and take turns as the root, in an order that no other robot knows. But tables
are encrypted to the whole team, and go round the circle, from the root of the turn back to it. Each robot on the way
adds its costs, minimises over its own values, and encrypts the table again, without reading anything. Encrypted costs
can only be added to known costs, not to each other: so there is one table, along a linear order, instead of one for
each branch of a tree. The root has some ciphers opened by all robots: by bisection it finds the minimum cost, and one
of its values that attains this cost. It keeps the value; from then on it only adds the costs of this value.

- **When to use**: costs, and no robot may learn a value, a domain or a cost. For small problems: a table has a cell for
  each combination of values of the robots that come later and are linked to those before, and each cell has a cipher
  for each possible total cost. All sizes are known before the first table is made.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Robots are assumed
  to follow the protocol, not to combine their knowledge, and to have channels that nobody else reads.
- **Parameters (`--set`)**: `ciphers`, the maximum number of ciphers in a table (default 20,000; each needs 64 bytes and
  about half a millisecond, for each robot in each turn). `spare`, the largest number of additional turns (default 2),
  which hide the number of robots: only the first robot in the ring knows how many there are.
- **References**: Leaute, Faltings: "Protecting privacy through distributed computation in multi-agent decision making",
  JAIR 47, 2013. "Privacy-preserving multi-agent constraint satisfaction", PASSAT 2009 (opening by all). Desmedt,
  Frankel: "Threshold cryptosystems", CRYPTO 1989.

Why it is correct: in each turn robots are eliminated in the order of the circle, and each constraint is added by the
first robot of its scope: the dynamic programming of DPOP, in the order of a path. So the root reads the minimum over
all values that are compatible with those chosen before, and chooses one that attains it. By induction all chosen values
are part of one optimum. There are as many turns as robots, up to `spare`, and each has a fixed number of messages: it
ends.

Why nothing else is disclosed: a robot receives only the ciphers of a table, with fresh randomness from their sender,
and a share of the key is always missing for these. An opened cipher was encrypted again by the root and blinded by all
others: only the root reads its bit. The number of openings depends on public numbers. The following is disclosed:

- The range of all costs, as a sum over all robots, if there are three or more. With two robots it gives the range of
  the other robot, as any sum of two does.
- The optimum, and the number of connected robots, up to `spare`. The root also learns that no value declared before its
  own attains the optimum.
- The neighbours that come before a robot in a turn, and so the direction of the root. A robot may guess more from the
  number of axes of a table. In each turn axes have new codenames, and values have another order.
- Neighbours receive the declared values, which they know, but not which of these are forbidden by private constraints.

Encryption: ElGamal with a share of the key for each robot, in the group Edwards25519, by libsodium (PyNaCl: the extra
`private`). Keys come from `Protocol.secret`, as in P-DPOP.

The methods:

    circle, next root             `rerooting`        encrypt, open          `elgamal.TeamKey`
    linear orders, largest cost   `linear_order`     unary costs, + and min `encrypted_costs`
    UTIL                          `_process_table`   bisection              `_ask_team`, `Bisection`

Choices that the paper leaves open, and differences (its text was not available; this follows its principle):

- Only whether a sum is 0 matters: the sum of bits acts as "or". The paper's cost limit is computed, in a sum that
  begins with random numbers: the difference between the largest and the least costs of all robots.
- First all turns are executed without tables, for their sizes: a run that needs too much ends before it computes.
- The root also sends the first table, which has its own axis, so that the next robot cannot recognise that it is the
  first.
- Ties go to the root's value that is declared first.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), P2DPOP, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import assert_never, cast

import msgspec
import numpy as np

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.anonymous_dfs import AnonymousTreeMessage
from robochoc.protocols.private.ed25519 import NEEDS
from robochoc.protocols.private.encrypted_costs import Pair
from robochoc.protocols.private.linear_order import (
    AskAxis,
    Axis,
    CostRange,
    CostSum,
    Gone,
    LinearOrderProtocol,
    Plan,
    costs_to_add,
    own_costs,
    own_places,
    sources,
)
from robochoc.protocols.private.p_dpop import cells_of
from robochoc.protocols.private.rerooting import Join, Next, RerootingMessage, Setup, Vector
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class EncryptedTable(Message, frozen=True):
    """The planned table: for each cell and each cost, a cipher of whether this cost is sufficient.

    The last axis changes fastest, in the order of the plan, and costs within cells.
    """

    turn: int
    ciphers: bytes

    act = Act(Performative.REQUEST, "the receiver adds its costs, without reading the table")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"the table of turn {self.turn + 1}, encrypted: {len(self.ciphers):,} bytes"


class Opening(Message, frozen=True):
    """A cipher for the root to read, blinded by all robots before the receiver, and without their shares."""

    cipher: bytes

    act = Act(Performative.REQUEST, "the receiver blinds the cipher, and removes its share of the key")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"blind this cipher ({self.cipher[:2].hex()}), and take your share of the key off"


LinearMessage = CostSum | CostRange | Plan | AskAxis | Axis | Gone | EncryptedTable | Opening
"""The messages of the linear orders, one for each turn."""


class Bisection:
    """Finds the first of `places` for which a condition is true; the condition is also true for all later ones.

    The number of questions is always the highest that can be necessary, to hide the result.
    """

    def __init__(self, places: int) -> None:
        self._last = places - 1
        self._low = 0
        self._high = places
        self.left = places.bit_length()
        """The number of questions still to be asked."""

    @property
    def place(self) -> int:
        """The index to ask about next."""
        return min((self._low + self._high) // 2, self._last)

    def receive_answer(self, *, true: bool) -> None:
        """Process the answer for `place`."""
        if self._low < self._high:
            if true:
                self._high = self.place
            else:
                self._low = self.place + 1
        self.left -= 1

    @property
    def found(self) -> int:
        """When no question is left: the first index for which it is true; the number of indices if none is."""
        return self._low


class P2DPOP(LinearOrderProtocol):
    """One agent of P2-DPOP.

    State besides that of the linear orders:

    - `optimum`: the least cost of all connected robots, after this robot's first turn.
    """

    messages = AnonymousTreeMessage | RerootingMessage | LinearMessage
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Leaute & Faltings 2013",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        encrypted_tables=True,
        secret_keys=True,
        needs=NEEDS,
        privacy="constraints and domains of others, who they are, and their values",
        use_when="costs, few robots, and not even a domain may be told",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.optimum: int | None = None
        self._cells: list[list[Pair]] = []
        self._questions: list[Pair] = []
        """The root's ciphers, among which it searches for the first one that is not 0."""
        self._bisection: Bisection | None = None
        self._cost: int | None = None

    @property
    def findings(self) -> Findings:
        """The position in the tree; for its root also the optimum, after its turn."""
        return msgspec.structs.replace(super().findings, bound=self.optimum if self.parent is None else None)

    def handle(self, sender: str, message: Message) -> None:
        match cast("RerootingMessage | LinearMessage", message):
            case Join() | Setup() | Vector() as before:
                self.reroot(sender, before)
            case CostRange() as costs:
                self.learn_costs(sender, costs)
            case AskAxis(turn):
                self.answer(sender, turn)
            case Axis() | Gone() as answer:
                self.receive_answer(sender, answer)
            case Next():
                self.start_next_turn(sender)
            case CostSum() | Plan() | EncryptedTable() | Opening() as round_trip:
                self._receive_from_circle(sender, round_trip)
            case never:
                assert_never(never)

    def _receive_from_circle(self, sender: str, message: CostSum | Plan | EncryptedTable | Opening) -> None:
        """Send on a message for another robot in the circle; process a message for this one."""
        ring, _ = self.in_ring()
        onward = ring.on_its_way(sender)
        if onward is not None:
            self.send(onward, message)
            return
        match message:
            case CostSum():
                self.add_costs(message)
            case Plan():
                self.plan(message)
            case EncryptedTable():
                self._process_table(message)
            case Opening():
                self._open(message)
            case never:
                assert_never(never)

    def decide_alone(self) -> None:
        """Choose the best value; there is no neighbour."""
        costs = own_costs(self.problem)
        if costs.min() == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.value = int(costs.argmin())
        self.optimum = int(costs.min())

    # Tables, from the root round to the root

    def send_first_table(self) -> None:
        """As the root: send the encrypted private costs; once there is a value, only its costs."""
        ring, _ = self.in_ring()
        own = self.own_axis(self.turn)
        costs = np.full(len(own.order), INFINITE)
        alone = own_costs(self.problem)
        for code, index in own.codes(self._possible_values).items():
            costs[code] = alone[index] - self.least_own
        self.send(ring.onward, EncryptedTable(self.turn, self.cipher.encrypted(costs)))

    @property
    def _possible_values(self) -> Mapping[int, int]:
        """The indices of this robot's possible values; once a value is chosen, only its index."""
        places = own_places(self.problem)
        return places if self.value is None else {place: i for place, i in places.items() if i == self.value}

    def _process_table(self, table: EncryptedTable) -> None:
        """Add this robot's costs, minimise over its values, and send the table on; the root starts to read it."""
        if self.planning or table.turn != self.turn:
            raise ValueError(f"received an unexpected table for turn {table.turn}")
        own = self.own_axis(self.turn)
        incoming = {own.codename: len(own.order)} if self.is_root else self.places[self.turn].incoming
        if len(table.ciphers) != cells_of(incoming) * self.cipher.levels * self.cipher.size:
            raise ValueError(f"received a table of {len(table.ciphers):,} bytes, a size other than planned")
        cells = self.cipher.cells(table.ciphers)
        if self.is_root:
            self._start_reading([cells[code] for code in sorted(range(len(cells)), key=own.order.__getitem__)])
            return
        step = self.places[self.turn]
        codes = own.codes(self._possible_values)
        costs = costs_to_add(self.problem, step, own.codename, list(codes.values())) - self.least_own
        fewer = self.cipher.eliminated(cells, sources(step, own.codename, list(codes)), costs)
        ring, _ = self.in_ring()
        self.send(ring.onward, EncryptedTable(self.turn, fewer))

    # The root reads the optimum, and its value

    def _start_reading(self, cells: list[list[Pair]]) -> None:
        """Search for the least cost of all values; `cells` are in the order of the declared values."""
        if self._bisection is not None:
            raise ValueError("received a second table in this turn")
        self._cells, self._cost = cells, None
        self._questions = self.cipher.any_of(cells)
        self._bisection = Bisection(self.cipher.levels)
        self._ask_team(self._bisection)

    def _ask_team(self, bisection: Bisection) -> None:
        """Encrypt the next cipher again, as the robot before the root knows the table's ciphers; have it opened."""
        ring, key = self.in_ring()
        if bisection.left:
            self.send(ring.onward, Opening(key.renewed(self._questions[bisection.place])))
        elif self._cost is None:
            self._search_value(bisection.found)
        else:
            self._choose(bisection.found)

    def _search_value(self, cost: int) -> None:
        """Search for the first value that attains the least cost."""
        if self.costs is None or cost > self.costs.range:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.optimum = self.costs.least + cost
        self._cost = cost
        self._questions = self.cipher.prefixes(self._cells, cost)
        self._bisection = Bisection(len(self._cells) - 1)
        self._ask_team(self._bisection)

    def _open(self, opening: Opening) -> None:
        """Blind a cipher, and remove this robot's share; the root reads it."""
        ring, key = self.in_ring()
        if len(opening.cipher) != key.size:
            raise ValueError(f"received a cipher of {len(opening.cipher)} bytes; it must have {key.size}")
        (pair,) = key.checked(opening.cipher)
        if not self.is_root:
            self.send(ring.onward, Opening(key.stripped(key.blinded(pair))))
            return
        if self._bisection is None:
            raise ValueError("received an opened cipher without a request")
        self._bisection.receive_answer(true=not key.is_zero(key.stripped(pair)))
        self._ask_team(self._bisection)

    def _choose(self, place: int) -> None:
        """Choose the value at an index among the declared values, without sending it."""
        self.value = self._possible_values[place]
        self._cells, self._questions, self._bisection = [], [], None
        self.end_turn()
