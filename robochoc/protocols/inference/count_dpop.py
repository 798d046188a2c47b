"""Counting DPOP: DPOP that also counts the optima.

DPOP (see `dpop.py`) whose tables have two entries for each combination of values in the separator: the least cost of
the subtree, and the number of its assignments that attain this cost. Tables are joined by adding costs and multiplying
numbers, and projected by taking the least cost and summing the numbers that belong to it. So the root knows, besides
the optimum, the number of optima. Without costs, the optima are the solutions.

- **When to use**: to count, without a central solver, on a pseudo-tree with a small induced width. With `--count` the
  result contains the number. Otherwise it does no more than `dpop`.
- **Guarantees**: complete; it terminates with an optimum and the number of optima, or with a proof that there is no
  solution. Numbers are exact, whatever their size.
- **Parameters (`--set`)**: `memory`, the maximum number of bytes in a robot's tables (default 1 GiB).
- **Reference**: Petcu, Faltings: "A scalable method for multiagent constraint optimization", IJCAI 2005 (DPOP). The
  same elimination counts if sums and products replace minima and sums: Dechter, "Bucket elimination: a unifying
  framework for reasoning", Artificial Intelligence 113, 1999.

The additions to DPOP are these methods:

    join and project    `_process_joined`               table to the parent    `_send_table`
    sizes of numbers    `_plan`, `_additional_bytes`    child's table          `_counts_handler`

Choices:

- Each table of costs (UTIL) is followed by a table of numbers (`Counts`), with as many bytes for each number as the
  largest one needs.
- The number of bits of the numbers is sent with the sizes (`CountDimensions`), before any table is made. It is part of
  the memory need. A run ends if 2^20 bits or more are needed.
- A value of a robot with several variables counts once for each of its local solutions with the least cost.
- Unconnected parts have a root each, and each root knows the number for its tree. The run multiplies these numbers.
- If robots may withdraw, a withdrawn robot has exactly one assignment.
- The number itself is not checked, because a check of constraints cannot compute it.

>>> from robochoc.generators.random_csp import random_csp
>>> from robochoc.run import Options, Runtime, solve
>>> solve(random_csp(6, 3, 0.5, 0.2), Options(protocol="count-dpop", runtime=Runtime.SIMULATOR, count=True)).count
160
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, assert_never, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.dpop import DPOP, UTIL, VALUE, Dimensions, Domain, Need, Proceed, TableSettings
from robochoc.protocols.inference.dpop_tables import PIECE, CoarseTable, Codes, Extent, Table, costs_for
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted

MOST_BITS = 1 << 20
"""Also represents all larger numbers of bits; a run that needs so many ends."""


Bits = Annotated[int, msgspec.Meta(ge=0, le=MOST_BITS)]


class CountDimensions(Dimensions, frozen=True):
    """DPOP's `Dimensions`; `bits` are enough for the number of all assignments of the sender's subtree."""

    bits: Bits

    def in_words(self, words: Wording) -> str:
        return f"{super().in_words(words)}; {counted(self.bits, 'bit')} are enough for my numbers"


class Counts(Message, frozen=True):
    """A piece of the sender's table of numbers, in the order of UTIL's cells: the assignments that attain each cost.

    `numbers` are unsigned little-endian integers of `width` bytes, of any size.
    """

    width: Annotated[int, msgspec.Meta(ge=1, le=MOST_BITS // 8)]
    numbers: bytes

    act = Act(Performative.INFORM, "the receiver learns the number of ways to attain the costs of the sender's subtree")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        cells = counted(len(self.numbers) // self.width, "cell")
        return f"in how many ways my subtree attains the costs of my table: {cells}, of {counted(self.width, 'byte')}"


Numbers = NDArray[Any]


WORD = 64


_OBJECT = 40
"""The number of bytes of a Python integer besides its digits: its header, and the table's pointer to it."""


_SCRATCH = 24
"""The number of bytes for each cell while costs are compared: two sums, and the mask of equal ones."""


