"""The best cost and the best lower bound known so far, computed from the events of a run."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from operator import attrgetter

from msgspec import UNSET

from robochoc.journal.events import AnyEvent, Began, Bounded, Decided, Heard
from robochoc.model.cost_units import Cost
from robochoc.model.problem import INFINITE
from robochoc.solver.exact_costs import EXACT
from robochoc.verification.objective import Objective


class KnownCosts:
    """Tracks the known costs during runs, from their events. Costs are in the user's units.

    The event `Began` starts a run without a known cost. Runs that do not minimise are ignored. If decisions with equal
    times are simultaneous (`Objective.in_step`), their cost is known when a decision with another time follows.

    The bounds reported by different robots apply to disjoint parts of the team, and costs are never negative. So the
    sum of the known bounds is always a bound for the whole team.

    Attributes:
        best: The cost of the cheapest assignment that the robots had together, or that a robot has received. None:
            no such assignment is known.
        bound: A lower bound of the cost (an upper bound if the problem is maximised). None: unknown.
    """

    def __init__(self, objective: Objective) -> None:
        self._objective = objective
        self._least: float = INFINITE
        self._bounds: dict[str, float] = {}
        self._earlier_bound: float = 0
        self._minimises = False
        self._last_t: float | None = None
        self.best: Cost | None = None
        self.bound: Cost | None = None

    def add(self, event: AnyEvent) -> None:
        """Update the known costs. Impossible events are ignored, since a journal may come from any source."""
        match event:
            case Began():
                self._begin(event)
            case _ if not self._minimises:
                pass
            case Decided() if event.robot in self._objective.interfaces:
                self._decided(event)
            case Heard():
                self._improve(event.cost)
            case Bounded() if event.robot in self._objective.interfaces and 0 <= event.bound <= EXACT:
                self._bounds[event.robot] = max(event.bound, self._bounds.get(event.robot, 0))
                self.bound = self._objective.in_user_units(max(self._earlier_bound, sum(self._bounds.values())))
            case _:
                pass

    def _begin(self, began: Began) -> None:
        self._minimises = began.minimises is True
        self._objective.clear()
        self._last_t = None
        self._earlier_bound = max(self._earlier_bound, sum(self._bounds.values()))
        self._bounds.clear()
        if began.continues is not True:
            self._least, self._earlier_bound = INFINITE, 0
            self.best = self.bound = None
        if self._minimises and began.upper_bound is not UNSET:
            self._improve(began.upper_bound)

    def _decided(self, event: Decided) -> None:
        objective = self._objective
        if objective.in_step and self._last_t is not None and event.t != self._last_t:
            self._improve(objective.cost)
        self._last_t = event.t
        objective.change({event.robot: event.assignment})
        if not objective.in_step:
            self._improve(objective.cost)

    def _improve(self, cost: float) -> None:
        if 0 <= cost < self._least and cost <= EXACT:
            self._least = cost
            self.best = self._objective.in_user_units(cost)


class DecidedValues:
    """An observer that stores the robots' decisions in a search, to find the cheapest assignment that they had.

    Journals and progress reports show the costs of these assignments. Their readers see the decisions in the order in
    which they were reported, or in the order of their times, so both orders count.
    """

    def __init__(self, objective: Objective) -> None:
        self._objective = objective
        self._minimises = False
        self._decisions: list[Decided] = []
        self._earlier: tuple[float, dict[str, dict[str, int]]] = (INFINITE, {})

    def __call__(self, event: AnyEvent) -> None:
        """Process one event. `Began` starts a search."""
        match event:
            case Began():
                self._earlier = self._cheapest_so_far() if event.continues is True else (INFINITE, {})
                self._minimises = event.minimises is True
                self._decisions = []
            case Decided() if self._minimises:
                self._decisions.append(event)
            case _:
                pass

    def cheapest(self) -> dict[str, dict[str, int]] | None:
        """Return the values of each robot in the cheapest assignment, or None if no assignment was feasible."""
        cost, values = self._cheapest_so_far()
        return values if cost < INFINITE else None

    def _cheapest_so_far(self) -> tuple[float, dict[str, dict[str, int]]]:
        """Return the cost and the values of the cheapest assignment in this search and those that it continues."""
        decisions = self._decisions
        by_time = sorted(decisions, key=attrgetter("t"))
        found = [self._cheapest(decisions), *([] if by_time == decisions else [self._cheapest(by_time)])]
        return min(self._earlier, *found, key=lambda one: one[0])

    def _cheapest(self, decisions: Sequence[Decided]) -> tuple[float, dict[str, dict[str, int]]]:
        """Return the cost and the values of the cheapest assignment in a sequence of decisions."""
        objective, least = self._objective, INFINITE
        best: dict[str, dict[str, int]] = {}
        since_best: dict[str, dict[str, int]] = {}
        objective.clear()
        for event, following in zip_longest(decisions, decisions[1:]):
            objective.change({event.robot: event.assignment})
            since_best[event.robot] = event.assignment
            if objective.in_step and following is not None and following.t == event.t:
                continue
            if objective.cost < least:
                least = objective.cost
                best |= since_best
                since_best = {}
        return least, best
