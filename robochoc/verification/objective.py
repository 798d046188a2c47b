"""The objective of a team: the costs of its constraints, and of withdrawn robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from robochoc.model.absence import restated
from robochoc.model.cost_units import Cost
from robochoc.model.costs import cost_converter
from robochoc.model.problem import INFINITE, Constraint, Team, Value
from robochoc.solver.encoding import cost_function, max_cost

Price = Callable[[Sequence[int]], float]
"""The cost of a constraint as a function of the values of its variables."""


class Objective:
    """The objective for a changing assignment.

    Args:
        team: The team, with normalised costs (`model/costs.py`).
        withdrawal_cost: The cost of withdrawing a robot of weight 1. Robots without values are withdrawn. If None, no
            robot may withdraw, and the cost is infinite until all robots have values.
        in_step: True if decisions with equal times are simultaneous, so that the states between them do not count.

    Attributes:
        interfaces: The interface variables of each robot. Runs that reorder the team replace this mapping.
    """

    def __init__(self, team: Team, withdrawal_cost: float | None = None, *, in_step: bool = False) -> None:
        self._in_user_units = cost_converter(team)
        self.in_step = in_step
        self._weights = {robot.name: robot.weight for robot in team.robots}
        self._withdrawal_cost = withdrawal_cost
        self._constraints = list(team.constraints())
        self._prices: list[Price] = [cost_function(one, one.variables) for one in self._constraints]
        self._restated: dict[tuple[int, tuple[str, ...]], Constraint | None] = {}
        self._scopes = [one.variables for one in self._constraints]
        self._on: dict[str, list[int]] = {name: [] for name in team.variables}
        self.interfaces = {robot.name: robot.interface for robot in team.robots}
        self._variables = {robot.name: [variable.name for variable in robot.variables] for robot in team.robots}
        for number, names in enumerate(self._scopes):
            for name in names:
                self._on[name].append(number)
        self.reset()

    def reset(self) -> None:
        """Return to the initial state, in which no robot has values and only constraints on constants are priced."""
        self._costs: list[float] = [0] * len(self._constraints)
        self._sum: float = 0
        self._broken = 0
        for number, names in enumerate(self._scopes):
            if not names:
                self._set_cost(number, self._prices[number](()))
        self._values: dict[str, int] = {}
        self._absent = set(self._weights)
        self._weight = sum(self._weights.values())

    def change(self, own: Mapping[str, Mapping[str, int]]) -> None:
        """Set the values of some robots to the values in `own`."""
        touched: set[int] = set()
        for robot, values in own.items():
            for name in self._variables[robot]:
                self._values.pop(name, None)
                touched.update(self._on[name])
            self._values.update(values)
            if bool(values) is (robot in self._absent):
                self._weight += -self._weights[robot] if values else self._weights[robot]
                self._absent ^= {robot}
        known, costs = self._values, self._costs
        for number in touched:
            try:
                chosen = [known[name] for name in self._scopes[number]]
            except KeyError:
                cost = self._cost_with_absent(number) if self._withdrawal_cost is not None else 0
            else:
                cost = self._prices[number](chosen)
            if cost != costs[number]:
                self._set_cost(number, cost)

    def _cost_with_absent(self, number: int) -> float:
        """Return the cost of a constraint when robots in its scope are absent."""
        constraint = self._constraints[number]
        absent = tuple([name for name in constraint.variables if name not in self._values])
        if (number, absent) not in self._restated:
            self._restated[number, absent] = restated(constraint, absent)
        in_force = self._restated[number, absent]
        return 0 if in_force is None else in_force.price(self._values)

    def _set_cost(self, number: int, cost: float) -> None:
        """Set the cost of a constraint, and update the sum of finite costs and the number of infinite costs."""
        for paid, sign in ((self._costs[number], -1), (cost, 1)):
            if paid == INFINITE:
                self._broken += sign
            else:
                self._sum += sign * paid
        self._costs[number] = cost

    def clear(self) -> None:
        """Remove the values of all robots."""
        self.change({robot: {} for robot in self._weights})

    def shown(self, values: Mapping[str, Value]) -> dict[str, dict[str, int]] | None:
        """Return each robot's interface variables with their `values`; None if they do not match."""
        if any(len(self.interfaces.get(robot, (*value, ""))) != len(value) for robot, value in values.items()):
            return None
        return {
            robot: {name: part for name, part in zip(self.interfaces[robot], value, strict=True) if part is not None}
            for robot, value in values.items()
        }

    @property
    def cost(self) -> float:
        """The cost of the current assignment."""
        if self._broken or (self._absent and self._withdrawal_cost is None):
            return INFINITE
        return self._sum + self._weight * (self._withdrawal_cost or 0)

    @property
    def shortfall(self) -> tuple[int, float]:
        """The number of violated hard constraints, and the cost of all others: comparable if `cost` is infinite."""
        return self._broken, self._sum

    @property
    def is_complete(self) -> bool:
        """True if all robots have values."""
        return not self._absent

    def in_user_units(self, cost: float) -> Cost:
        """Convert `cost`, which includes withdrawal costs, to the user's units."""
        return self._in_user_units(cost)


def withdrawal_cost(team: Team) -> float:
    """Return the cost of withdrawing a robot of weight 1. It is so high that no robot withdraws to save costs."""
    return 1 + sum(max_cost(constraint) for constraint in team.constraints())