def bytes_of_numbers(cells: int, bits: int) -> int:
    """Return the size of a table of numbers below 2^`bits`."""
    return cells * (8 if bits <= WORD else _OBJECT + bits // 7)


def bytes_to_count(cells: int, bits: int, below: int) -> int:
    """Return the peak size for counting: the children's tables (`below` bytes) and this robot's.

    This robot's table exists four times: a product, the sum, an intermediate result, and the piece that is sent.
    """
    return 4 * bytes_of_numbers(cells, bits) + cells * _SCRATCH + 2 * below


def count_attaining(
    least: Codes,
    charges: Sequence[float],
    tables: Sequence[Table | CoarseTable],
    own: Numbers,
    below: Sequence[Numbers],
) -> Numbers:
    """Return the number of assignments that attain each cost in `least`: 0 if the cost is infinite.

    Args:
        least: The least costs in the joined `tables`.
        charges: The costs of this robot's values.
        tables: Tables of costs: this robot's axis first, then the axes of `least` (see `aligned`).
        own: The number of local solutions behind each of this robot's values.
        below: The children's tables of numbers, with the same axes.
    """
    wanted = costs_for(least[np.newaxis, ...], 0)
    found = np.zeros(least.shape, own.dtype)
    for value, charge in enumerate(charges):
        joined = np.full(least.shape, charge, np.float64)
        for table in tables:
            joined += costs_for(table, value)
        product = np.full(least.shape, own[value], own.dtype)
        for numbers in below:
            product *= numbers[value if len(numbers) > 1 else 0]
        product *= (joined == wanted) & (joined < math.inf)
        found += product
    return found


def numbers_of(values: Sequence[int], bits: int) -> Numbers:
    """Return a table of these values, with room for numbers below 2^`bits`."""
    return np.array(values, np.uint64 if bits <= WORD else np.object_)


def packed_numbers(table: Numbers) -> Iterator[tuple[int, bytes]]:
    """Yield `table` in pieces for messages, with as few bytes per number as the largest number needs."""
    flat = table.reshape(-1)
    width = max(1, -(-int(flat.max()).bit_length() // 8))
    step = max(1, PIECE // width)
    for start in range(0, flat.size, step):
        yield width, b"".join([int(one).to_bytes(width, "little") for one in flat[start : start + step]])


class IncomingNumbers:
    """A table of numbers below 2^`bits` that arrives in pieces; its table of `costs` has already arrived."""

    def __init__(self, costs: Codes, bits: int, own_bits: int) -> None:
        self._costs = costs
        self._bits = bits
        self._numbers: list[int] = []
        self._own_bits = own_bits

    @property
    def complete(self) -> bool:
        """True if the whole table has arrived."""
        return len(self._numbers) == self._costs.size

    @property
    def table(self) -> Numbers:
        """The numbers, in a table with the shape of the costs."""
        return numbers_of(self._numbers, self._own_bits).reshape(self._costs.shape)

    def add(self, width: int, piece: bytes) -> None:
        """Append the next piece. Raises `ValueError` if the bytes do not fit."""
        cells, odd = divmod(len(piece), width)
        start, left = len(self._numbers), self._costs.size - len(self._numbers)
        if odd or not 0 < cells <= left or width > max(1, -(-self._bits // 8)):
            raise ValueError(
                f"a piece has {len(piece):,} bytes, with {width} for each number, but the table lacks {left:,} numbers"
            )
        numbers = [int.from_bytes(piece[at : at + width], "little") for at in range(0, len(piece), width)]
        if max(numbers).bit_length() > self._bits:
            raise ValueError(f"a number is larger than 2^{self._bits}")
        finite = costs_for(self._costs.reshape(1, -1)[:, start : start + cells], 0) < math.inf
        if not np.array_equal(finite, [number > 0 for number in numbers]):
            raise ValueError("a number does not match its cost: it must be 0 exactly if the cost is infinite")
        self._numbers += numbers


class CountDPOP(DPOP):
    """One agent of counting DPOP.

    State besides that of DPOP:

    - `bits`: the bits needed for the number of assignments of this subtree; `bits_below`: those needed for the
      children's subtrees;
    - `numbers`: the children's tables of numbers;
    - `count`: the number of optima of the whole tree (at its root).
    """

    messages = TreeMessage | Domain | CountDimensions | Proceed | UTIL | Counts | VALUE
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2005",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        wide_tables=True,
        counts=True,
        privacy="constraints of others, but for sums",
        use_when="counting solutions or optima (--count), small induced width",
    )
    settings: ClassVar[TableSettings] = TableSettings()
    divides = False

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.bits = 0
        self.bits_below: dict[str, int] = {}
        self.numbers: dict[str, IncomingNumbers] = {}
        self.count: int | None = None
        self._joined_children: list[str] = []
        self._below: list[Numbers] = []
        self._own_numbers: Numbers | None = None

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | CountDimensions | Proceed | UTIL | Counts | VALUE", message):
            case Counts(width, numbers):
                self._counts_handler(sender, width, numbers)
            case Domain() | CountDimensions() | Proceed() | UTIL() | VALUE() as others:
                super().handle(sender, others)
            case never:
                assert_never(never)

    @property
    def findings(self) -> Findings:
        """Return the findings of DPOP; for a root also the number of optima of its tree."""
        return msgspec.structs.replace(super().findings, count=None if self.count is None else f"{self.count:x}")

    # The sizes of tables

    def _plan(self) -> None:
        """Compute the number of bits needed for this robot's numbers."""
        own = sum(self.problem.behind).bit_length()
        self.bits = min(own + sum(self.bits_below.values()), MOST_BITS)

    def _store_dimensions(self, child: str, dimensions: Dimensions) -> None:
        super()._store_dimensions(child, dimensions)
        self.bits_below[child] = cast("CountDimensions", dimensions).bits

    def _send_dimensions(self, dimensions: Dimensions) -> None:
        """Send the parent the dimensions of both tables."""
        sizes, dearest, width, most = msgspec.structs.astuple(dimensions)
        self.send(self.parent or "", CountDimensions(sizes, dearest, width, most, self.bits))

    def _check_limits(self, most: Need, width: int) -> None:
        """Raise `TooLargeError` as in DPOP, and if numbers have too many bits."""
        if self.bits >= MOST_BITS:
            raise TooLargeError(f"the number of assignments could have {MOST_BITS:,} bits or more: use dpop")
        super()._check_limits(most, width)

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes of the tables of numbers."""
        del inputs
        below = sum(bytes_of_numbers(math.prod(self._child_sizes(child)), self.bits) for child in self.children)
        return bytes_to_count(math.prod(self._own_sizes()), self.bits, below)

    # UTIL, from the leaves up

    def _counts_handler(self, child: str, width: int, numbers: bytes) -> None:
        """Store a piece of the child's table of numbers; compute this robot's tables when all are complete."""
        if child not in self.utils or not self.utils[child].complete:
            raise ValueError(f"{child} sent numbers before its costs")
        if child not in self.numbers:
            self.numbers[child] = IncomingNumbers(self.utils[child].costs, self.bits_below[child], self.bits)
        self.numbers[child].add(width, numbers)
        if self._all_arrived:
            self._compute_utils_of_all()

    def _compute_utils_of_all(self) -> None:
        """Join the children's tables, once the tables of numbers have arrived as well."""
        if len(self.numbers) < len(self.children) or not all(table.complete for table in self.numbers.values()):
            return
        self._joined_children = [*self.utils]
        self._below = [self._aligned(self.numbers[child].table, self._axes[child]) for child in self.utils]
        self.numbers.clear()
        super()._compute_utils_of_all()

    def _own_ways(self) -> Numbers:
        """Return the number of local solutions behind each of this robot's values."""
        return numbers_of(self.problem.behind, self.bits)

    def _process_joined(self, costs: Codes) -> None:
        """Count the assignments that attain each of the least `costs`."""
        self._own_numbers = count_attaining(costs, self.problem.charges, self._joined, self._own_ways(), self._below)
        self._below = []
        if self.parent is None:
            self.count = int(self._own_numbers.item())

    def _send_table(self, costs: Codes) -> None:
        """Send the parent the table of costs, and then the table of numbers."""
        super()._send_table(costs)
        numbers, self._own_numbers = self._own_numbers, None
        if numbers is not None:
            for width, piece in packed_numbers(numbers):
                self.send(self.parent or "", Counts(width, piece))
