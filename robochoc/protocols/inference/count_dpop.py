"""Counting DPOP: DPOP that also counts the optima.

DPOP (see `dpop.py`) whose tables have two entries for each combination of values of the separator: the least cost of
the subtree, and the number of its assignments that attain it. Tables are joined by adding costs and multiplying
numbers, and projected by taking the least cost and the sum of the numbers that go with it. So the root knows, besides
the optimum, how many optima there are. Without costs these are the solutions.

- **When to use**: to count, without a central solver, on a pseudo-tree with a small induced width. With `--count` the
  result has the number. As a solver it does no more than `dpop`.
- **Guarantees**: complete; it terminates with an optimum and the number of optima, or with a proof that there is no
  solution. Numbers are exact, whatever their size.
- **Parameters (`--set`)**: `memory`, the bytes that the tables of a robot may take (default 1 GiB).
- **Reference**: Petcu, Faltings: "A scalable method for multiagent constraint optimization", IJCAI 2005 (DPOP). That
  the same elimination counts where sums and products take the place of minima and sums: Dechter, "Bucket elimination:
  a unifying framework for reasoning", Artificial Intelligence 113, 1999.

The additions to DPOP are these methods:

    join and project    `_use_joined`                   table to the parent    `_send_table`
    sizes of numbers    `_plan`, `_kept_bytes`          child's table          `_counts_handler`

Choices:

- Each table of costs (UTIL) is followed by one of numbers (`Counts`), of as many bytes a number as the largest needs.
- How many bits the numbers can need is sent with the sizes (`CountDimensions`), before any table is made. It is part of
  the memory need. 2^20 bits or more end the run.
- A value of a robot with several variables counts as often as local solutions of least cost look like it.
- Unconnected parts have a root each, and each root knows the number of its tree. The run multiplies them.
- Where robots may withdraw, to have withdrawn is one assignment of a robot.
- The number itself is not checked, as no check of constraints can tell it.

>>> from robochoc.generators.random_csp import random_csp
>>> from robochoc.run import Options, Runtime, solve
>>> solve(random_csp(6, 3, 0.5, 0.2), Options(protocol="count-dpop", runtime=Runtime.SIMULATOR, count=True)).count
160
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import assert_never, cast

import msgspec

from robochoc.model.message import Message
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.dpop import DPOP, keep_once
from robochoc.protocols.inference.dpop_counts import (
    IncomingNumbers,
    Numbers,
    bytes_of_numbers,
    bytes_to_count,
    count_attaining,
    numbers_of,
    packed_numbers,
)
from robochoc.protocols.inference.dpop_tables import Codes, Extent
from robochoc.protocols.inference.messages.count_dpop import MOST_BITS, CountDimensions, Counts
from robochoc.protocols.inference.messages.dpop import UTIL, VALUE, Dimensions, Domain, Need, Proceed
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.encoding import TooLargeError


class CountDPOP(DPOP):
    """One agent of counting DPOP.

    State besides DPOP's:

    - `bits`: enough for the number of assignments of the own subtree; `bits_below`: of the children's;
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
        """Dispatch on the message's type."""
        match cast("Domain | CountDimensions | Proceed | UTIL | Counts | VALUE", message):
            case Domain(values):
                keep_once(sender, values, self.domains, self.ancestors)
                self._measure()
            case CountDimensions() as dimensions:
                self._check(sender, dimensions)
                keep_once(sender, dimensions, self.dimensions, self.children)
                self.bits_below[sender] = dimensions.bits
                self._measure()
            case Proceed(separator):
                self._proceed(separator)
            case UTIL(width, costs):
                self._util_message_handler(sender, width, costs)
            case Counts(width, numbers):
                self._counts_handler(sender, width, numbers)
            case VALUE(assignment):
                self._value_message_handler(assignment)
            case never:
                assert_never(never)

    @property
    def findings(self) -> Findings:
        """Return DPOP's findings; for a root also the number of its tree's optima."""
        return msgspec.structs.replace(super().findings, count=None if self.count is None else f"{self.count:x}")

    # How large tables will be

    def _plan(self) -> None:
        """Compute how many bits the own numbers can need."""
        own = sum(self.problem.behind).bit_length()
        self.bits = min(own + sum(self.bits_below.values()), MOST_BITS)

    def _tell(self, dimensions: Dimensions) -> None:
        """Send the parent the dimensions of the own tables."""
        sizes, dearest, width, most = msgspec.structs.astuple(dimensions)
        self.send(self.parent or "", CountDimensions(sizes, dearest, width, most, self.bits))

    def _refuse(self, most: Need, width: int) -> None:
        """Raise `TooLargeError` as DPOP does, and for numbers that are too long."""
        if self.bits >= MOST_BITS:
            raise TooLargeError(f"the number of assignments could have {MOST_BITS:,} bits or more")
        super()._refuse(most, width)

    def _kept_bytes(self, inputs: Sequence[Extent]) -> int:
        """The tables of numbers are there besides those of costs."""
        del inputs
        below = sum(bytes_of_numbers(math.prod(self._child_sizes(child)), self.bits) for child in self.children)
        return bytes_to_count(math.prod(self._own_sizes()), self.bits, below)

    # UTIL, from the leaves up

    def _counts_handler(self, child: str, width: int, numbers: bytes) -> None:
        """Store a piece of the child's table of numbers; compute the own tables when all are complete."""
        if child not in self.utils or not self.utils[child].complete:
            raise ValueError(f"{child} sends numbers, and its costs have not come")
        if child not in self.numbers:
            self.numbers[child] = IncomingNumbers(self.utils[child].costs, self.bits_below[child], self.bits)
        self.numbers[child].add(width, numbers)
        if self._all_arrived:
            self._compute_utils_of_all()

    def _compute_utils_of_all(self) -> None:
        """Join the children's tables, once those of numbers have arrived as well."""
        if len(self.numbers) < len(self.children) or not all(table.complete for table in self.numbers.values()):
            return
        self._joined_children = [*self.utils]
        self._below = [self._aligned(self.numbers[child].table, self._axes[child]) for child in self.utils]
        self.numbers.clear()
        super()._compute_utils_of_all()

    def _own_ways(self) -> Numbers:
        """Return how many local solutions stand behind each own value."""
        return numbers_of(self.problem.behind, self.bits)

    def _use_joined(self, costs: Codes) -> None:
        """Count the assignments that attain each of the least `costs`."""
        self._own_numbers = count_attaining(costs, self.problem.charges, self._joined, self._own_ways(), self._below)
        self._below = []
        if self.parent is None:
            self.count = int(self._own_numbers.item())

    def _send_table(self, costs: Codes) -> None:
        """Send the parent the table of costs, and then that of numbers."""
        super()._send_table(costs)
        numbers, self._own_numbers = self._own_numbers, None
        if numbers is not None:
            for width, piece in packed_numbers(numbers):
                self.send(self.parent or "", Counts(width, piece))
