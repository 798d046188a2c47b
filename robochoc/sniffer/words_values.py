"""What the messages of protocols for satisfaction say: values, nogoods, links, orders, partial assignments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from robochoc.sniffer.phrases import (
    Setting,
    along,
    assigned,
    count,
    is_aside,
    listed,
    mapped,
    own,
    raw,
    row,
    ruled_out,
    stands,
    taken,
    whole,
)

Content = Mapping[str, Any]
Wording = Callable[[Setting, Content], str]


def _ok(setting: Setting, said: Content) -> str:
    if "allowed" in said:  # DisFC
        bits = sum(byte.bit_count() for byte in raw(said["allowed"]))
        called = f"my assignment number {whole(said['counter'])}"
        return f"{called} stands from now on; it leaves {setting.receiver} {count(bits, 'value')} of its domain"
    value = said["value"]
    what = "I step aside" if is_aside(value) else row(taken(setting, setting.sender, value)) or "I have a value"
    now = f"{what} from now on"
    if "priority" in said:  # AWC
        return f"{now}, with priority {whole(said['priority'])}"
    if "size" in said:  # Agile-ABT
        left = f"I have {whole(said['left'])} of {count(said['size'], 'value')} left"
        return f"{now}; {stands(setting, said['lhs'])}{left}"
    if "left" in said:  # ABT_DO
        return f"{now}; {_not_ruled_out(said['left'])}"
    return now


def _not_ruled_out(left: object) -> str:
    number = whole(left)
    return f"{number:,} of my values {'is' if number == 1 else 'are'} not ruled out"


def _nogood(setting: Setting, said: Content) -> str:
    if "nogood" in said:  # AWC
        facts = {robot: listed(entry)[0] for robot, entry in mapped(said["nogood"]).items()}
        told = [one for robot, value in facts.items() for one in _mattering(setting, robot, value)]
        if len(told) == 1:
            return f"{told[0]} cannot stand, whatever the others do"
        return f"{row(told)} cannot {'both' if len(told) == len('ab') else 'all'} stand"
    if "counter" in said:  # DisFC
        named = [f"{robot} keeps its assignment number {whole(one)}" for robot, one in mapped(said["lhs"]).items()]
        condition = f"as long as {row(named)}, " if named else ""
        rest = "" if named else ", whatever the others do"
        return f"{condition}{setting.receiver} cannot keep its assignment number {whole(said['counter'])}{rest}"
    condition = stands(setting, said["lhs"])
    rest = "" if condition else ", whatever the others do"
    ruled = f"{condition}{ruled_out(setting, setting.receiver, said['value'])}{rest}"
    if "left" in said:  # ABT_DO
        return f"{ruled}; without that value, {_not_ruled_out(said['left'])}"
    return ruled


def _mattering(setting: Setting, robot: str, value: object) -> list[str]:
    return [] if is_aside(value) else taken(setting, robot, value)


def _add_link(setting: Setting, _: Content) -> str:
    match setting.protocol:
        case "AWC":
            both = f"{own(setting, setting.sender)} and {own(setting, setting.receiver)}"
            return f"from now on let us tell each other {both}"
        case "DisFC":
            return "tell me of each new assignment of yours from now on"
        case "ABTDORetro":
            return f"tell me {own(setting, setting.receiver)} from now on, whenever you are above me"
        case "AgileABT":
            return f"tell me {own(setting, setting.receiver)} from now on, whenever I am below you"
        case _:
            return f"tell me {own(setting, setting.receiver)} from now on"


def _order(setting: Setting, said: Content) -> str:
    if "names" in said:
        return f"the order is now {row([str(name) for name in listed(said['names'])])}"
    places = [whole(place) for place in listed(said["places"])]
    if places and not 0 <= min(places) <= max(places) < len(setting.order):
        return f"the order is now, by the places of the first one, {row([str(place + 1) for place in places])}"
    return f"the order is now {row([setting.order[place] for place in places])}"


def _cpa(setting: Setting, said: Content) -> str:
    """AFC-ng's and AFC-tree's, whose values have counters; SBT's and AFC's, which have none."""
    values = listed(said["assignments"])
    if setting.protocol in {"AFCng", "AFCTree"}:
        names = setting.order
        if setting.protocol == "AFCTree":
            names = (*setting.above[setting.sender], setting.sender) if setting.sender in setting.above else ()
        return f"so far {_values(setting, names, [listed(one)[0] for one in values])}"
    return f"so far {_values(setting, setting.order, values)}; it is {setting.receiver}'s turn"


def _values(setting: Setting, names: Any, values: object) -> str:  # noqa: ANN401
    return assigned(setting, along(names, values))


def _fc_cpa(setting: Setting, said: Content) -> str:
    return f"so far {_values(setting, setting.order, said['assignments'])}; look which of your values still go with it"


def _not_ok(setting: Setting, said: Content) -> str:
    values = listed(said["assignments"])
    if not values:
        return "there is no solution"
    return f"no solution has {_values(setting, setting.order, values)}"


def _backtrack_cpa(setting: Setting, said: Content) -> str:
    return f"no solution has {_values(setting, setting.order, said['assignments'])}: take another value"


def _accept(setting: Setting, said: Content) -> str:
    subtree = mapped(said["subtree"])
    told = f", with {assigned(setting, subtree.items())}" if subtree else ""
    return f"all below {setting.receiver}, from me down, accept its partial assignment{told}"


def _solved(setting: Setting, said: Content) -> str:
    return f"a solution is found, and the search is over: {assigned(setting, mapped(said['solution']).items())}"


def _placed(setting: Setting, said: Content) -> str:
    if said["value"] is None:
        return "I step aside"
    return f"I fly, with {row(taken(setting, setting.sender, said['value'])) or 'a value'}"


WORDS: Mapping[str, Wording] = MappingProxyType(
    {
        "Ok": _ok,
        "Nogood": _nogood,
        "AddLink": _add_link,
        "Order": _order,
        "CPA": _cpa,
        "FcCPA": _fc_cpa,
        "NotOk": _not_ok,
        "BacktrackCPA": _backtrack_cpa,
        "Accept": _accept,
        "Solved": _solved,
        "Placed": _placed,
    }
)
"""By the type's name; types that protocols for optimisation have too are told apart by their fields in `words.py`."""
