"""The events of a model: changes over time (docs/reference/format.md, "Changes over time")."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

from robochoc.model.problem import AddValue, RemoveAgent, RemoveValue, WhenAbsent
from robochoc.modelling.constraints import ModelConstraint
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine, UnknownNameError, calling_line
from robochoc.modelling.robots import ModelRobot, check_robot
from robochoc.modelling.terms import ModelVariable
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.modelling.model import Model


class Removal:
    """The removal of one constraint, or of all constraints with a name, and the line of the user's program."""

    def __init__(self, removed: ModelConstraint | str, place: SourceLine) -> None:
        self.removed, self.place = removed, place

    @property
    def name(self) -> str:
        """The name of the removed constraints."""
        return self.removed if isinstance(self.removed, str) else self.removed.name


Step = RemoveAgent | RemoveValue | AddValue | ModelRobot | ModelConstraint | Removal
"""A change made by an event."""


class ModelEvent:
    """An event: changes that happen at the same time. Created by `Model.after_solution` and `Model.after_messages`."""

    def __init__(self, model: Model, after: int | None, place: SourceLine) -> None:
        self.after, self.place = after, place
        self._steps: list[Step] = []
        self._model = model

    @property
    def steps(self) -> tuple[Step, ...]:
        """The changes, in order."""
        return tuple(self._steps)

    def __repr__(self) -> str:
        return f"<event with {len(self.steps)} change{'s' * (len(self.steps) != 1)}>"

    def remove_robot(self, robot: ModelRobot | str) -> None:
        """Remove a robot with its variables. The robot's shared constraints are restated or dropped."""
        name = robot.name if isinstance(robot, ModelRobot) else robot
        if name not in self._model.robots:
            raise UnknownNameError(f"there is no robot {name!r}", did_you_mean(name, self._model.robots))
        self._add(RemoveAgent(name))

    def robot(self, name: str, *, weight: int = 1) -> ModelRobot:
        """Add a robot with the lowest priority. Add the robot's constraints with `add` of this event."""
        made = self._model.add_robot(check_robot(name, self._model.robots, weight), 0, weight, calling_line())
        made.joins = self
        self._add(made)
        return made

    def remove_value(self, variable: ModelVariable, value: object) -> None:
        """Remove a value from a variable's domain."""
        code = variable.codes.code(value)
        if code is None:
            raise ModelError(f"{variable!r} has no value {value!r}", did_you_mean(value, variable.domain[:1000]))
        self._add(RemoveValue(variable.name, code))

    def add_value(self, variable: ModelVariable, value: Hashable) -> None:
        """Add a value to a variable's domain."""
        variable.codes, code = variable.codes.with_value(value, self._model.symbols)
        self._add(AddValue(variable.name, code))

    def add(
        self,
        *constraints: object,
        cost: object = None,
        name: str | None = None,
        when_absent: WhenAbsent | str | None = None,
        objective: str = "",
    ) -> ModelConstraint:
        """Add constraints, each between variables of several robots, as `Model.add` does."""
        rule = self._model.rule(constraints, cost, name, self, when_absent, objective)
        self._add(rule)
        return rule

    def remove_constraint(self, constraint: ModelConstraint | str) -> None:
        """Remove a constraint between robots.

        Args:
            constraint: A constraint returned by `add`, to remove only this constraint; or a name, to remove all
                constraints between robots with this name.

        Raises:
            ModelError: if the model has no such constraint.
        """
        if not isinstance(constraint, (ModelConstraint, str)):
            raise ModelTypeError(f"{constraint!r} is not a constraint of a model", "use a result of add(), or a name")
        if isinstance(constraint, ModelConstraint) and not any(one is constraint for one in self._model.rules):
            raise ModelError(f"{constraint!r} is not a constraint of {self._model!r}", "use a result of add()")
        self._add(Removal(constraint, calling_line()))

    def _add(self, step: Step) -> None:
        self._steps.append(step)
        self._model.changed()
