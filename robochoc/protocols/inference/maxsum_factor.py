"""Function nodes of a factor graph, and the sums of their messages (the Max-Sum family)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from operator import add, sub
from typing import TYPE_CHECKING, Self

from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Value

if TYPE_CHECKING:
    from robochoc.solver.cost_table import Array, CostTable


Row = list[float]
"""An entry for each value of a robot."""

SMALL = 400
"""Up to this number of entries, a table over two robots is processed faster as lists than in numpy."""

MOST = 2.0**512
"""The highest finite entry of Q.

In a graph with cycles, hard constraints can make entries grow in each cycle by the number of a robot's functions. An
entry that overflowed would count as a forbidden value, and lead to a false proof. Sums of as many entries as a robot
can have remain finite.
"""


class Factor:
    """A function node: the sum of all constraints over the same robots (`agents` and the robot that holds it).

    `charges` has an axis for each of these robots. Values that no constraint distinguishes share an index: `codes` has
    the index of each value, and None for robots whose values are all distinguished.
    """

    def __init__(self, agents: Sequence[str], charges: Array, codes: Sequence[Sequence[int] | None] = ()) -> None:
        self.agents = agents
        self.charges = charges
        self._codes = codes if any(one is not None for one in codes) else ()
        small = len(agents) == 1 and charges.size <= SMALL
        self._lines: tuple[list[Row], list[Row]] | None = (charges.tolist(), charges.T.tolist()) if small else None

    @classmethod
    def joined(cls, tables: Iterable[CostTable], *, of_values: bool = False) -> list[Self]:
        """Return one function for each set of robots in `tables`; tables over a single robot are left out.

        With `of_values`, each value has an index of its own.
        """
        sums: dict[tuple[str, ...], CostTable] = {}
        for table in tables:
            if table.agents:
                before = sums.get(table.agents)
                sums[table.agents] = table if before is None else table.after(before)
        if of_values:
            return [cls(agents, table.joined()) for agents, table in sums.items()]
        return [cls(agents, table.charges, table.distinct_codes()) for agents, table in sums.items()]

    def split(self, shares: Array) -> tuple[Factor, Factor]:
        """Return two functions whose sum is this one: one has its share (0 to 1) of each entry, one the rest.

        Forbidden combinations are forbidden in both functions.
        """
        return Factor(self.agents, self.charges * shares), Factor(self.agents, self.charges * (1 - shares))

    def divided(self, weight: float) -> Factor:
        """Return this function with all costs divided by `weight`."""
        return Factor(self.agents, self.charges / weight, self._codes)

    def r(self, q: Sequence[Row]) -> list[Row]:
        """Return the minimum cost of each robot's values, given the Q of the others, in the order of the axes."""
        if not self._codes:
            return self._answers(q)
        rows = [row if codes is None else _least_of(row, codes) for row, codes in zip(q, self._codes, strict=True)]
        answers = zip(self._answers(rows), self._codes, strict=True)
        return [answer if codes is None else [answer[code] for code in codes] for answer, codes in answers]

    def _answers(self, q: Sequence[Row]) -> list[Row]:
        """Return the minimum cost for each index on each axis, given the Q of the other axes."""
        if self._lines:
            (other, own), (lines, columns) = q, self._lines
            return [_least_sums(lines, own), _least_sums(columns, other)]
        return [self._least(place, q) for place in range(len(q))]

    def _least(self, place: int, q: Sequence[Row]) -> Row:
        """Return the minimum cost for each value on the axis at `place`."""
        import numpy as np  # noqa: PLC0415 - for large tables only

        axes = tuple([axis for axis in range(len(q)) if axis != place])
        total = self.charges
        for axis in axes:
            row = np.asarray(q[axis], np.float64)
            total = total + np.expand_dims(row, tuple([other for other in range(len(q)) if other != axis]))
        least: Row = total.min(axis=axes).tolist()
        return least


def _least_of(row: Row, codes: Sequence[int]) -> Row:
    """Return the minimum entry for each code."""
    least = [INFINITE] * (max(codes, default=-1) + 1)
    for entry, code in zip(row, codes, strict=True):
        least[code] = min(least[code], entry)
    return least


