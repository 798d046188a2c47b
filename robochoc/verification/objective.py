"""The objective of a team: the costs of its constraints, and of withdrawn robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from robochoc.model.absence import restated
from robochoc.model.cost_units import Cost
from robochoc.model.costs import user_cost
from robochoc.model.problem import INFINITE, Constraint, Team, Value
from robochoc.solver.encoding import cost_function, max_cost

Price = Callable[[Sequence[int]], float]
"""The cost of a constraint, by the values of its variables."""


class Objective:
    """The objective for an assignment that changes.

    Args:
        team: The team, with normalised costs (`model/costs.py`).
        withdrawal_cost: The cost of withdrawing a robot of weight 1. Robots without values are withdrawn. None: no
            robot may withdraw, and the cost is infinite until all have values.
        in_step: Whether decisions of the same time are made at once, so that states in between are not assignments.

    Attributes:
        interfaces: The interface variables of each robot. Runs that reorder the team replace them.
    """

    def __init__(self, team: Team, withdrawal_cost: float | None = None, *, in_step: bool = False) -> None:
        self._team = team
        self.in_step = in_step
        self._weights = {robot.name: robot.weight for robot in team.robots}
        self._withdrawal_cost = withdrawal_cost
        self._constraints = list(team.constraints())
        self._prices: list[Price] = [cost_function(one, one.variables) for one in self._constraints]
        self._restated: dict[tuple[int, tuple[str, ...]], Constraint | None] = {}
        self._paid: list[float] = [0] * len(self._constraints)
        self._sum: float = 0
        self._broken = 0
        self._on: dict[str, list[int]] = {name: [] for name in team.variables}
        self.interfaces = {robot.name: robot.interface for robot in team.robots}
        self._variables = {robot.name: [variable.name for variable in robot.variables] for robot in team.robots}
        for number, constraint in enumerate(self._constraints):
            for name in constraint.variables:
                self._on[name].append(number)
            if not constraint.variables:
                self._pay(number, self._prices[number](()))
        self._values: dict[str, int] = {}
        self._absent = set(self._weights)
        self._weight = sum(self._weights.values())

    def change(self, own: Mapping[str, Mapping[str, int]]) -> None:
        """Set the values of some robots to `own`."""
        touched: dict[int, None] = {}
        for robot, values in own.items():
            for name in self._variables[robot]:
                self._values.pop(name, None)
                touched.update(dict.fromkeys(self._on[name]))
            self._values.update(values)
            if bool(values) is (robot in self._absent):
                self._weight += -self._weights[robot] if values else self._weights[robot]
                self._absent ^= {robot}
        for number in touched:
            names = self._constraints[number].variables
            known = all(name in self._values for name in names)
            if known:
                self._pay(number, self._prices[number]([self._values[name] for name in names]))
            else:
                self._pay(number, self._price_for_some(number) if self._withdrawal_cost is not None else 0)

    def _price_for_some(self, number: int) -> float:
        """Return the cost of a constraint when robots of its scope are absent."""
        constraint = self._constraints[number]
        absent = tuple([name for name in constraint.variables if name not in self._values])
        if (number, absent) not in self._restated:
            self._restated[number, absent] = restated(constraint, absent)
        in_force = self._restated[number, absent]
        return 0 if in_force is None else in_force.price(self._values)

    def _pay(self, number: int, cost: float) -> None:
        """Set what a constraint costs. The sum goes along: costs are integers, and infinite ones are counted."""
        for paid, sign in ((self._paid[number], -1), (cost, 1)):
            if paid == INFINITE:
                self._broken += sign
            else:
                self._sum += sign * paid
        self._paid[number] = cost

    def clear(self) -> None:
        """Take back the values of all robots."""
        self.change({robot: {} for robot in self._weights})

    def shown(self, values: Mapping[str, Value]) -> dict[str, dict[str, int]] | None:
        """Return each robot's variables for `values`, as neighbours see them; None if that is impossible."""
        if any(len(self.interfaces.get(robot, (*value, ""))) != len(value) for robot, value in values.items()):
            return None
        return {
            robot: {name: part for name, part in zip(self.interfaces[robot], value, strict=True) if part is not None}
            for robot, value in values.items()
        }

    @property
    def cost(self) -> float:
        """The cost of the present assignment."""
        if self._broken or (self._absent and self._withdrawal_cost is None):
            return INFINITE
        return self._sum + self._weight * (self._withdrawal_cost or 0)

    def told(self, cost: float) -> Cost:
        """Return `cost`, which includes withdrawal costs, in the user's numbers."""
        return user_cost(self._team, cost)


def withdrawal_cost(team: Team) -> float:
    """Return the cost of withdrawing a robot of weight 1. It is so high that no robot withdraws to save costs."""
    return 1 + sum(max_cost(constraint) for constraint in team.constraints())
