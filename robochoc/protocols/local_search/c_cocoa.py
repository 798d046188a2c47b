"""Continuous Cooperative Constraint Approximation (C-CoCoA).

CoCoA for real variables: each robot chooses one value, once. It asks its neighbours for the least cost of each point of
its grid, and chooses the best point as in CoCoA. Then it follows the gradient of its cost from there, anywhere in the
interval, while its neighbours have their final values, or those with the least cost in their answers.

- **When to use**: real variables (functional DCOPs), few messages: a fair answer at once, as a start for others.
- **Guarantees**: incomplete, no proof of optimality. It ends like CoCoA, with as many messages.
- **Parameters (`--set`)**: `moves`, the maximum number of steps along the gradient (default 100).
- **Reference**: Sarker, Choudhury, Khan: "A local search based approach to solve continuous DCOPs", AAMAS 2021 (arXiv
  2002.12427). Only the abstract was available; it combines CoCoA with non-linear optimisation, and the rules are built
  from this principle.

Differences from `cocoa`, and choices:

- An answer contains the neighbour's value with the least cost for each point (`CostsAt`), as in CoCoA for asymmetric
  costs.
- The gradient is computed by differences of one step of the precision, since costs may be any expressions. A move has
  the length of the distance of grid points at first; it is halved as long as it does not reduce the cost, which is
  exact. Fewer violated hard constraints are always better.
- Variables without real numbers keep their values of the best point.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), CCoCoA, Concurrent(seed=0)).search()
>>> result.metrics.messages["SetValue"], sum(map(len, result.assignments.values()))  # of 16 robots
(85, 16)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from robochoc.protocols import message as wire
from robochoc.protocols.local_search.cocoa import Burden, CoCoA, CostsAt, Hold, Inquiry, SetValue
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.compiling import mypyc_attr


class CCoCoASettings(Settings, frozen=True):
    """`moves`: the maximum number of steps along the gradient."""

    moves: int = 100

    def __post_init__(self) -> None:
        if self.moves < 0:
            raise ValueError(f"moves is {self.moves}; it must be 0 or more")


@mypyc_attr(allow_interpreted_subclasses=True)
class CCoCoA(CoCoA):
    """One agent of C-CoCoA. `responses` are the neighbours' best values for each of this robot's grid points."""

    messages: ClassVar[Any] = Inquiry | CostsAt | Hold | SetValue
    settings: ClassVar[CCoCoASettings] = CCoCoASettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Sarker, Choudhury, Khan 2021",
        complete=False,
        costs=True,
        continuous=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="real variables, few messages: one value each, once",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.points = problem.points()
        self.responses: dict[str, Sequence[wire.Value]] = {}

    def _answer(self, sender: str, values: list[wire.Value], known: Mapping[str, wire.Value]) -> None:
        """Send the least cost of each of the sender's values, and this robot's grid points with these costs."""
        view = {**known, **self.view}
        view.pop(self.problem.agent, None)
        totals = [self.problem.lexicographic_costs({**view, sender: value}) for value in values]
        least = [min(costs) for costs in totals]
        best = [self.problem.values[costs.index(cost)] for costs, cost in zip(totals, least, strict=True)]
        self.send(sender, CostsAt(least, best))

    def _own_sides(self, sender: str, values: list[wire.Value]) -> list[Burden]:
        """Store the values in an answer; this robot's costs are added when it chooses."""
        for value in dict.fromkeys(values):
            self.problem.refuse_value(sender, value)
        self.responses[sender] = values
        return [(0, 0)] * len(values)

    def _chosen(self, place: int) -> int:
        """Return the index of the value that the gradient leads to from a grid point."""
        if not self.points.is_real:
            return place
        view = {name: values[place] for name, values in self.responses.items()} | self.view
        position = [float(one) for one in self.points.position(place)]
        cost = self._cost(position, view)
        reach = max(self.points.highest) / (2 * len(self.problem.values))
        moves = 0
        while moves < self.settings.moves and reach >= 1 / 2:
            slope = self._slope(position, cost, view)
            steepest = max(map(abs, slope))
            if not steepest:
                break
            ahead = [one - reach * part / steepest for one, part in zip(position, slope, strict=True)]
            reached = [min(max(one, 0.0), most) for one, most in zip(ahead, self.points.highest, strict=True)]
            moves += 1
            after = self._cost(reached, view)
            if after < cost:
                position, cost = reached, after
            else:
                reach /= 2
        return self.problem.adopt(self.points.nearest(position))

    def _slope(self, position: list[float], cost: LexicographicCost, view: Mapping[str, wire.Value]) -> list[float]:
        """Return the difference of costs for one step on each real axis; 0 if neither direction is better."""
        slope = []
        for axis, nearby in enumerate(self.points.nearby):
            found = 0.0
            for step in (1, -1) if nearby == 1 else ():
                beside = [one + step * (place == axis) for place, one in enumerate(position)]
                after = self._cost(beside, view)
                if after < cost:
                    found = step * (float(after[1]) - float(cost[1]) if after[0] == cost[0] else -1.0)
            slope.append(found)
        return slope

    def _cost(self, position: Sequence[float], view: Mapping[str, wire.Value]) -> LexicographicCost:
        """Return the cost of a rounded position, with the neighbours' values in `view`."""
        return self.problem.cost_at(self.points.nearest(position), view)
