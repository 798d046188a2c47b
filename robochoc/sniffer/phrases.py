"""What messages are about, in words: values and assignments with their variables' names, costs, lists.

What is said comes from journals, so of strangers: everything is checked as it is put into words, and cut where it is
long. Functions raise `ValueError` or `TypeError` where what they are given is not what they expect.
"""

from __future__ import annotations

import math
from base64 import b64decode
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

MOST = 8
"""Things in a list, before it is cut."""
_LONGEST = 60


class Setting(NamedTuple):
    """Who speaks to whom, and what is known of the team: `order` and `interfaces` are empty where it is not.

    `protocol` is the name of its class. `order` is the robots' priority order, and `above` says of each robot, where
    the protocol works on a pseudo-tree that the order induces, who stands above it there, the root first.
    `interfaces` are the variables whose values robots' messages carry.
    """

    protocol: str
    sender: str
    receiver: str
    order: Sequence[str] = ()
    above: Mapping[str, Sequence[str]] = {}
    interfaces: Mapping[str, Sequence[str]] = {}


def row(things: Iterable[str], joint: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`; of many `a, b, ... and 12 more`."""
    items = list(things)
    if len(items) > MOST + 1:
        items = [*items[:MOST], f"{len(items) - MOST:,} more"]
        joint = "and"
    return f"{', '.join(items[:-1])} {joint} {items[-1]}" if len(items) > 1 else "".join(items)


def count(number: object, thing: str, many: str = "") -> str:
    """`1 value`, `3 values`."""
    counted = whole(number)
    return f"{counted:,} {thing if counted == 1 else many or thing + 's'}"


def whole(number: object) -> int:
    """`number`, which is to be an integer."""
    if not isinstance(number, int) or isinstance(number, bool):
        raise TypeError
    return number


def listed(things: object) -> Sequence[object]:
    """`things`, which are to be a list."""
    if not isinstance(things, list | tuple):
        raise TypeError
    return things


def mapped(things: object) -> Mapping[str, object]:
    """`things`, which are to be a dict by names."""
    if not isinstance(things, dict) or not all(isinstance(name, str) for name in things):
        raise TypeError
    return things


def raw(content: object) -> bytes:
    """Bytes; journals that are JSON have them in base64."""
    if isinstance(content, str):
        return b64decode(content, validate=True)
    if not isinstance(content, bytes):
        raise TypeError
    return content


def cost(number: object) -> float:
    """A cost; JSON has null for an infinite one."""
    if number is None:
        return math.inf
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise TypeError
    return number


def amount(number: object) -> str:
    """A cost as it is written: `3`, `2.5`, `infinity`."""
    charged = cost(number)
    if math.isinf(charged) or math.isnan(charged):
        return "infinity"
    shown = round(charged, 3)
    return f"{int(shown):,}" if shown == int(shown) else f"{shown:,}"


def short(text: str) -> str:
    """`text`, or its beginning."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


# Values


def own(setting: Setting, robot: str) -> str:
    """What a robot's value is called: its variable's name, or names."""
    names = setting.interfaces.get(robot, ())
    return row(names) if names else f"the value of {robot}"


def parts(setting: Setting, robot: str, value: object) -> list[tuple[str, str]]:
    """The variables that matter in a robot's value, each with its value."""
    told = listed(value)
    names = setting.interfaces.get(robot, ())
    if len(names) != len(told):
        names = (robot,) if len(told) == 1 else [f"{robot}[{place}]" for place in range(1, len(told) + 1)]
    return [(name, str(whole(one))) for name, one in zip(names, told, strict=True) if one is not None]


def is_aside(value: object) -> bool:
    """Whether a value says that its robot steps aside: it has variables, and none has a value."""
    told = listed(value)
    return bool(told) and all(one is None for one in told)


def taken(setting: Setting, robot: str, value: object) -> list[str]:
    """What a robot has taken, variable by variable; or that it steps aside."""
    if is_aside(value):
        return [f"{robot} steps aside"]
    return [f"{name} = {one}" for name, one in parts(setting, robot, value)]


def assigned(setting: Setting, values: Iterable[tuple[str, object]]) -> str:
    """What robots have taken: `V1.1 = 2 and V1.3 = 1`."""
    return row([one for robot, value in values for one in taken(setting, robot, value)]) or "nothing yet"


def along(names: Sequence[str], values: object) -> list[tuple[str, object]]:
    """Values in the order of the robots `names`; those of whom no name is known are numbered."""
    told = listed(values)
    known = [*names[: len(told)], *(f"robot {place + 1}" for place in range(len(names), len(told)))]
    return list(zip(known, told, strict=True))


def stands(setting: Setting, lhs: object) -> str:
    """The left side of a nogood as a condition: `as long as V1.1 = 2, `; empty if there is none.

    Variables that do not matter are left out.
    """
    facts = [f"{name} = {one}" for robot, value in mapped(lhs).items() for name, one in parts(setting, robot, value)]
    return f"as long as {row(facts)}, " if facts else ""


def ruled_out(setting: Setting, robot: str, value: object) -> str:
    """That a robot's value is not possible: `V2.1 cannot be 3`."""
    facts = parts(setting, robot, value)
    match facts:
        case []:
            return f"{robot} has no value left"
        case [(name, one)]:
            return f"{name} cannot be {one}"
        case _:
            both = "both" if len(facts) == len("ab") else "all"
            return f"{row([f'{name} = {one}' for name, one in facts])} cannot {both} hold"


def context(setting: Setting, values: object) -> str:
    """A condition of values that have counters (ADOPT's contexts): `as long as V1.1 = 2, `; empty if there is none."""
    facts = [one for robot, entry in mapped(values).items() for one in taken(setting, robot, listed(entry)[0])]
    return f"as long as {row(facts)}, " if facts else ""


def some_values(setting: Setting, robot: str, values: object) -> str:
    """The values that a robot may take: `V2.1 is 1, 2 or 3`."""
    told = listed(values)
    names = setting.interfaces.get(robot, ())
    flying = [listed(value) for value in told if not is_aside(value)]
    aside = ", or I step aside" if len(flying) < len(told) else ""
    if all(len(value) == 1 for value in flying):
        shown = row([str(whole(value[0])) for value in flying], "or")
    else:
        shown = row([f"({', '.join(str(one) for one in value)})" for value in flying], "or")
    called = names[0] if len(names) == 1 else f"({', '.join(names)})" if names else robot
    return f"{called} is {shown or 'nothing'}{aside}"


def numbers(entries: object) -> str:
    """Costs, value by value: `0, 1 and 3`."""
    return row([amount(entry) for entry in listed(entries)])
