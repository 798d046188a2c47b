"""The robots of a model."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Never

from robochoc.formats.names import MAX_NAME, MAX_WEIGHT, RESERVED, is_name
from robochoc.model.expression import Expression, ExpressionError
from robochoc.model.problem import Topic
from robochoc.model.real import DEFAULT_POINTS
from robochoc.model.waypoints import Sources, waypoint
from robochoc.modelling.codes import DomainCodes, codes_of, real_codes
from robochoc.modelling.constraints import ModelConstraint
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine, UnknownNameError, calling_line
from robochoc.modelling.numbers import whole_number
from robochoc.modelling.real_terms import RealTranslator
from robochoc.modelling.terms import ModelVariable, number
from robochoc.modelling.translation import Translator, UntranslatableError
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.modelling.model import Model


class ModelRobot:
    """A robot of a model, created by `Model.robot`.

    Attributes:
        place: The line that created the robot.
        joins: The event with which the robot joins. None: it belongs to the team from the beginning.
    """

    def __init__(self, model: Model, name: str, priority: float, weight: int, place: SourceLine) -> None:
        self._name, self._priority, self._weight, self.place = name, priority, int(weight), place
        self._variables: dict[str, ModelVariable] = {}
        self.joins: object = None
        self._topics: list[Topic] = []
        self._parts: list[ModelConstraint] = []
        self._model = model

    @property
    def name(self) -> str:
        """The name."""
        return self._name

    @property
    def priority(self) -> float:
        """The priority. Robots with a higher priority come first; ties are broken by the order of creation."""
        return self._priority

    @property
    def weight(self) -> int:
        """The weight of its withdrawal."""
        return self._weight

    @property
    def variables(self) -> Mapping[str, ModelVariable]:
        """The variables, by the names given to `variable`."""
        return MappingProxyType(self._variables)

    @property
    def parts(self) -> tuple[ModelConstraint, ...]:
        """The robot's parts of shared constraints, as returned by `knows`."""
        return tuple(self._parts)

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics that the robot publishes."""
        return tuple(self._topics)

    def add_topics(self, *topics: Topic) -> None:
        """Add topics. See `topic`."""
        self._topics += topics
        self._model.changed()

    def remove_part(self, part: ModelConstraint) -> None:
        """Remove one of `parts`. See `Model.remove`."""
        self._parts.remove(part)
        self._model.changed()

    def add_variable(self, name: str, variable: ModelVariable) -> None:
        """Add a variable; its name must be free. See `variable`."""
        self._variables[name] = variable
        self._model.add_variable(variable)

    def __repr__(self) -> str:
        return f"<robot {self.name}: {', '.join(map(repr, self.variables.values())) or 'no variables yet'}>"

    def __getitem__(self, name: str) -> ModelVariable:
        """Return the variable with this name."""
        if name not in self.variables:
            hint = did_you_mean(name, self.variables, f"its variables: {' '.join(self.variables) or 'none'}")
            raise UnknownNameError(f"{self.name} has no variable {name!r}", hint)
        return self.variables[name]

    def variable(self, name: str, domain: object, *rest: Never, qualified: bool = True) -> ModelVariable:
        """Add a variable: a decision of the robot.

        Args:
            name: The variable's name. In the team, the variable is called ROBOT.NAME, such as `drone3.slot`.
            domain: A range, an `Enum`, `bool`, or a list of values of one kind: numbers, texts, tuples, or other
                hashable values. Numbers support arithmetic; all other values can be compared by `==` and `!=`, and
                listed in tables.
            *rest: Any other argument is an error.
            qualified: True if the variable's name in the team begins with the robot's name. False: it is `name`, which
                must be unique in the team.

        Returns:
            The variable: a term in constraints and costs, and the key to its value in a solution.

        Raises:
            ModelError: if the robot has a variable with this name, or the domain is invalid.
        """
        place = calling_line()
        if rest:
            hint = "expected a range, an Enum, or a list of values"
            if len(rest) == 1 and (high := whole_number(rest[0])) is not None and whole_number(domain) is not None:
                hint = f"write range({domain}, {high + 1}) for the values from {domain} to {high}"
            raise ModelTypeError(f"variable() takes one domain, not {', '.join(map(repr, (domain, *rest)))}", hint)
        return self._created(name, codes_of(domain, self._model.symbols, place), place, qualified=qualified)

    def real(
        self,
        name: str,
        low: object,
        high: object,
        *,
        precision: object = 0.001,
        points: int = DEFAULT_POINTS,
        qualified: bool = True,
    ) -> ModelVariable:
        """Add a variable whose value is a real number: a multiple of the precision in an interval.

        Constraints and costs over it are expressions of `+ - * / // % **`, `abs`, `minimum`, `maximum`, `if_then_else`
        and comparisons. Costs are truncated to six decimal places. See the guide "Real numbers".

        Args:
            name: The variable's name. In the team, the variable is called ROBOT.NAME.
            low: The lower end of the interval, in the user's unit.
            high: The upper end.
            precision: The smallest step: 1, 0.1, ..., 0.000001. All real variables of a model have the same precision.
            points: The number of points of the first grid, from 2 to 1000.
            qualified: See `variable`.

        Returns:
            The variable. Its value in a solution is a float.

        Raises:
            ModelError: if the robot has a variable with this name, or an argument is invalid.
        """
        place = calling_line()
        codes = real_codes(low, high, precision, points, place)
        for other in self.variables.values():
            if codes.real and other.codes.real and codes.real.places != other.codes.real.places:
                message = f"{name} and {other!r} are real variables of different precisions"
                raise ModelError(message, "use the same precision for all real variables", place)
        return self._created(name, codes, place, qualified=qualified)

    def _created(self, name: str, codes: DomainCodes, place: SourceLine, *, qualified: bool) -> ModelVariable:
        """Return a new variable, which is added to the robot. Raises `ModelError` if its name is invalid or taken."""
        whole = f"{self.name}.{name}" if qualified else name
        if not is_name(whole) or len(whole) > MAX_NAME:
            raise ModelError(f"invalid variable name {name!r}", "a letter, then letters, digits, '.' and '_'")
        if name in self.variables or whole in self._model.variables:
            there = self._model.variables[whole] if whole in self._model.variables else self.variables[name]
            raise ModelError(f"variable {there!r} exists already, created at {there.place}", "use another name")
        made = ModelVariable(whole, codes, self.name, place, self.joins)
        self.add_variable(name, made)
        return made

    def boolean(self, name: str) -> ModelVariable:
        """Add a variable that is true or false. It is a condition, and counts as 0 or 1 where a number is expected."""
        return self.variable(name, bool)

    def knows(
        self, *constraints: object, cost: object = None, name: str | None = None, objective: str = ""
    ) -> ModelConstraint:
        """Add this robot's part of a constraint shared with another robot, which never learns this part.

        Two values are allowed if both robots' parts allow them (a partially known constraint, PKC).

        Args:
            *constraints: Conditions over variables of this robot and of one other robot.
            cost: The cost for this robot if the conditions do not hold. None: they must hold.
            name: The constraint's name.
            objective: The objective to which the cost belongs; see `Model.minimize`.

        Raises:
            ModelError: if the scope does not consist of variables of this robot and exactly one other robot.
        """
        rule = self._model.rule(constraints, cost, name, objective=objective)
        owners = dict.fromkeys(variable.owner for variable in rule.term.variables)
        if self.name not in owners or len(owners) != 2:  # noqa: PLR2004 - a pair
            hint = f"use variables of {self.name} and of one other robot; add any other constraint by Model.add"
            if list(owners) == [self.name]:
                hint = "add it by Model.add: constraints over variables of one robot are private"
            raise ModelError(
                f"the part known to {self.name} is over variables of {' and '.join(owners) or 'no robot'}", hint
            )
        self._parts.append(rule)
        self._model.changed()
        return rule

    def topic(
        self,
        name: str,
        *,
        x: object = None,
        y: object = None,
        z: object = None,
        type: str = Topic.type,  # noqa: A002 - ROS calls it so
    ) -> None:
        """Publish a waypoint that depends on the robot's decision.

        Args:
            name: The topic's name.
            x: The waypoint's x-coordinate: a number, or a term over this robot's variables. None: x is not published.
            y: The y-coordinate, likewise.
            z: The z-coordinate, likewise.
            type: The type of the topic's messages.

        Raises:
            ModelError: if a term contains other robots' variables, or files cannot express it.
        """
        self.add_topics(self._waypoint(name, type, (self._axis(x), self._axis(y), self._axis(z))))

    def _waypoint(self, name: str, kind: str, sources: Sources) -> Topic:
        try:
            return waypoint(name, kind, sources, *self._reals)
        except ExpressionError as error:
            raise ModelError(f"files cannot express the position on {name}: {error}", error.hint) from None

    @property
    def _reals(self) -> tuple[list[str], int]:
        """The names of this robot's real variables, and their decimal places."""
        real = {one.name: one.codes.real.places for one in self.variables.values() if one.codes.real}
        return [*real], max(real.values(), default=0)

    def _axis(self, value: object) -> Expression | None:
        if value is None:
            return None
        term = number(value)
        if foreign := [one for one in term.variables if one.owner != self.name]:
            raise ModelError(f"{foreign[0]!r} is not a variable of {self.name}", "use this robot's variables")
        translator = RealTranslator if self._reals[0] else Translator
        try:
            scaled = translator({one: one.name for one in term.variables}).number(term)
        except UntranslatableError:
            scaled = None
        if scaled is None or scaled.divisor != 1:
            hint = "write it with integers and operators; for parts of a metre, use real variables or --scale"
            raise ModelError(f"files cannot express the position {term!r}", hint)
        return scaled.expression


def check_robot(name: object, robots: Mapping[str, ModelRobot], weight: object) -> str:
    """Return the name of a new robot. Raises `ModelError` if the name is invalid or taken, or the weight is invalid."""
    if not isinstance(name, str) or not is_name(name) or name == RESERVED or len(name) > MAX_NAME:
        raise ModelError(f"invalid robot name {name!r}", "a letter, then letters, digits, '.' and '_'")
    if name in robots:
        hint = "keep the robot that robot() returned, or use another name"
        raise ModelError(f"robot {name} exists already, created at {robots[name].place}", hint)
    if not 1 <= (whole_number(weight) or 0) <= MAX_WEIGHT:
        raise ModelTypeError(f"invalid weight {weight!r}", f"expected an integer from 1 to {MAX_WEIGHT:,}")
    return name
