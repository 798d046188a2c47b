"""The costs of a robot, for protocols that compute with them on shares.

Robots first send the numbers of their declared values (`Sizes`). Each robot computes the cost of each of its declared
values, alone and with the values of the robots before it: an impossible value costs as much as a broken constraint, or
more.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.linear_order import own_costs, own_places
from robochoc.protocols.private.shamir import FIELD_BITS, Field, field_of
from robochoc.protocols.private.shared_arithmetic import SharedArithmeticProtocol
from robochoc.protocols.wording import Wording
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted, listed

MOST_COMPARISONS = 10_000_000
MOST_VALUES = 10_000
_LEAST_BITS = 31


def check_settings(comparisons: int, bits: int) -> None:
    """Raise `ValueError` for invalid settings."""
    if not 1 <= comparisons <= MOST_COMPARISONS:
        raise ValueError(f"comparisons is {comparisons}; it must be from 1 to {MOST_COMPARISONS:,}")
    allowed = [one for one in FIELD_BITS if one >= _LEAST_BITS]
    if bits not in allowed:
        raise ValueError(f"bits is {bits}; it must be one of {', '.join(map(str, allowed))}")


class Sizes(Message, frozen=True):
    """The number of the sender's declared values, and the names of the robots before it in announced constraints.

    All robots need the latter to compute with the codes of these robots' values together.
    """

    values: int
    scopes: list[tuple[str, ...]]

    act = acts.TELL_DOMAIN
    proves_nothing = True  # the files declare it; names of robots are not measured

    def in_words(self, _: Wording) -> str:
        wide = "".join(f"; I share a constraint with {listed(scope)}" for scope in self.scopes)
        return f"I have {counted(self.values, 'declared value')}{wide}"


class SharedCostsProtocol(SharedArithmeticProtocol):
    """One robot that knows its costs as integers, and the sizes of all robots.

    Attributes:
        sizes: The number of declared values of each robot.
        scopes: For each robot, the ranks of the robots in each scope that it has announced.
        places: For each index of a declared value that is possible, the index of the value.
        alone: The cost of each declared value that does not depend on other robots.
        rows: For one robot before this one, and each declared value of this robot: the costs with each of its values.
        wide_rows: The same for several robots, in the order of ranks; the values of the last one change fastest.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.sizes: list[int] = []
        self.scopes: list[list[list[int]]] = []
        self.places: dict[int, int] = {}
        self.alone: list[int] = []
        self.rows: dict[tuple[str, ...], list[list[int]]] = {}
        self.wide_rows: dict[tuple[str, ...], list[list[int]]] = {}

    @property
    @abstractmethod
    def limits(self) -> tuple[int, int]:
        """The largest number of comparisons, and the number of bits of the field."""

    @abstractmethod
    def begin(self) -> None:
        """Begin to compute: all sizes are known."""

    @property
    def field(self) -> Field:
        return field_of(self.limits[1])

    @property
    def unit(self) -> int:
        """The factor of all finite costs. A protocol may add less than one unit to the cost of each value."""
        return 1

    @property
    def broken(self) -> int:
        """The cost of a broken hard constraint, above all sums of finite costs."""
        return 1 << 3 * self.field.bits // 5

    @property
    def excluded(self) -> int:
        """The cost of an impossible value."""
        return self.broken

    @property
    def announced_scopes(self) -> Sequence[tuple[str, ...]]:
        """The constraints with robots before this one that all robots need to know."""
        return [*self.wide_rows]

    def start(self) -> None:
        """Send the number of values; a robot alone decides."""
        self.places = own_places(self.problem)
        if not self.others:
            self._decide_alone()
            return
        self._check_sums()
        self._compute_costs()
        size = self.problem.declared_count(self.problem.agent)
        if size > MOST_VALUES:
            raise TooLargeError(f"{self.problem.agent} has {size:,} values, more than {MOST_VALUES:,}")
        for name in self.others:
            self.send(name, Sizes(size, [*self.announced_scopes]))
        self.wait_for(Sizes, self.others, "_use_sizes")
        self.proceed()

    def check_comparisons(self, number: int) -> None:
        """Raise `TooLargeError` if there are more comparisons than allowed."""
        if number > self.limits[0]:
            raise TooLargeError(
                f"the search needs {number:,} comparisons or more, above the limit of {self.limits[0]:,}"
                " (--set comparisons=N raises the limit)"
            )

    def _decide_alone(self) -> None:
        costs = own_costs(self.problem)
        if not len(costs) or costs.min() == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
        else:
            self.value = int(costs.argmin())

    def _compute_costs(self) -> None:
        problem, size = self.problem, self.problem.declared_count(self.problem.agent)
        alone, excluded = own_costs(problem), self.excluded
        self.alone = [self._number(alone[self.places[one]]) if one in self.places else excluded for one in range(size)]
        ranks = self.order.rank
        above = [name for name in problem.neighbours if ranks[name] < self.rank]
        for table in problem.tables({name: problem.declared(name) for name in above}):
            if not table.agents:
                continue
            agents = sorted(table.agents, key=ranks.__getitem__)
            axes = [*map(table.agents.index, agents), len(agents)]
            joined = table.joined().transpose(axes)
            costs = joined.reshape(math.prod(joined.shape[:-1]), joined.shape[-1])
            rows = self.rows if len(agents) == 1 else self.wide_rows
            known = rows.setdefault(tuple(agents), [[0] * len(costs) for _ in range(size)])
            for place, index in self.places.items():
                column = map(self._number, costs[:, index])
                known[place] = [one + two for one, two in zip(known[place], column, strict=True)]

    def _number(self, cost: float) -> int:
        return self.broken if cost == INFINITE else int(cost) * self.unit

    def _check_sums(self) -> None:
        """Raise `TooLargeError` if costs may add up to as much as a broken constraint, or these to p/16.

        A robot knows its constraints with robots before it. If each robot's add up to p/16 divided by the number of
        robots, all together do not exceed p/16.
        """
        scopes = self.problem.scopes(self.order.names)
        dearest = max((cost for cost in self.problem.charges if cost < INFINITE), default=0)
        robots = len(self.order.names)
        added = int(self.unit > 1)
        if (dearest + sum(most for _, most in scopes) + added) * self.unit * robots >= self.broken:
            without = ", or no preferences (--set preference=0)" if added else ""
            raise TooLargeError(
                f"costs may add up to {self.broken // self.unit:,}, too much for a field of {self.field.bits} bits: use"
                f" smaller costs, or a larger field (--set bits=N){without}"
            )
        if (len(scopes) + 2) * robots * self.broken >= self.field.prime // 16:
            raise TooLargeError(
                f"too many constraints for a field of {self.field.bits} bits: use a larger field (--set bits=N)"
            )

    def _use_sizes(self) -> None:
        received = [message for message in self.received() if isinstance(message, Sizes)]
        received.insert(self.rank, Sizes(self.problem.declared_count(self.problem.agent), [*self.announced_scopes]))
        self.sizes = [message.values for message in received]
        if not all(0 <= size <= MOST_VALUES for size in self.sizes):
            raise ValueError("received an invalid number of values")
        if 0 in self.sizes:  # all domains are empty after a change: nothing is left to search
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.scopes = [self._ranks_of(rank, message.scopes) for rank, message in enumerate(received)]
        for names, rows in self.rows.items():
            if len(rows[0]) != self.sizes[self.order.rank[names[0]]]:
                raise ValueError(f"{names[0]} sent another number of values than its file declares")
        self.begin()

    def _ranks_of(self, rank: int, scopes: Sequence[Sequence[str]]) -> list[list[int]]:
        """Return the ranks of the robots in announced scopes. Raises `ValueError` for impossible scopes."""
        found = [[self.order.rank.get(name, rank) for name in names] for names in scopes]
        for ranks in found:
            if not ranks or ranks != sorted({*ranks}) or ranks[-1] >= rank:
                raise ValueError("received the names of a constraint that is not shared with robots before the sender")
            if math.prod(self.sizes[one] for one in ranks) > MOST_VALUES:
                raise TooLargeError(f"the robots of a constraint have more than {MOST_VALUES:,} combinations of values")
        return found
