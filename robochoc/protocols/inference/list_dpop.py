"""Listing DPOP: DPOP that also lists the optima.

DPOP (see `dpop.py`) whose robots store their tables of costs and their tables of numbers (see `count_dpop.py`) until
values are sent down. The numbers give each optimum of a tree a number. For several optima at once, the root sends its
values and, for each optimum, its number in the subtree of each child. So does each robot below. Without costs, the
optima are all solutions.

- **When to use**: to list the optima, or solutions, on a pseudo-tree with a small induced width. The result contains
  them as `optima`, all of them checked, with their total number.
- **Guarantees**: complete; it terminates with all optima, or with `limit` different optima if there are more, or with a
  proof that there is no solution.
- **Parameters (`--set`)**: `limit`, the maximum number of optima that are listed (default 100, at most 10,000);
  `memory`, the maximum number of bytes in a robot's tables (default 1 GiB).
- **Reference**: Petcu, Faltings: "A scalable method for multiagent constraint optimization", IJCAI 2005 (DPOP). The
  numbers are those of `count_dpop.py`.

The additions to counting DPOP are these methods:

    store the tables        `_process_joined`, `_additional_bytes`
    values go down          `_list`
    value and numbers       `_pick`

Choices:

- There is one message for each edge of the tree, whatever the number of optima. A robot learns, for each listed
  optimum, the values in its separator, its own value, and the number of this optimum in its subtree.
- In the first optimum, each robot has the first value that is possible with the values above it. The team adopts this
  optimum.
- Optima differ if robots see different values of each other. If local solutions of a robot look alike, as all those of
  a robot without neighbours do, the first one is listed, and they count as one here; `count-dpop` counts them all.
- Unconnected parts have a root each, which lists the optima of its tree. The run combines the lists.
- The list is checked against the files; if the files are on several machines, it is not checked.

>>> from robochoc.generators.random_csp import random_csp
>>> from robochoc.run import Options, Runtime, solve
>>> optima = solve(random_csp(6, 3, 0.5, 0.2), Options(protocol="list-dpop", runtime=Runtime.SIMULATOR)).optima
>>> optima.number, len(optima.assignments), len({tuple(one.values()) for one in optima.assignments})
(160, 100, 100)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, NamedTuple, assert_never, cast

import msgspec

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.findings import Findings, Listing
from robochoc.protocols.inference.count_dpop import (
    MOST_BITS,
    CountDimensions,
    CountDPOP,
    Counts,
    Numbers,
    bytes_of_numbers,
    numbers_of,
)
from robochoc.protocols.inference.dpop import UTIL, Domain, Proceed, TableSettings
from robochoc.protocols.inference.dpop_tables import (
    CoarseTable,
    Codes,
    Extent,
    Table,
    cost_at,
    cost_of,
    place_at,
    width_of,
)
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted

MOST_LISTED = 10_000


class ListDPOPSettings(TableSettings, frozen=True):
    """`limit`: the maximum number of optima listed. `memory`: the maximum number of bytes in a robot's tables."""

    limit: int = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.limit <= MOST_LISTED:
            raise ValueError(f"limit is {self.limit}; it must be from 1 to {MOST_LISTED:,} optima")


Number = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]+\Z", max_length=MOST_BITS // 4)]
"""Hexadecimal digits, because the number may need more than 64 bits."""


class ListedValues(Message, frozen=True):
    """For each listed optimum, the values in DPOP's VALUE, and the number of the receiver's part in this optimum.

    `assignments` are the values of the robots in the receiver's separator, as indices. `numbers` count, from 0, the
    cheapest assignments of its subtree under these values.
    """

    assignments: list[list[int]]
    numbers: list[Number]

    act = Act(Performative.INFORM, "the receiver learns the values above it in each optimum")

    def in_words(self, _: Wording) -> str:
        optima = "optimum" if len(self.numbers) == 1 else "optima"
        different = counted(len({*map(tuple, self.assignments)}), "combination")
        return f"{len(self.numbers):,} {optima}, with {different} of values of the robots in your separator"


class StoredTables(NamedTuple):
    """The joined tables (`costs`), the children's `numbers`, and this robot's tables (`least`, `ways`)."""

    costs: Sequence[Table | CoarseTable]
    numbers: Mapping[str, Numbers]
    least: Codes
    ways: Numbers


