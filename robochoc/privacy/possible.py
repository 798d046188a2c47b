"""The possible costs of secrets, narrowed by statements about sums of secrets.

A secret is a cost: an integer from 0 to a known maximum, or `INFINITE`. Its possible costs are a range of finite costs,
and possibly infinity. Statements narrow them until nothing changes (bounds consistency): all statements are used, but
each statement considers only the bounds of its secrets. So true costs are never excluded, but some false costs may
remain.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field
from typing import NamedTuple, assert_never

from robochoc.model.problem import INFINITE
from robochoc.system.lazy_dataclass import dataclass

Secret = int
"""The number of a secret."""
Terms = tuple[Secret, ...]


class PossibleCosts(NamedTuple):
    """The finite costs from `least` to `most` (none if `most` is smaller), and `INFINITE` if `infinite`."""

    least: int
    most: int
    infinite: bool

    @property
    def number(self) -> int:
        """The number of possible costs."""
        return max(0, self.most - self.least + 1) + self.infinite

    @property
    def minimum(self) -> float:
        """The smallest possible cost."""
        return self.least if self.least <= self.most else INFINITE

    def contains(self, cost: float) -> bool:
        """Return whether `cost` is possible."""
        return self.infinite if cost == INFINITE else self.least <= cost <= self.most

    def at_least(self, cost: float) -> PossibleCosts:
        """Return the possible costs that remain if the secret is at least `cost`."""
        least = self.most + 1 if cost == INFINITE else max(self.least, math.ceil(cost))
        return PossibleCosts(least, self.most, self.infinite)

    def at_most(self, cost: float) -> PossibleCosts:
        """Return the possible costs that remain if the secret is at most `cost`, which is finite."""
        return PossibleCosts(self.least, min(self.most, math.floor(cost)), infinite=False)


ANY = PossibleCosts(0, 2**53, infinite=False)
"""Any finite cost; the sum of all costs is below 2^53 (`solver/exact_costs.py`)."""


class AtLeast(NamedTuple):
    """The sum of `terms` is at least `least`."""

    terms: Terms
    least: float


class AtMost(NamedTuple):
    """The sum of `terms` is at most `most`, which is finite."""

    terms: Terms
    most: float


class OneAtMost(NamedTuple):
    """At least one of these `sums` is at most `most`, which is finite."""

    sums: tuple[Terms, ...]
    most: float


class CostCase(NamedTuple):
    """A possible case: all secrets in `finite` are finite, and each item in `broken` has an infinite one."""

    finite: Terms
    broken: tuple[Terms, ...]


class OneCase(NamedTuple):
    """One of `cases` is true."""

    cases: tuple[CostCase, ...]


Statement = AtLeast | AtMost | OneAtMost | OneCase


@dataclass
class Knowledge:
    """The costs of all secrets that are still possible for an observer.

    Attributes:
        most: The largest finite cost of a secret.
        free: Secrets that may have any finite cost, and are never narrowed.
        known: The possible costs of narrowed secrets.
    """

    most: int
    free: Collection[Secret] = frozenset()
    known: dict[Secret, PossibleCosts] = field(default_factory=dict)
    _statements: dict[tuple[type[Statement], Statement], Statement] = field(default_factory=dict)

    def __getitem__(self, secret: Secret) -> PossibleCosts:
        if secret in self.free:
            return ANY
        known = self.known.get(secret)
        return PossibleCosts(0, self.most, infinite=True) if known is None else known

    def add_statement(self, statement: Statement) -> None:
        """Add a statement; `settle` draws the conclusions."""
        self._statements[type(statement), statement] = statement  # tuples of different types may be equal

    def open_cases(self, statement: OneCase) -> list[int]:
        """Return the indices of the cases that are still possible."""
        return [place for place, case in enumerate(statement.cases) if self._may_be(case)]

    def settle(self) -> None:
        """Draw all conclusions from single statements until nothing changes."""
        statements = list(self._statements.values())
        naming = _statements_by_secret(statements)
        waiting = deque(range(len(statements)))
        queued = set(waiting)
        while waiting:
            place = waiting.popleft()
            queued.discard(place)
            for secret in self._conclude(statements[place]):
                news = [other for other in naming[secret] if other not in queued]
                queued.update(news)
                waiting.extend(news)

    def _conclude(self, statement: Statement) -> list[Secret]:
        """Apply a statement, and return the narrowed secrets."""
        match statement:
            case AtLeast(terms, least):
                return self._at_least(terms, least)
            case AtMost(terms, most):
                return self._at_most(terms, most)
            case OneAtMost(sums, most):
                left = [terms for terms in sums if self._minimum(terms) <= most]
                return self._at_most(left[0], most) if len(left) == 1 else []
            case OneCase(cases):
                left_open = self.open_cases(statement)
                return self._apply(cases[left_open[0]]) if len(left_open) == 1 else []
            case never:
                assert_never(never)

    def _at_least(self, terms: Terms, least: float) -> list[Secret]:
        """Raise the smallest possible cost of each term to `least` minus the largest costs of the other terms."""
        changed: list[Secret] = []
        unbounded = [secret for secret in terms if self[secret].infinite]
        if len(unbounded) > 1:
            return changed
        rest = sum(self[secret].most for secret in terms if secret not in unbounded)
        for secret in unbounded or terms:
            others = rest if unbounded else rest - self[secret].most
            self._narrow(secret, self[secret].at_least(least - others), changed)
        return changed

    def _at_most(self, terms: Terms, most: float) -> list[Secret]:
        """Lower the largest possible cost of each term to `most` minus the smallest costs of the other terms."""
        changed: list[Secret] = []
        total = self._minimum(terms)
        for secret in terms if total < INFINITE else ():
            self._narrow(secret, self[secret].at_most(most - (total - self[secret].minimum)), changed)
        return changed

    def _apply(self, case: CostCase) -> list[Secret]:
        changed: list[Secret] = []
        for secret in case.finite:
            self._narrow(secret, self[secret]._replace(infinite=False), changed)
        for terms in case.broken:
            changed += self._at_least(terms, INFINITE)
        return changed

    def _may_be(self, case: CostCase) -> bool:
        finite = all(self[secret].minimum < INFINITE for secret in case.finite)
        return finite and all(any(self[secret].infinite for secret in terms) for terms in case.broken)

    def _minimum(self, terms: Terms) -> float:
        return sum(self[secret].minimum for secret in terms)

    def _narrow(self, secret: Secret, possible: PossibleCosts, changed: list[Secret]) -> None:
        if secret not in self.free and possible.number < self[secret].number:
            self.known[secret] = possible
            changed.append(secret)


def _statements_by_secret(statements: Sequence[Statement]) -> Mapping[Secret, list[int]]:
    """Return, for each secret, the indices of the statements about it."""
    found: dict[Secret, list[int]] = {}
    for place, statement in enumerate(statements):
        for secret in dict.fromkeys(_secrets(statement)):
            found.setdefault(secret, []).append(place)
    return found


def _secrets(statement: Statement) -> Iterable[Secret]:
    """Yield all secrets in a statement."""
    match statement:
        case AtLeast(terms) | AtMost(terms):
            yield from terms
        case OneAtMost(sums):
            for terms in sums:
                yield from terms
        case OneCase(cases):
            for case in cases:
                for terms in (case.finite, *case.broken):
                    yield from terms
        case never:
            assert_never(never)
