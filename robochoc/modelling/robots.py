"""The robots of a model."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from robochoc.formats.names import MAX_NAME, MAX_WEIGHT, RESERVED, is_name
from robochoc.model.expression import Expression
from robochoc.model.problem import Topic
from robochoc.modelling.codes import codes_of
from robochoc.modelling.numbers import whole_number
from robochoc.modelling.places import ModelError, ModelTypeError, Place, UnknownNameError, here
from robochoc.modelling.rules import Rule
from robochoc.modelling.terms import Variable, number
from robochoc.modelling.translation import Translator, UntranslatableError
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.modelling.model import Model


class ModelRobot:
    """A robot of a model. `Model.robot` makes it.

    Attributes:
        place: The line that made it.
    """

    def __init__(self, model: Model, name: str, priority: float, weight: int, place: Place) -> None:
        self._name, self._priority, self._weight, self.place = name, priority, int(weight), place
        self._variables: dict[str, Variable] = {}
        self.joins: object = None
        self._topics: list[Topic] = []
        self._parts: list[Rule] = []
        self._model = model

    @property
    def name(self) -> str:
        """Its name."""
        return self._name

    @property
    def priority(self) -> float:
        """The priority: robots with a higher priority come first, then those that were made earlier."""
        return self._priority

    @property
    def weight(self) -> int:
        """The weight of its withdrawal."""
        return self._weight

    @property
    def variables(self) -> Mapping[str, Variable]:
        """The variables, by their names in `variable`."""
        return MappingProxyType(self._variables)

    @property
    def parts(self) -> tuple[Rule, ...]:
        """The robot's parts of shared constraints, the results of `knows`."""
        return tuple(self._parts)

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Its topics."""
        return tuple(self._topics)

    def add_topics(self, *topics: Topic) -> None:
        """Add topics. See `topic`."""
        self._topics += topics
        self._model.changed()

    def remove_part(self, part: Rule) -> None:
        """Remove one of `parts`. See `Model.remove`."""
        self._parts.remove(part)
        self._model.changed()

    def add_variable(self, name: str, variable: Variable) -> None:
        """Add a variable; its name must be free. See `variable`."""
        self._variables[name] = variable
        self._model.add_variable(variable)

    def __repr__(self) -> str:
        return f"<robot {self.name}: {', '.join(map(repr, self.variables.values())) or 'no variables yet'}>"

    def __getitem__(self, name: str) -> Variable:
        """Return the variable that was given this name."""
        if name not in self.variables:
            hint = did_you_mean(name, self.variables, f"it has {' '.join(self.variables) or 'none'}")
            raise UnknownNameError(f"{self.name} has no variable {name!r}", hint)
        return self.variables[name]

    def variable(self, name: str, domain: object, *, qualified: bool = True) -> Variable:
        """Add a variable: a decision of the robot.

        Args:
            name: Its name. In the team it is ROBOT.NAME, such as `drone3.slot`.
            domain: A range, an `Enum`, `bool`, or a list of values of one kind: numbers, texts, tuples, anything that
                is hashable. Numbers can be computed with; all others can be compared by `==` and `!=`, and listed in
                tables.
            qualified: False: `name` is its name in the team too, where every name is there once.

        Returns:
            The variable: a term for constraints and costs, and the key to its value in a solution.

        Raises:
            ModelError: if there is a variable of that name, or the domain is none.
        """
        place = here()
        whole = f"{self.name}.{name}" if qualified else name
        if not is_name(whole) or len(whole) > MAX_NAME:
            raise ModelError(f"{name!r} cannot be a variable's name", "a letter, then letters, digits, '.' and '_'")
        if name in self.variables or whole in self._model.variables:
            there = self._model.variables[whole] if whole in self._model.variables else self.variables[name]
            raise ModelError(f"there is a variable {there!r} already, made at {there.place}", "give it another name")
        codes = codes_of(domain, self._model.symbols, place)
        made = Variable(whole, codes, self.name, place, self.joins)
        self.add_variable(name, made)
        return made

    def boolean(self, name: str) -> Variable:
        """Add a variable that is true or false: a condition of its own, and 0 or 1 where a number is expected."""
        return self.variable(name, bool)

    def knows(self, *constraints: object, cost: object = None, name: str | None = None) -> Rule:
        """Add the robot's own part of a constraint that it shares with another robot, which never learns it.

        Values are allowed if the parts of both robots allow them (a partially known constraint, PKC).

        Args:
            *constraints: Conditions over variables of this robot and of one other.
            cost: What it costs this robot if they do not hold. None: they must.
            name: The constraint's name.

        Raises:
            ModelError: if they are over variables of other robots, or of this one alone.
        """
        rule = self._model.rule(constraints, cost, name)
        owners = dict.fromkeys(variable.owner for variable in rule.term.variables)
        if self.name not in owners or len(owners) != 2:  # noqa: PLR2004 - a pair
            hint = (
                f"let it be over variables of {self.name} and of one other robot; Model.add adds any other constraint"
            )
            if list(owners) == [self.name]:
                hint = "add it by Model.add: what is over variables of one robot, no other robot learns"
            raise ModelError(
                f"the part that {self.name} knows is over variables of {' and '.join(owners) or 'no robot'}", hint
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
        """Publish where the robot's decision sends it.

        Args:
            name: The topic's name.
            x: The waypoint's position: a number, or a term over the robot's own variables. None: it has none.
            y: The same.
            z: The same.
            type: The type of its messages.

        Raises:
            ModelError: if a term is over other variables, or no file can say it.
        """
        axes = {axis: self._axis(value) for axis, value in (("x", x), ("y", y), ("z", z))}
        self.add_topics(Topic(name, type, **axes))

    def _axis(self, value: object) -> Expression | None:
        if value is None:
            return None
        term = number(value)
        if foreign := [one for one in term.variables if one.owner != self.name]:
            raise ModelError(f"{foreign[0]!r} is no variable of {self.name}", "a robot's waypoint follows from its own")
        try:
            scaled = Translator({one: one.name for one in term.variables}).number(term)
        except UntranslatableError:
            scaled = None
        if scaled is None or scaled.divisor != 1:
            raise ModelError(f"no file can say the position {term!r}", "write it with integers and operators")
        return scaled.expression


def check_robot(name: object, robots: Mapping[str, ModelRobot], weight: object) -> str:
    """Return the name of a new robot. Raises `ModelError`: it cannot be one, or its weight is none."""
    if not isinstance(name, str) or not is_name(name) or name == RESERVED or len(name) > MAX_NAME:
        raise ModelError(f"{name!r} cannot be a robot's name", "a letter, then letters, digits, '.' and '_'")
    if name in robots:
        raise ModelError(f"there is a robot {name} already, made at {robots[name].place}", "give it another name")
    if not 1 <= (whole_number(weight) or 0) <= MAX_WEIGHT:
        raise ModelTypeError(f"{weight!r} is no weight", f"expected an integer from 1 to {MAX_WEIGHT:,}")
    return name
