"""Listing DPOP: DPOP that also lists the optima.

DPOP (see `dpop.py`) whose robots keep their tables, those of costs and those of numbers (see `count_dpop.py`), until
values go down. With the numbers the optima of a tree are numbered, and the root sends for several of them at once which
values it takes, and which number the subtree of each child has then. So does each robot. Without costs, the optima are
all solutions.

- **When to use**: to see which optima, or solutions, there are, on a pseudo-tree with a small induced width. The result
  has them as `optima`, each of them checked, and says how many there are in all.
- **Guarantees**: complete; it terminates with as many different optima as there are, or as are to be listed, or with a
  proof that there is no solution.
- **Parameters (`--set`)**: `limit`, the most optima that are listed (default 100, at most 10,000); `memory`, the bytes
  that the tables of a robot may take (default 1 GiB).
- **Reference**: Petcu, Faltings: "A scalable method for multiagent constraint optimization", IJCAI 2005 (DPOP). The
  numbers are those of `count_dpop.py`.

The additions to counting DPOP are these methods:

    tables are kept     `_use_joined`, `_kept_bytes`    which values, and which number for each child    `_pick`
    values go down      `_list`

Choices:

- There is one message for each edge of the tree, whatever the number of optima. A robot learns, for each optimum that
  is listed, the values of its separator and the own one, and which optimum of its subtree it is, by its number.
- In the first optimum, each robot has the first value that goes with the values above it. The team takes this one.
- Optima are told apart by what robots see of each other. Of local solutions of a robot that look alike, as all those
  of a robot without neighbours do, the first is listed, and they count as one here; `count-dpop` counts them all.
- Unconnected parts have a root each, which lists the optima of its tree. The run combines them.
- The list is checked with the files; where these are on several machines there is none.

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
from robochoc.protocols.inference.dpop import UTIL, Domain, DPOPSettings, Proceed
from robochoc.protocols.inference.dpop_tables import Codes, Extent, Table, cost_at, place_at, width_of
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted

MOST_LISTED = 10_000


class ListDPOPSettings(DPOPSettings, frozen=True):
    """`limit`: the most optima that are listed. `memory`: the bytes that the tables of a robot may take."""

    limit: int = 100

    def __post_init__(self) -> None:
        """Raise `ValueError` unless `memory` is positive, and `limit` is too and not too large."""
        super().__post_init__()
        if not 1 <= self.limit <= MOST_LISTED:
            raise ValueError(f"limit is a number of optima from 1 to {MOST_LISTED:,}, not {self.limit}")


Number = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]+\Z", max_length=MOST_BITS // 4)]
"""In hexadecimal digits, as it may need more than 64 bits."""


class ListedValues(Message, frozen=True):
    """For each optimum that is listed, what DPOP's VALUE has for one, and which of several the receiver's subtree has.

    `assignments` are the places of the values of the robots in the receiver's separator. `numbers` count, from 0 on,
    the cheapest assignments of its subtree under these values.
    """

    assignments: list[list[int]]
    numbers: list[Number]

    act = Act(Performative.INFORM, "the receiver learns the values above it in each optimum")

    def in_words(self, _: Wording) -> str:
        optima = "optimum" if len(self.numbers) == 1 else "optima"
        different = counted(len({*map(tuple, self.assignments)}), "combination")
        return f"{len(self.numbers):,} {optima}, with {different} of values of the robots in your separator"


class KeptTables(NamedTuple):
    """The tables that were joined (`costs`), the children's `numbers`, and the own tables (`least`, `ways`)."""

    costs: Sequence[Table]
    numbers: Mapping[str, Numbers]
    least: Codes
    ways: Numbers