def _least_sums(lines: Sequence[Row], row: Row) -> Row:
    """Return the minimum entry of the sum of each of `lines` and `row`. Compiled loops are faster than `map`."""
    found: Row = []
    for line in lines:
        least = INFINITE
        for left, right in zip(line, row):  # noqa: B905 - `strict` is slow when compiled; all have the same length
            entry = left + right
            if entry < least:  # noqa: PLR1730 - faster
                least = entry
        found.append(least)
    return found


def total(first: Row, rows: Iterable[Row]) -> Row:
    """Return the sum of `first` and all `rows`, entry by entry."""
    for row in rows:
        first = list(map(add, first, row))  # not `sum`, whose rounding depends on the version of Python
    return first


def weighted(rows: Sequence[Row], weight: float) -> Sequence[Row]:
    """Return `rows` with all entries multiplied by `weight`."""
    return rows if weight == 1 else [[weight * entry for entry in row] for row in rows]


def without_each(first: Row, rows: Sequence[Row], z: Row, *, weight: float = 1) -> list[Row]:
    """Return, for each of `rows`, `z` without this row; `z` is the sum of `first` and all rows times `weight`.

    Nothing is subtracted from infinity: entries that are infinite in a row are left out of the sum.
    """
    if INFINITE in z:
        counted = weighted(rows, weight)
        found = [total(first, [*counted[:place], *counted[place + 1 :]]) for place in range(len(rows))]
        return found if weight == 1 else [_lowered(*pair, 1 - weight) for pair in zip(found, rows, strict=True)]
    return [list(map(sub, z, row)) for row in rows]


def _lowered(row: Row, by: Row, share: float) -> Row:
    """Return `row` minus the `share` of the finite entries in `by`."""
    return [entry if less == INFINITE else entry - share * less for entry, less in zip(row, by, strict=True)]


def from_zero(row: Row) -> Row:
    """Return `row` shifted to a minimum of 0, with no finite entry above `MOST`."""
    least = min(row)
    shifted = [entry - least for entry in row]
    if max(shifted) <= MOST:
        return shifted
    return [entry if entry <= MOST or entry == INFINITE else MOST for entry in shifted]


def cheapest(row: Row) -> int:
    """Return the index of the minimum; if there are several, the first."""
    return row.index(min(row))


class Functions:
    """The functions of a robot. `q`: for each robot above, the rows of its last Q, one for each function with it.

    All are 0 at first.
    """

    def __init__(self, tables: Iterable[CostTable], domains: Mapping[str, Sequence[Value]]) -> None:
        self.factors = Factor.joined(tables)
        self.q: dict[str, list[Row]] = {
            name: [[0.0] * len(values) for factor in self.factors if name in factor.agents]
            for name, values in domains.items()
        }
        self._sizes = {name: len(values) for name, values in domains.items()}

    def receive_q(self, name: str, rows: list[Row]) -> None:
        """Store Q from a robot above. Raises `ValueError` if the number or size of the rows is wrong."""
        self.q[name] = checked(rows, len(self.q[name]), self._sizes[name])

    def answers(self, own: Sequence[Row]) -> tuple[list[Row], dict[str, list[Row]]]:
        """Return R to this robot's variable, and to each robot above; `own` is its variable's Q."""
        q = {name: iter(rows) for name, rows in self.q.items()}
        mine: list[Row] = []
        theirs: dict[str, list[Row]] = {name: [] for name in self.q}
        for factor, row in zip(self.factors, own, strict=True):
            answers = factor.r([*[next(q[name]) for name in factor.agents], row])
            mine.append(answers.pop())
            for name, answer in zip(factor.agents, answers, strict=True):
                theirs[name].append(answer)
        return mine, theirs


def checked(rows: list[Row], many: int, size: int) -> list[Row]:
    """Return `rows`. Raises `ValueError` unless there are `many` rows, all with `size` entries."""
    if len(rows) != many or any(len(row) != size for row in rows):
        raise ValueError(f"the message must have {many:,} rows of {size:,} entries")
    return rows
