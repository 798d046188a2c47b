"""Values, views and nogoods as text, with the names of variables: V1.1 = 2."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from robochoc.protocols.message import Value
from robochoc.solver.agent_problem import Interfaces

LONGEST = 200
"""The maximum number of characters in a phrase; longer phrases are cut."""
MOST_NAMED = 12
"""The maximum number of robots in a phrase."""


def cut(text: str, longest: int = LONGEST) -> str:
    """Return `text`, shortened to at most `longest` characters."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


class ValueText:
    """Formats values of robots. `interfaces` are the variables that each robot shows its neighbours."""

    def __init__(self, interfaces: Interfaces) -> None:
        self._interfaces = interfaces

    def value(self, robot: str, value: Sequence[int | None]) -> str:
        """Return `value` of `robot` as text: V1.1 = 2, V1.2 = 1."""
        return self._pairs(robot, value, "=", ", ") or f"{robot}: any value"

    def against(self, robot: str, value: Sequence[int | None]) -> str:
        """Return the exclusion of `value` for `robot` as text: V1.1 != 2."""
        known = [part for part in value if part is not None]
        if len(known) == 1:
            return self._pairs(robot, value, "!=", "")
        return f"not {self._pairs(robot, value, '=', ', ')}" if known else f"{robot} cannot take part"

    def all(self, values: Mapping[str, Sequence[int | None]] | Iterable[tuple[str, Sequence[int | None]]]) -> str:
        """Return the values of several robots as text: V1.1 = 2 and V2.1 = 3; empty if there are none."""
        pairs = list(values.items() if isinstance(values, Mapping) else values)
        named = [self._pairs(robot, value, "=", " and ") or f"any value of {robot}" for robot, value in pairs]
        more = [f"{len(named) - MOST_NAMED:,} more"] if len(named) > MOST_NAMED else []
        return cut(" and ".join([*named[:MOST_NAMED], *more]))

    def own_value_text(self, robot: str, value: Sequence[int | None]) -> str:
        """Return the value of a robot as text; "withdraws" if all its components are None."""
        return self._pairs(robot, value, "=", ", ") or ("withdraws" if value else "shows no variable")

    def _pairs(self, robot: str, value: Sequence[int | None], sign: str, between: str) -> str:
        names = self._interfaces.get(robot, ())
        if len(names) != len(value):
            names = tuple(f"{robot}[{place}]" for place in range(len(value)))
        said = [f"{name} {sign} {part}" for name, part in zip(names, value, strict=True) if part is not None]
        return cut(between.join(said))


def is_value(thing: object) -> bool:
    """Return whether `thing` has the form of a robot's value in messages."""
    return isinstance(thing, tuple) and all(part is None or type(part) is int for part in thing)


def as_value(thing: object) -> Value | None:
    """Return `thing` as a robot's value; None if `thing` is not a value."""
    return thing if is_value(thing) else None  # type: ignore[return-value]  # checked by `is_value`


class NumberedValueText(ValueText):
    """Formats the assignments of robots that send numbers instead of values (DisFC)."""

    def _pairs(self, robot: str, value: Sequence[int | None], sign: str, between: str) -> str:  # noqa: ARG002
        return between.join(f"assignment {number} of {robot}" for number in value if number is not None)
