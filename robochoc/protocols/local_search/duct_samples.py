"""The samples of a robot of DUCT in one context: how often each value was tried, and the costs that were found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robochoc.protocols.local_search.settings.duct import DUCTSettings
from robochoc.solver.compiled import LexicographicCost


class Samples:
    """The samples of one context.

    `local` are the costs of the own values with those above, and `options` the values that are still tried: those that
    break nothing above, and below which no context was hopeless. `scale` is the most that the subtree can cost; a
    broken constraint counts as much.
    """

    def __init__(self, local: Sequence[LexicographicCost], scale: int) -> None:
        self.options = [place for place, (broken, _) in enumerate(local) if not broken]
        self.taken = 0
        """The number of samples, of all values."""
        self._local = local
        self._scale = max(1, scale)
        self._tries = [0] * len(local)
        self._sums = [0] * len(local)
        self._least: list[int | None] = [None] * len(local)

    @property
    def best(self) -> int | None:
        """The least cost of the subtree that is known here, without a broken constraint; None if there is none yet."""
        return min((least for place in self.options if (least := self._least[place]) is not None), default=None)

    def total(self, place: int, below: Sequence[LexicographicCost]) -> LexicographicCost:
        """Return what a sample costs the subtree."""
        costs = [self._local[place], *below]
        return int(sum(broken for broken, _ in costs)), int(sum(cost for _, cost in costs))

    def rule_out(self, place: int) -> None:
        """Note that a value has no solution below."""
        self.taken += 1
        self.options = [option for option in self.options if option != place]

    def add(self, place: int, sample: LexicographicCost, below: Sequence[int | None]) -> None:
        """Note what a sample of a value has cost, and the best that each child knows for it."""
        broken, cost = sample
        self.taken += 1
        self._tries[place] += 1
        self._sums[place] += int(broken * self._scale + cost)
        if None not in below:
            self._least[place] = int(self._local[place][1]) + sum(best for best in below if best is not None)

    def next(self, settings: DUCTSettings) -> int:
        """Return the value for the next sample: one never tried, the cheapest first; then the least bound."""
        new = [place for place in self.options if not self._tries[place]]
        if new or not self.options:
            return self._cheapest(new or range(len(self._local)))
        return min(self.options, key=lambda place: self._measure(place, settings) - self._margin(place, settings))

    def final(self) -> int:
        """Return the value of the best solution; while there is none, the one that breaks least in the mean."""
        if self.best is not None:
            return next(place for place in self.options if self._least[place] == self.best)
        tried = [place for place in self.options if self._tries[place]]
        return min(tried, key=self._mean) if tried else self._cheapest(self.options or range(len(self._local)))

    def enough(self, settings: DUCTSettings) -> bool:
        """Return whether no other value is likely to be better by more than the error, or samples are used up."""
        if self.taken >= settings.samples or not self.options:
            return True
        if self.best is None or not all(self._tries[place] for place in self.options):
            return False
        best = self.final()
        threshold = self._measure(best, settings) - settings.error
        spread = math.log(2 / (1 - settings.confidence))
        others = [place for place in self.options if place != best]
        return all(
            self._measure(place, settings) - math.sqrt(spread / self._tries[place]) >= threshold for place in others
        )

    def _cheapest(self, places: Sequence[int]) -> int:
        return min(places, key=self._local.__getitem__)

    def _mean(self, place: int) -> float:
        """Return the mean cost of a value's samples, as a part of what the subtree can cost."""
        return self._sums[place] / (self._tries[place] * self._scale)

    def _measure(self, place: int, settings: DUCTSettings) -> float:
        """Return the cost by which a value is compared; the mean where no sample of it was a solution."""
        least = self._least[place]
        return self._mean(place) if settings.by == "mean" or least is None else least / self._scale

    def _margin(self, place: int, settings: DUCTSettings) -> float:
        """Return how much better than its samples a value may be: the less, the more often it was tried."""
        return settings.bound * math.sqrt(2 * math.log(2 * self.taken) / self._tries[place])
