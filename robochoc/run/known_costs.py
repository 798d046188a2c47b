"""The known limits of the minimum cost during a run, from its events: the best cost so far, and a bound."""

from __future__ import annotations

from robochoc.journal.events import AnyEvent, Began, Bounded, Decided, Heard
from robochoc.model.cost_units import Cost
from robochoc.model.problem import INFINITE
from robochoc.solver.exact_costs import EXACT
from robochoc.verification.objective import Objective


class KnownCosts:
    """Follows the events of runs. Costs are in the user's numbers.

    `Began` opens a run, of which nothing is known yet. Those that do not minimise are passed over.

    Each robot's bound is for a part of the team that no other robot's bound is for, and costs are 0 or more inside: so
    the sum of those that are known is a bound for the whole team at any time.

    Attributes:
        best: The cost of the cheapest assignment that all robots together had, or one of them knows of. None: there
            was none.
        bound: No assignment costs less (where costs are maximised: none is worth more). None: not known.
    """

    def __init__(self, objective: Objective) -> None:
        self._objective = objective
        self._least: float = INFINITE
        self._bounds: dict[str, float] = {}
        self._minimises = False
        self.best: Cost | None = None
        self.bound: Cost | None = None

    def take(self, event: AnyEvent) -> None:
        """Take in an event. What cannot be is passed over: journals may come from anywhere."""
        match event:
            case Began():
                self._begin(event)
            case _ if not self._minimises:
                pass
            case Decided() if event.robot in self._objective.interfaces:
                self._objective.change({event.robot: event.assignment})
                self._improve(self._objective.cost)
            case Heard():
                self._improve(event.cost)
            case Bounded() if event.robot in self._objective.interfaces and 0 <= event.bound <= EXACT:
                self._bounds[event.robot] = max(event.bound, self._bounds.get(event.robot, 0))
                self.bound = self._objective.told(sum(self._bounds.values()))
            case _:
                pass

    def _begin(self, began: Began) -> None:
        self._minimises = began.minimises is True
        self._objective.clear()
        self._least = INFINITE
        self._bounds.clear()
        self.best = self.bound = None

    def _improve(self, cost: float) -> None:
        if 0 <= cost < self._least and cost <= EXACT:
            self._least = cost
            self.best = self._objective.told(cost)
