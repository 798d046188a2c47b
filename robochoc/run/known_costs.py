"""The best cost and the best lower bound known so far, computed from the events of a run."""

from __future__ import annotations

from msgspec import UNSET

from robochoc.journal.events import AnyEvent, Began, Bounded, Decided, Heard
from robochoc.model.cost_units import Cost
from robochoc.model.problem import INFINITE
from robochoc.solver.exact_costs import EXACT
from robochoc.verification.objective import Objective


class KnownCosts:
    """Tracks the known costs during runs, from their events. Costs are in the user's units.

    The event `Began` starts a run without a known cost. Runs that do not minimise are ignored.

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
        self._minimises = False
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
                self._objective.change({event.robot: event.assignment})
                self._improve(self._objective.cost)
            case Heard():
                self._improve(event.cost)
            case Bounded() if event.robot in self._objective.interfaces and 0 <= event.bound <= EXACT:
                self._bounds[event.robot] = max(event.bound, self._bounds.get(event.robot, 0))
                self.bound = self._objective.in_user_units(sum(self._bounds.values()))
            case _:
                pass

    def _begin(self, began: Began) -> None:
        self._minimises = began.minimises is True
        self._objective.clear()
        self._least = INFINITE
        self._bounds.clear()
        self.best = self.bound = None
        if self._minimises and began.upper_bound is not UNSET:
            self._improve(began.upper_bound)

    def _improve(self, cost: float) -> None:
        if 0 <= cost < self._least and cost <= EXACT:
            self._least = cost
            self.best = self._objective.in_user_units(cost)