class ListDPOP(CountDPOP):
    """One agent of listing DPOP.

    State besides that of counting DPOP, whose numbers here count assignments that look different:

    - `kept`: the tables, until values have arrived;
    - `listed`: the index of this robot's value in each listed optimum.
    """

    messages = TreeMessage | Domain | CountDimensions | Proceed | UTIL | Counts | ListedValues
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Petcu & Faltings 2005",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        tables=True,
        wide_tables=True,
        privacy="constraints of others, but for sums",
        use_when="listing solutions or optima, small induced width",
    )
    settings: ClassVar[ListDPOPSettings] = ListDPOPSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.kept: StoredTables | None = None
        self.listed: list[int] | None = None

    def handle(self, sender: str, message: Message) -> None:
        match cast("Domain | CountDimensions | Proceed | UTIL | Counts | ListedValues", message):
            case ListedValues(assignments, numbers):
                self._values_handler(assignments, numbers)
            case Domain() | CountDimensions() | Proceed() | UTIL() | Counts() as others:
                super().handle(sender, others)
            case never:
                assert_never(never)

    @property
    def findings(self) -> Findings:
        """The findings of DPOP and the list; for a root also the number of optima of its tree."""
        listing = None if self.listed is None else Listing(self.listed, self.settings.limit)
        return msgspec.structs.replace(super().findings, listing=listing)

    # Counting, and stored tables

    def _plan(self) -> None:
        """Compute the number of bits needed for this robot's numbers."""
        own = len(self.problem.values).bit_length()
        self.bits = min(own + sum(self.bits_below.values()), MOST_BITS)

    def _own_ways(self) -> Numbers:
        """Count values, not the local solutions behind them."""
        return numbers_of([1] * len(self.problem.values), self.bits)

    def _additional_bytes(self, inputs: Sequence[Extent]) -> int:
        """Return the bytes for counting, and the bytes of all tables, which are stored."""
        cells = math.prod(self._own_sizes())
        own = cells * (width_of(self._dearest) + bytes_of_numbers(1, self.bits))
        below = sum(bytes_of_numbers(math.prod(self._child_sizes(child)), self.bits) for child in self.children)
        counting = super()._additional_bytes(inputs)
        return counting + own + below + sum(table.cells * table.width for table in inputs)

    def _process_joined(self, costs: Codes) -> None:
        """Count the assignments that attain each of the least `costs`; store the joined tables."""
        numbers = dict(zip(self._joined_children, self._below, strict=True))
        joined = [*self._joined]
        super()._process_joined(costs)
        if self._own_numbers is not None:
            self.kept = StoredTables(joined, numbers, costs, self._own_numbers)

    # Values, from the root down

    def _choose_optimal(self, assignment: Sequence[int]) -> None:
        """As the root, list the optima of the tree, up to the limit."""
        number = min(self.count or 0, self.settings.limit)
        self._list([assignment] * number, range(number))

    def _values_handler(self, assignments: Sequence[Sequence[int]], numbers: Sequence[str]) -> None:
        """Process the values above. Raises `ValueError` if they are invalid or unexpected."""
        shape = [self._sizes[name] for name in self.separator or ()]
        if not 0 < len(assignments) == len(numbers) <= self.settings.limit:
            found = f"{len(assignments):,} combinations of values, {len(numbers):,} numbers"
            raise ValueError(f"{found}; both must be the same, from 1 to {self.settings.limit:,}")
        for assignment in assignments:
            if len(assignment) != len(shape) or not all(
                0 <= place < size for place, size in zip(assignment, shape, strict=True)
            ):
                raise ValueError(f"{assignment} are not values of {', '.join(self.separator or ())}")
        self._list(assignments, [int(number, 16) for number in numbers])

    def _list(self, assignments: Sequence[Sequence[int]], numbers: Sequence[int]) -> None:
        """Choose this robot's values in the listed optima, and send the children their parts."""
        if self.kept is None:
            raise ValueError(f"{self.problem.agent} already has values, or has no table yet")
        picked = [self._pick(self.kept, one, number) for one, number in zip(assignments, numbers, strict=True)]
        self.kept, self.choices = None, None
        self.listed = [place for place, _ in picked]
        self.value = self.listed[0]
        robots = (self.problem.agent, *(self.separator or ()))
        views = [
            dict(zip(robots, (place, *one), strict=True)) for place, one in zip(self.listed, assignments, strict=True)
        ]
        for child in self.children:
            places = [[view[name] for name in self._axes[child]] for view in views]
            self.send(child, ListedValues(places, [f"{below[child]:x}" for _, below in picked]))

    def _pick(self, kept: StoredTables, assignment: Sequence[int], number: int) -> tuple[int, dict[str, int]]:
        """Return this robot's value in the optimum of its subtree with this `number`, and the children's numbers."""
        at = tuple(assignment)
        least = cost_at(kept.least, at)
        if least == math.inf or number >= int(kept.ways[at]):
            raise ValueError(f"{self.problem.agent}'s subtree has no optimum {number} under {assignment}")
        for place, charge in enumerate(self.problem.charges):
            if charge + sum(cost_of(table, (place, *at)) for table in kept.costs) == least:
                ways = {child: int(table[place_at(table, (place, *at))]) for child, table in kept.numbers.items()}
                all_ways = math.prod(ways.values())
                if number < all_ways:
                    return place, _digits(number, ways)
                number -= all_ways
        raise ValueError(f"{self.problem.agent}'s tables contradict each other")


def _digits(number: int, bases: dict[str, int]) -> dict[str, int]:
    """Return the digits of `number`, one for each base, the least significant digit last."""
    digits = dict[str, int]()
    for name in reversed(bases):
        number, digits[name] = divmod(number, bases[name])
    return digits
