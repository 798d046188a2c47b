"""Private DPOP (P-DPOP): DPOP whose tables use codenames, codes and random keys.

Dynamic programming on a pseudo-tree for minimum cost, as in DPOP. Each robot sends its neighbours below (`Codes`) a
codename for itself, its values in a random order, and a random key for each value; the keys are different for each
neighbour. Tables (UTIL) contain codenames instead of robots' names, and codes instead of values; the robot that makes a
table adds, for each neighbour above, the key of that neighbour's value. Robots in between join and minimise tables that
they cannot read: a key depends on an axis that is still there. The robot with the codename knows all keys that were
added for it, and subtracts them. From the root down, robots receive the codes of the values above them (VALUE).

- **When to use**: costs, and constraints that third robots must not learn. It can be used if DPOP's tables fit into
  memory; it is slower.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Robots are assumed
  to follow the protocol, not to combine their knowledge, and to have channels that nobody else reads.
- **Parameters (`--set`)**: `cells`, the maximum number of cells in a table (default 1,000,000).
- **References**: Faltings, Leaute, Petcu: "Privacy guarantees through distributed constraint satisfaction", IAT 2008;
  Leaute, Faltings: "Protecting privacy through distributed computation in multi-agent decision making", JAIR 47, 2013.

Disclosed and hidden information:

- From messages, a robot learns no names of robots with which it shares no constraint (all robots know the team's
  names).
- A cell over another robot's codename is hidden by that robot's key. Keys have 100 bits; a broken hard constraint
  counts 2^60 instead of infinity, so that it reveals no more than costs do: to 2^-20 for a million constraints, and
  less for fewer.
- A robot sees the differences along its own axis, and the costs of a subtree that shares constraints only with it.
- Values are disclosed downwards: to robots that share a constraint with their owner. The root's choice and the tree are
  not hidden from neighbours.

Where keys come from: `Protocol.secret` (`protocols/key_stream.py`). Across machines it is the operating system; in the
simulator and in processes it follows from the seed, so that runs can be repeated.

The methods:

    choose codes     `start_in_tree`              join, subtract, minimise      `_compute_util`
    root, tree       `anonymous_dfs`              choose the value              `_choose`

Choices that the paper leaves open, and differences:

- A robot has one codename and one order of values for all neighbours below (the paper's merged codenames): tables from
  several branches can be joined. So the neighbours can find out that they share the same robot, if they compare their
  codenames.
- The root is elected by random scores in asynchronous waves. The paper's rounds with lies, which hide how far away the
  root is, are left out: a robot sees through which neighbour the root's wave came first.
- Ties go to the first value in its domain.
- The costs of a robot, times the number of robots, must be below 2^53; a run with larger costs ends.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), PDPOP, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar, assert_never, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import NOTHING, EveryValuePays, HasOnly, HasValue, Proof, Reception, SomeValuePays
from robochoc.protocols.findings import Findings
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.anonymous_dfs import AnonymousTreeMessage, AnonymousTreeProtocol
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import check_exact
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted

MOST_CELLS = 100_000_000
"""A table with this many cells takes gigabytes."""


class PDPOPSettings(Settings, frozen=True):
    """`cells`: the maximum number of cells in a table. A run that needs more ends."""

    cells: int = 1_000_000

    def __post_init__(self) -> None:
        if not 1 <= self.cells <= MOST_CELLS:
            raise ValueError(f"cells is {self.cells}; it must be from 1 to {MOST_CELLS:,}")


WIDTH = 16
"""The number of bytes of a cell, and of a key."""


BROKEN = 1 << 60
"""The cost of a broken hard constraint: above all finite costs, and hidden by the same keys."""


Shape = dict[str, int]
"""The axes of a table: codenames, each with its number of codes."""


class Codes(Message, frozen=True):
    """Codes and keys for the sender's values, for use by a neighbour below in messages that others must not understand.

    `codename` represents the sender; the code of a value is its index in `values`, which are in a random order. `keys`
    has a random key for each value, which is added to the value's costs in a table.
    """

    codename: str
    values: list[Value]
    keys: bytes

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return f"call me {self.codename[:4]}; {words.domain(self.values)}, and you get a key for each"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values))]


class UTIL(Message, frozen=True):
    """The sender's table, with codenames and codes: minimum costs of its subtree, each with keys added.

    The last axis changes fastest. Cells have `WIDTH` bytes, little-endian.
    """

    axes: Shape
    cells: bytes

    act = Act(Performative.INFORM, "the receiver learns the costs of the sender's subtree")

    def in_words(self, _: Wording) -> str:
        axes = counted(len(self.axes), "codename")
        return f"a table over {axes}: {counted(len(self.cells) // WIDTH, 'cost')}, hidden by keys"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return bounds on the sender's costs, if no other robot's key is in the table.

        Then all robots below the sender share constraints only with the receiver, which can subtract its keys.
        """
        subtree = _without(reception)
        near = [robot for robot in sorted(subtree) if robot in reception.neighbours(reception.receiver)]
        last = [reception.last(Codes, reception.receiver, robot) for robot in near]
        codes = [one for one in last if one is not None]
        if len(codes) < len(last) or list(self.axes) != [codes[0].codename]:
            return NOTHING
        found: list[Proof] = []
        keys = map(sum, zip(*(numbers(one.keys) for one in codes), strict=True))
        for value, cell, key in zip(codes[0].values, numbers(self.cells), keys, strict=True):
            cost = cell - key
            paid = INFINITE if cost >= BROKEN else cost
            found.append(SomeValuePays(reception.sender, {reception.receiver: value}, paid))
            if len(subtree) == 1:
                found.append(EveryValuePays(reception.sender, {reception.receiver: value}, paid))
        return found


