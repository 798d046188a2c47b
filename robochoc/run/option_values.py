"""Converters for option values: they accept texts, lists and numbers of any library, and refuse all other values."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from numbers import Real

from robochoc.model.objectives import ObjectivesMode, objectives_mode
from robochoc.model.orders import Order
from robochoc.run.defaults import AUTO
from robochoc.system.errors import OptionError, OptionTypeError
from robochoc.system.suggestions import member

Converter = Callable[[str, object], object]
"""A function that receives the name of an option and a value, and returns the value in the type of the option.

A converter raises `OptionTypeError` for a value of a wrong type, and `OptionError` for a value that is not allowed.
"""


def _refusal(name: str, value: object, expected: str) -> str:
    return f"{name}={value!r} is not allowed; expected {expected}"


def one_of(choices: type[StrEnum]) -> Converter:
    """Return a converter to a member of the enum `choices`."""
    return lambda name, value: member(choices, name, value)


def instance_of(kind: type) -> Converter:
    """Return a converter that accepts objects of one class, and returns them unchanged."""

    def convert(name: str, value: object) -> object:
        if not isinstance(value, kind):
            raise OptionTypeError(_refusal(name, value, f"an object of the class {kind.__name__}"))
        return value

    return convert


def optional(convert: Converter) -> Converter:
    """Return a converter that also accepts None."""
    return lambda name, value: None if value is None else convert(name, value)


def text(name: str, value: object) -> str:
    """Accept a text."""
    if not isinstance(value, str):
        raise OptionTypeError(_refusal(name, value, "a text"))
    return value


def protocol_name(name: str, value: object) -> str:
    """Convert the name of a protocol, in any case, to the spelling of its package, or a protocol class to its name."""
    if value == AUTO:
        return AUTO
    from robochoc.run.registry import installed_spelling, name_of_class  # noqa: PLC0415 - start-up

    if isinstance(value, type) and hasattr(value, "traits"):
        return name_of_class(value)
    if not isinstance(value, str):
        raise OptionTypeError(_refusal(name, value, "the name of a protocol, such as 'abt', or its class"))
    return installed_spelling(value)


def integer(name: str, value: object) -> int:
    """Convert an integer of any type."""
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise OptionTypeError(_refusal(name, value, "an integer")) from None


def count(name: str, value: object) -> int:
    """Convert an integer that is not negative."""
    number = integer(name, value)
    if number < 0:
        raise OptionError(_refusal(name, number, "0 or more"))
    return number


def samples(name: str, value: object) -> int:
    """Convert a number of samples."""
    from robochoc.model.sampling import sample_number  # noqa: PLC0415 - start-up: rarely needed

    number = integer(name, value)
    try:
        return sample_number(number)
    except ValueError as invalid:
        raise OptionError(f"{name}: {invalid}") from None


def real(name: str, value: object, expected: str = "a number") -> float:
    """Convert a real number of any type."""
    if not isinstance(value, Real):
        raise OptionTypeError(_refusal(name, value, expected))
    return float(value)


def seconds(name: str, value: object) -> float:
    """Convert a number of seconds. Raises `OptionError` unless it is finite and not negative."""
    number = real(name, value, "seconds")
    if not 0 <= number < math.inf:
        raise OptionError(_refusal(name, number, "0 or more seconds"))
    return number


def step(name: str, value: object) -> float:
    """Convert the step of a grid, which may be infinite. Raises `OptionError` if it is negative or not a number."""
    number = real(name, value)
    if not number >= 0:
        raise OptionError(_refusal(name, number, "a number of 0 or more"))
    return number


def flag(name: str, value: object) -> bool:
    """Convert a Boolean of any type."""
    if not isinstance(value, bool) and type(value).__name__ not in {"bool", "bool_"}:  # numpy's Boolean is not a bool
        raise OptionTypeError(_refusal(name, value, "True or False"))
    return bool(value)


def items_of(convert: Converter, expected: str) -> Converter:
    """Return a converter from lists, sets and other iterables to tuples, which applies `convert` to each item."""

    def convert_all(name: str, value: object) -> tuple[object, ...]:
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            raise OptionTypeError(_refusal(name, value, expected))
        items = value if isinstance(value, tuple) else tuple(value)
        return tuple(convert(f"{name}[{place}]", item) for place, item in enumerate(items))

    return convert_all


def texts_by_name(name: str, value: object) -> Mapping[str, str]:
    """Convert a mapping with names as keys. Its values are converted to texts."""
    if not isinstance(value, Mapping):
        raise OptionTypeError(_refusal(name, value, "a mapping of names to values"))
    return {text(f"a name in {name}", key): str(one) for key, one in value.items()}


def start_values(name: str, value: object) -> Mapping[str, int | None]:
    """Convert a mapping of the names of variables to integers, or to None for variables of withdrawn robots."""
    if not isinstance(value, Mapping):
        raise OptionTypeError(_refusal(name, value, "a mapping of variables to values"))
    return {
        text(f"a name in {name}", key): None if one is None else integer(f"{name}[{key!r}]", one)
        for key, one in value.items()
    }


def priority_order(name: str, value: object) -> object:
    """Accept the name of an order, or the names of robots."""
    if isinstance(value, str):
        return member(Order, name, value)
    return items_of(text, "the name of an order, or the names of all robots")(name, value)


def channel_model(name: str, value: object) -> object:
    """Accept a `ChannelModel`."""
    from robochoc.communication.simulator.channel import ChannelModel  # noqa: PLC0415 - start-up: rarely needed

    return instance_of(ChannelModel)(name, value)


def objectives(name: str, value: object) -> object:
    """Accept an `ObjectivesMode`, or its text."""
    if isinstance(value, ObjectivesMode):
        return value
    try:
        return objectives_mode(text(name, value))
    except OptionTypeError:
        raise
    except ValueError as invalid:
        raise OptionError(f"{name}: {invalid}") from None


def kill(name: str, value: object) -> object:
    """Accept a `Kill`, with its time in seconds."""
    from robochoc.communication.kill_schedule import Kill  # noqa: PLC0415 - start-up: rarely needed

    if not isinstance(value, Kill):
        raise OptionTypeError(_refusal(name, value, "a Kill(robot, after_s)"))
    return Kill(text(f"{name}.robot", value.robot), seconds(f"{name}.after_s", value.after_s))