class ListDPOP(CountDPOP):
    """One agent of listing DPOP.

    State besides counting DPOP's, whose numbers are of assignments that look different:

    - `kept`: the tables, until values have come;
    - `listed`: the place of the own value in each optimum that is listed.
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
        self.kept: KeptTables | None = None
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
        """DPOP's, and the list; for a root also the number of its tree's optima."""
        listing = None if self.listed is None else Listing(self.listed, self.settings.limit)
        return msgspec.structs.replace(super().findings, listing=listing)

    # What is counted, and kept

    def _plan(self) -> None:
        """Compute how many bits the own numbers can need."""
        own = len(self.problem.values).bit_length()
        self.bits = min(own + sum(self.bits_below.values()), MOST_BITS)

    def _own_ways(self) -> Numbers:
        """Values are told apart, and not the local solutions behind them."""
        return numbers_of([1] * len(self.problem.values), self.bits)

    def _kept_bytes(self, inputs: Sequence[Extent]) -> int:
        """Besides what counting takes, all tables stay."""
        cells = math.prod(self._own_sizes())
        own = cells * (width_of(self._dearest) + bytes_of_numbers(1, self.bits))
        below = sum(bytes_of_numbers(math.prod(self._child_sizes(child)), self.bits) for child in self.children)
        return super()._kept_bytes(inputs) + own + below + sum(table.cells * table.width for table in inputs)

    def _use_joined(self, costs: Codes) -> None:
        """Count the assignments that attain each of the least `costs`; keep what was joined."""
        numbers = dict(zip(self._joined_children, self._below, strict=True))
        joined = [*self._joined]
        super()._use_joined(costs)
        if self._own_numbers is not None:
            self.kept = KeptTables(joined, numbers, costs, self._own_numbers)

    # Values, from the root down

    def _choose_optimal(self, assignment: Sequence[int]) -> None:
        """As the root, list the optima of the tree, the first ones if there are too many."""
        number = min(self.count or 0, self.settings.limit)
        self._list([assignment] * number, range(number))

    def _values_handler(self, assignments: Sequence[Sequence[int]], numbers: Sequence[str]) -> None:
        """Process the values above. Raises `ValueError` if they are none, or this is not the time."""
        shape = [self._sizes[name] for name in self.separator or ()]
        if not 0 < len(assignments) == len(numbers) <= self.settings.limit:
            raise ValueError(f"{len(assignments)} combinations of values, and {len(numbers)} numbers")
        for assignment in assignments:
            if len(assignment) != len(shape) or not all(
                0 <= place < size for place, size in zip(assignment, shape, strict=True)
            ):
                raise ValueError(f"{assignment} are no values of {', '.join(self.separator or ())}")
        self._list(assignments, [int(number, 16) for number in numbers])

    def _list(self, assignments: Sequence[Sequence[int]], numbers: Sequence[int]) -> None:
        """Take the own values of the optima that are listed, and send the children what concerns them."""
        if self.kept is None:
            raise ValueError(f"{self.problem.agent} has values already, or no table yet")
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

    def _pick(self, kept: KeptTables, assignment: Sequence[int], number: int) -> tuple[int, dict[str, int]]:
        """Return the own value in the optimum of the subtree with this `number`, and the numbers for the children."""
        at = tuple(assignment)
        least = cost_at(kept.least, at)
        if least == math.inf or number >= int(kept.ways[at]):
            raise ValueError(f"{self.problem.agent}'s subtree has no optimum {number} under {assignment}")
        for place, charge in enumerate(self.problem.charges):
            if charge + sum(cost_at(table, place_at(table, (place, *at))) for table in kept.costs) == least:
                ways = {child: int(table[place_at(table, (place, *at))]) for child, table in kept.numbers.items()}
                all_ways = math.prod(ways.values())
                if number < all_ways:
                    return place, _digits(number, ways)
                number -= all_ways
        raise ValueError(f"{self.problem.agent}'s tables do not agree")


def _digits(number: int, bases: dict[str, int]) -> dict[str, int]:
    """Return the digits of `number`, one for each base, the last one the least significant."""
    digits = dict[str, int]()
    for name in reversed(bases):
        number, digits[name] = divmod(number, bases[name])
    return digits