class VALUE(Message, frozen=True):
    """The codes of the values above the receiver, by the codenames in its table."""

    codes: Shape

    act = Act(Performative.INFORM, "the receiver learns the values above it")

    def in_words(self, _: Wording) -> str:
        return f"the codes of {counted(len(self.codes), 'value')} above you"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the values of the robots that have sent the receiver their codes."""
        last = {
            robot: reception.last(Codes, robot, reception.receiver)
            for robot in reception.neighbours(reception.receiver)
        }
        return [
            HasValue(robot, codes.values[self.codes[codes.codename]])
            for robot, codes in sorted(last.items())
            if codes is not None and codes.codename in self.codes
        ]


def numbers(packed: bytes) -> list[int]:
    """Return the cells of a table, or keys."""
    return [int.from_bytes(packed[at : at + WIDTH], "little") for at in range(0, len(packed), WIDTH)]


def packed(cells: Iterable[int]) -> bytes:
    """Return cells, or keys, as bytes for a message."""
    return b"".join([cell.to_bytes(WIDTH, "little") for cell in cells])


def cells_of(shape: Shape) -> int:
    """Return the number of cells in a table, without allocating it."""
    return math.prod(shape.values())


def _without(reception: Reception) -> set[str]:
    """Return the robots that are connected with the sender by paths that avoid the receiver."""
    found = {reception.sender}
    waiting = [reception.sender]
    while waiting:
        for robot in reception.neighbours(waiting.pop()):
            if robot not in found and robot != reception.receiver:
                found.add(robot)
                waiting.append(robot)
    return found


KEY_BITS = 100
CODENAME = 32
"""The number of hexadecimal digits in a codename."""
MOST_AXES = 1_000
CellTable = NDArray[np.object_]
"""Integers of any size: keys are larger than numpy's own integers."""


