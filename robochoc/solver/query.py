"""The part of a network that a solver has to solve after propagation, and the answer for the whole network."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Self

from robochoc.solver.encoding import Codes, Costs, Network
from robochoc.solver.linear import Operand, renamed


class SolvedBy(StrEnum):
    """The source of an answer: propagation alone, enumeration in this process, or ACE."""

    PROPAGATION = "propagation"
    ENUMERATION = "enumeration"
    ACE = "ACE"


@dataclass(frozen=True)
class SolverAnswer:
    """The number of solutions, whether there are no others, and (unless only counted) the solutions."""

    found: int
    complete: bool
    solutions: tuple[Codes, ...]
    means: SolvedBy = SolvedBy.PROPAGATION


@dataclass(frozen=True)
class Query:
    """The part of a network that has to be solved: `asked` is the network of the variables at `places`.

    These are the variables that a table looks at after propagation. The others are `free`: every combination of
    their values goes with every solution. Wanted are solutions up to `limit`, or their number (`count_only`).
    """

    asked: Network
    places: Codes
    free: dict[int, Codes]
    limit: int | None
    count_only: bool
    costs: Costs
    """The variables at `places` whose codes are minimised. Of `free` ones the smallest code comes first."""

    @property
    def trivial(self) -> bool:
        """Return whether no query is needed: no variable depends on another any more."""
        return not self.places

    @classmethod
    def of(cls, network: Network, limit: int | None, *, count_only: bool, costs: Costs) -> Self:
        """Return what has to be asked of `network`, which is propagated."""
        bound = network.constrained
        places = tuple(sorted(bound))
        at = {place: index for index, place in enumerate(places)}
        operands_at: dict[Operand, Operand] = dict(at.items())
        asked = Network(
            tuple(network.domains[place] for place in places),
            tuple(replace(table, scope=tuple([at[place] for place in table.scope])) for table in network.tables),
            tuple(tuple([at[place] for place in scope]) for scope in network.different),
            tuple([renamed(formula, operands_at, {}) for formula in network.formulas]),
        )
        free = {place: domain for place, domain in enumerate(network.domains) if place not in bound}
        paid = tuple([(at[place], unit) for place, unit in costs if place in at])
        return cls(asked, places, free, limit, count_only, paid)

    def rows(self, numbers: Sequence[int]) -> list[Codes]:
        """Return the solutions of `asked` whose codes stand one after the other in `numbers`."""
        width = len(self.asked.domains)
        return [tuple(numbers[start : start + width]) for start in range(0, len(numbers), width)]

    def answered(self, found: int, *, complete: bool, solutions: Sequence[Codes], means: SolvedBy) -> SolverAnswer:
        """Return the answer for the whole, from that for `asked`."""
        total = found * math.prod(len(domain) for domain in self.free.values())
        wanted = total if self.limit is None else min(total, self.limit)
        whole = () if self.count_only else tuple(itertools.islice(self._combined(solutions), wanted))
        return SolverAnswer(wanted, complete and wanted == total, whole, means)

    def _combined(self, solutions: Sequence[Codes]) -> Iterator[Codes]:
        order = sorted(range(len(self.places) + len(self.free)), key=[*self.places, *self.free].__getitem__)
        for solution in solutions:
            for rest in itertools.product(*self.free.values()):
                flat = (*solution, *rest)
                yield tuple([flat[index] for index in order])
