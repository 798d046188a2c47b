"""The position of a robot in an answer: the coordinates of its topic under the assignment.

Scenes, flights, vehicles, ROS and the closed loop read positions here. Coordinates are in units of the map. Those over
real variables are exact to `VALUE_PLACES` decimal places, so that a robot is not bound to cells.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from robochoc.model.expression import Apply, Expression, Name, Type, UndefinedValueError, evaluate
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.expression.tree import DECIMAL
from robochoc.model.problem import Assignment, Topic, Variable

Coordinates = tuple[float | None, float | None, float | None]
"""The x, y and z of a position. None: not given, undefined, or a variable has no value."""

Sources = tuple[Expression | None, Expression | None, Expression | None]
"""The expressions of x, y and z."""

_COORDINATE_MAX = 10**300
"""The largest coordinate: larger numbers exceed the range of floats, and are clamped."""


def waypoint(name: str, kind: str, sources: Sources, real: Collection[str], places: int) -> Topic:
    """Return a topic from the expressions of its coordinates, which may have decimals and real variables.

    Args:
        name: The topic's name.
        kind: The type of its messages.
        sources: The x, y and z.
        real: The real variables, with `places` decimal places.
        places: The decimal places of real variables.

    Raises:
        ExpressionError: A coordinate needs too many decimal places.
    """
    if not any(one is not None and _is_real(one, real) for one in sources):
        return Topic(name, kind, *sources)
    x, y, z = (one and fixed_point(one, real, places, Type.INTEGER, VALUE_PLACES) for one in sources)
    return Topic(name, kind, x, y, z, sources, VALUE_PLACES)


def _is_real(expression: Expression, real: Collection[str]) -> bool:
    match expression:
        case Apply(operator, arguments):
            return operator == DECIMAL or any(_is_real(one, real) for one in arguments)
        case Name(name):
            return name in real
        case _:
            return False


def position(topic: Topic, values: Assignment) -> Coordinates:
    """Return the position that is published on `topic` for an assignment, in units; whole numbers are integers."""
    x, y, z = (coordinate(part, topic.places, values) for part in (topic.x, topic.y, topic.z))
    return x, y, z


def coordinate(expression: Expression | None, places: int, values: Assignment) -> float | None:
    """Return a coordinate, whose `expression` is in units of 10**-`places`; see `Coordinates`."""
    if expression is None:
        return None
    try:
        value = _bounded(evaluate(expression, values))
    except (UndefinedValueError, KeyError):
        return None
    return _in_units(value, places)


def value_as_coordinate(variables: Sequence[Variable], values: Assignment) -> float | None:
    """Return the first known value of `variables` as a coordinate; None if no value is known."""
    for variable in variables:
        if variable.name in values:
            real = variable.domain.real
            return _in_units(_bounded(values[variable.name]), real.places if real else 0)
    return None


def _in_units(value: int, places: int) -> float:
    whole, rest = divmod(value, 10**places)
    number: float = value / 10**places
    return number if rest else whole


def _bounded(value: int) -> int:
    return max(-_COORDINATE_MAX, min(value, _COORDINATE_MAX))