class PDPOP(AnonymousTreeProtocol):
    """One agent of P-DPOP.

    State, in the order in which it becomes known:

    - `codename`; `coded`, for each code the index of this robot's value; `keys`, for each code the sum of all keys
      sent;
    - `above`, the codes of the neighbours above; `utils`, the children's tables;
    - `axes` of this robot's table, and `choices`, this robot's best value for each cell of the table;
    - `optimum`: the cost of the whole tree (at its root).
    """

    messages = AnonymousTreeMessage | Codes | UTIL | VALUE
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Faltings, Leaute, Petcu 2008; Leaute & Faltings 2013",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        wide_tables=True,
        secret_keys=True,
        privacy="constraints of others, and who they are",
        use_when="costs, and third robots must not learn of constraints",
    )
    settings: ClassVar[PDPOPSettings] = PDPOPSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.codename = ""
        self.coded: list[int] = []
        self.keys: list[int] = []
        self.above: dict[str, Codes] = {}
        self.utils: dict[str, UTIL] = {}
        self.axes: Shape = {}
        self.choices: NDArray[np.intp] | None = None
        self.optimum: int | None = None
        self._asked: dict[str, list[str]] = {}

    def start_in_tree(self) -> None:
        """Choose the codename, the codes and the keys, and send them to the neighbours below."""
        self.codename = f"{self.secret(4 * CODENAME):0{CODENAME}x}"
        self.coded = shuffled(range(len(self.problem.values)), self.secret)
        self.keys = [0] * len(self.coded)
        values = [self.problem.values[place] for place in self.coded]
        for name in self.descendants:
            keys = [self.secret(KEY_BITS) for _ in values]
            self.keys = [known + key for known, key in zip(self.keys, keys, strict=True)]
            self.send(name, Codes(self.codename, values, packed(keys)))
        self._compute_util()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Codes | UTIL | VALUE", message):
            case Codes() as codes:
                self._process_codes(sender, codes)
            case UTIL() as util:
                self._process_util(sender, util)
            case VALUE(codes):
                if self.choices is None or codes.keys() != self.axes.keys():
                    raise ValueError(f"{sender} sent values for other axes than those of {self.problem.agent}'s table")
                self._choose(codes)
            case never:
                assert_never(never)

    @property
    def findings(self) -> Findings:
        """The position in the tree; for a root also the optimum of its tree, once it has received all tables."""
        return msgspec.structs.replace(super().findings, bound=self.optimum)

    def _process_codes(self, sender: str, codes: Codes) -> None:
        if sender not in self.ancestors or sender in self.above:
            raise ValueError(f"{sender} sent unexpected or repeated Codes")
        if len(codes.codename) != CODENAME or not 0 < len(codes.values) * WIDTH == len(codes.keys):
            raise ValueError(
                f"{sender} sent invalid Codes: {len(codes.values):,} values, {len(codes.keys):,} bytes of keys"
            )
        self.above[sender] = codes
        self._compute_util()

    def _process_util(self, sender: str, util: UTIL) -> None:
        if sender not in self.children or sender in self.utils:
            raise ValueError(f"{sender} sent an unexpected or repeated UTIL")
        if (
            len(util.axes) > MOST_AXES
            or min(util.axes.values(), default=0) < 1
            or util.axes.get(self.codename) != len(self.coded)
            or len(util.cells) != cells_of(util.axes) * WIDTH
        ):
            raise ValueError(f"{sender} sent an invalid UTIL: {len(util.axes):,} axes, {len(util.cells):,} bytes")
        self.utils[sender] = util
        self._compute_util()

    # UTIL, from the leaves up

    def _compute_util(self) -> None:
        """Once all codes and tables have arrived: join, subtract this robot's keys, minimise, add others' keys."""
        if len(self.above) < len(self.ancestors) or len(self.utils) < len(self.children):
            return
        self.axes = self._own_axes()
        joined = self.joined()
        self.choices = np.asarray(joined.argmin(axis=0))  # numpy returns a scalar for a single cell
        cells = np.asarray(joined.min(axis=0), object)
        self._asked = {child: list(util.axes) for child, util in self.utils.items()}
        self.utils.clear()
        if self.parent is not None:
            self.send_table(self.parent, packed(cells.reshape(-1)))
        elif cells.item() >= BROKEN:
            self.conclude(Verdict.NO_SOLUTION)
        else:
            self.optimum = cells.item()
            self.decide_as_root()

    def send_table(self, parent: str, cells: bytes) -> None:
        """Send this robot's table to the parent."""
        self.send(parent, UTIL(self.axes, cells))

    def decide_as_root(self) -> None:
        """Choose the best value, and send values down from the root."""
        self._choose({})

    def _own_axes(self) -> Shape:
        """Return the axes of this robot's table, in an order that reveals nothing. Raises `TooLargeError`."""
        axes = {codes.codename: len(codes.values) for codes in self.above.values()}
        for child, util in self.utils.items():
            for codename, size in util.axes.items():
                if codename != self.codename and axes.setdefault(codename, size) != size:
                    raise ValueError(f"{child} sent a wrong number of values of a codename: {size:,}")
        if cells_of(axes) * len(self.coded) > self.settings.cells:
            raise TooLargeError(
                f"{self.problem.agent} needs a table of {cells_of(axes) * len(self.coded):,} cells, more than"
                f" {self.settings.cells:,} (--set cells=N raises the limit)"
            )
        return dict(sorted(axes.items()))

    def joined(self) -> CellTable:
        """Return the sum of this robot's costs, the children's tables and all keys; its values come first, uncoded."""
        charges = self.problem.charges
        scopes = self.problem.scopes(self.ancestors)
        dearest = max((cost for cost in charges if cost < INFINITE), default=0)
        check_exact((dearest + sum(most for _, most in scopes)) * len(self.order.names))
        uncoded = sorted(range(len(self.coded)), key=self.coded.__getitem__)
        own = np.array([_number(cost) for cost in charges], object)
        joined = np.zeros((len(own), *self.axes.values()), object)
        joined += self._aligned(own, [self.codename])
        joined -= self._aligned(np.array(self.keys, object)[uncoded], [self.codename])
        for util in self.utils.values():
            axes = list(util.axes)
            table = np.array(numbers(util.cells), object).reshape(list(util.axes.values()))
            joined += self._aligned(table.take(uncoded, axes.index(self.codename)), axes)
        for one in self.above.values():
            joined += self._aligned(np.array(numbers(one.keys), object), [one.codename])
        domains = {name: codes.values for name, codes in self.above.items()}
        for charged in self.problem.tables(domains):
            costs = charged.joined()
            numbered = np.array([_number(cost) for cost in costs.reshape(-1)], object)
            names = [*(self.above[name].codename for name in charged.agents), self.codename]
            joined += self._aligned(numbered.reshape(costs.shape), names)
        return joined

    def _aligned(self, table: CellTable, axes: Sequence[str]) -> CellTable:
        """Return `table` with this robot's axis first, then those of its table (length 1 if missing)."""
        onto = (self.codename, *self.axes)
        table = table.transpose([axes.index(codename) for codename in onto if codename in axes])
        return table[tuple([slice(None) if codename in axes else np.newaxis for codename in onto])]

    # VALUE, from the root down

    def _choose(self, codes: Mapping[str, int]) -> None:
        """Choose the best value for these codes, and send the children the codes for their tables."""
        if self.choices is None or not all(0 <= codes[codename] < size for codename, size in self.axes.items()):
            raise ValueError(f"{self.problem.agent} has no table for these codes: {dict(codes)}")

        self.value = int(self.choices[tuple([codes[codename] for codename in self.axes])])
        self.choices = None
        known = {**codes, self.codename: self.coded.index(self.value)}
        for child in self.children:
            self.send(child, VALUE({codename: known[codename] for codename in self._asked[child]}))


def _number(cost: float) -> int:
    return BROKEN if cost == INFINITE else int(cost)
