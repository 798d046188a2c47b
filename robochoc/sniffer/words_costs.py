"""What the messages of protocols for optimisation say: costs, bounds, tables, gains, pseudo-trees."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from robochoc.sniffer.phrases import (
    Setting,
    along,
    amount,
    assigned,
    context,
    cost,
    count,
    is_aside,
    listed,
    mapped,
    numbers,
    raw,
    row,
    some_values,
    taken,
    whole,
)
from robochoc.sniffer.words_values import Content, Wording

WIDTHS = (1, 2, 4, 8)

# Branch and bound


def _afb_cpa(setting: Setting, said: Content) -> str:
    values = [listed(one)[0] for one in listed(said["assignments"])]
    told = assigned(setting, along(setting.order, values))
    least = listed(said["least"])
    if not least:  # it comes back
        if math.isinf(cost(said["bound"])):
            return f"no solution has {told}: take another value"
        return f"no solution with {told} costs less than {amount(said['bound'])}: take another value"
    known = _known(said["bound"])
    return f"so far {told}, which costs at least {amount(least[-1])}; {known}; it is {setting.receiver}'s turn"


def _known(bound: object) -> str:
    return "no solution is known yet" if math.isinf(cost(bound)) else f"the best solution so far costs {amount(bound)}"


def _fb_cpa(setting: Setting, said: Content) -> str:
    values = [listed(one)[0] for one in listed(said["assignments"])]
    return f"so far {assigned(setting, along(setting.order, values))}; what does a value of yours add to it at least?"


def _fb_estimate(_: Setting, said: Content) -> str:
    """The last estimate holds for all longer beginnings."""
    estimates, length = listed(said["estimates"]), len(listed(said["stamp"]))
    told = f"a value of mine adds at least {amount(estimates[-1])} to a CPA of {count(length, 'value')}"
    shorter = estimates[:-1]
    if not shorter:
        return told
    return f"{told}; to its beginnings, the empty one first, at least {numbers(shorter)}"


def _new_solution(setting: Setting, said: Content) -> str:
    told = assigned(setting, along(setting.order, said["values"]))
    return f"the best solution so far costs {amount(said['cost'])}: {told}"


def _terminate(setting: Setting, said: Content) -> str:
    if "context" in said:  # ADOPT and BnB-ADOPT
        condition = context(setting, said["context"]).removeprefix("as long as ").removesuffix(", ")
        return f"all above you have taken their last values{': ' if condition else ''}{condition}"
    if "best" in said:  # SyncBB
        bound, values = listed(said["best"])
        if math.isinf(cost(bound)):
            return "the search is over, and there is no solution"
        told = assigned(setting, along(setting.order, values))
        return f"the search is over: nothing costs less than {amount(bound)}, with {told}"
    return "the search is over: no solution is better than the best one so far"


def _path(setting: Setting, said: Content) -> str:
    pairs = [listed(one) for one in listed(said["assignments"])]
    told = assigned(setting, along(setting.order, [value for value, _ in pairs]))
    paid = sum(cost(paid) for _, paid in pairs)
    return (
        f"so far {told}, which costs {amount(paid)}; {_known(listed(said['best'])[0])}; it is {setting.receiver}'s turn"
    )


def _backtrack(setting: Setting, said: Content) -> str:
    if "best" not in said:  # SBT
        return f"nobody below {setting.receiver} has a value left that goes with its own: take another one"
    bound = listed(said["best"])[0]
    if math.isinf(cost(bound)):
        return f"{setting.receiver}'s value leads to no solution: take another one"
    return f"{setting.receiver}'s value leads to nothing that costs less than {amount(bound)}: take another one"


def _sizes(names: Sequence[str], domains: object) -> str:
    told = [f"{name} ({count(len(listed(values)), 'value')})" for name, values in along(names, domains)]
    return row(told) or "nobody"


def _each(setting: Setting, said: Content) -> list[object]:
    """Each robot's domain, of robots that are told of in runs; of no more robots than there are."""
    domains = listed(said["domains"])
    found: list[object] = []
    for run in listed(said["runs"]):
        kind, robots = map(whole, listed(run))
        found += [domains[kind]] * min(robots, len(setting.order) - len(found))
    return found


def _above(setting: Setting, said: Content) -> str:
    return f"above you there are {_sizes(setting.order, _each(setting, said))}"


def _below(setting: Setting, said: Content) -> str:
    domains = _each(setting, said)
    if not domains:
        return "nobody is below me"
    order = list(setting.order)
    names = order[order.index(setting.receiver) + 1 :] if setting.receiver in order else []
    told = f"below you there are {_sizes(names, domains)}"
    return f"{told}; all together they cost at most {amount(said['most'])}"


def _cpas(setting: Setting, said: Content) -> str:
    known = "no solution is known yet"
    if whole(said["least"]) < whole(said["ceiling"]):
        known = f"the best solution so far costs {amount(said['least'])}"
    many = count(said["count"], "partial assignment")
    return f"{many} for {setting.receiver} to extend; {known}"


def _explored(_: Setting, __: Content) -> str:
    return "nothing is left of the oldest partial assignments that I have had from you and have not answered"


def _solution(_: Setting, said: Content) -> str:
    places = row([str(whole(place) + 1) for place in listed(said["places"])])
    return (
        f"a solution costs {amount(said['cost'])}, less than all before; by number, robots' values in it are {places}"
    )


# On trees


def _value(setting: Setting, said: Content) -> str:
    value = said["value"]
    what = "I step aside" if is_aside(value) else row(taken(setting, setting.sender, value)) or "I have a value"
    if "counter" not in said:
        return f"{what} in this cycle"
    told = f"{what} from now on (change {whole(said['counter'])})"
    if "threshold" in said and not math.isinf(cost(said["threshold"])):
        return f"{told}; your subtree may cost {amount(said['threshold'])} then"
    return told


def _cost(setting: Setting, said: Content) -> str:
    lower, upper = cost(said["lb"]), cost(said["ub"])
    if math.isinf(lower):
        told = "my subtree has no solution"
    elif lower == upper:
        told = f"my subtree costs {amount(lower)}"
    elif math.isinf(upper):
        told = f"my subtree costs at least {amount(lower)}"
    else:
        told = f"my subtree costs between {amount(lower)} and {amount(upper)}"
    asked = "; tell me my threshold again" if said.get("threshold_request") else ""
    return f"{context(setting, said['context'])}{told}{asked}"


def _threshold(setting: Setting, said: Content) -> str:
    values = {robot: (value,) for robot, value in mapped(said["context"]).items()}
    return f"{context(setting, values)}your subtree may cost {amount(said['threshold'])} before you try other values"


def _wave(_: Setting, said: Content) -> str:
    return f"{said['candidate']}, which has {count(said['neighbours'], 'neighbour')}, wants to be the root"


def _visited(said: Content) -> str:
    return row([str(name) for name in listed(said["visited"])])


def _token(_: Setting, said: Content) -> str:
    return f"you are my child in the tree, which holds {_visited(said)} already"


def _back(_: Setting, said: Content) -> str:
    return f"all below me are in the tree, which holds {_visited(said)} by now"


def _domain(setting: Setting, said: Content) -> str:
    return some_values(setting, setting.sender, said["values"])


def _dimensions(_: Setting, said: Content) -> str:
    axes = mapped(said["separator"])
    cells = math.prod(whole(size) for size in axes.values())
    over = row([f"{robot} ({count(size, 'value')})" for robot, size in axes.items()])
    need, robot = listed(said["most"])
    return (
        f"my table will have {count(cells, 'cell')}{' over ' if over else ''}{over}, and no cost above"
        f" {amount(said['dearest'])}; from me down the induced width is {whole(said['induced_width'])},"
        f" and {robot} needs the most memory, {amount(need)} bytes"
    )


def _proceed(_: Setting, said: Content) -> str:
    axes = [str(name) for name in listed(said["separator"])]
    return f"all tables fit: make yours, over {row(axes)}" if axes else "all tables fit: make yours"


def _util(_: Setting, said: Content) -> str:
    import numpy as np  # noqa: PLC0415 - where there are tables only

    width, content = whole(said["width"]), raw(said["costs"])
    if width not in WIDTHS or len(content) % width:
        raise ValueError
    cells = np.frombuffer(content, f"<u{width}")
    hopeless = np.iinfo(cells.dtype).max
    finite = cells[cells != hopeless]
    told = f"a piece of my table: {count(len(cells), 'cost')}"
    if len(finite):
        told += f", from {amount(int(finite.min()))} to {amount(int(finite.max()))}"
    broken = len(cells) - len(finite)
    return f"{told}, and {broken:,} infinite" if broken else told


def _places(_: Setting, said: Content) -> str:
    places = [str(whole(place) + 1) for place in listed(said["assignment"])]
    if not places:
        return "nobody above you has to do with your subtree: take your best value"
    return f"by number, the values of the robots in your separator are {row(places)}, the nearest robot first"


# Local search


def _saved(broken: object, saved: object) -> str:
    """What a move would save: broken hard constraints first."""
    told = []
    if whole(broken):
        told.append(count(broken, "broken constraint"))
    if cost(saved):
        told.append(f"{amount(saved)} of cost")
    return row(told) or "nothing"


def _gain(_: Setting, said: Content) -> str:
    return f"my move would save {_saved(said['broken'], said['cost'])}"


def _offer(_: Setting, said: Content) -> str:
    if said["gains"] is None:
        return "I have no offer for you"
    rows = [[tuple(listed(pair)) for pair in listed(gains)] for gains in listed(said["gains"])]
    best = max((whole(broken), cost(saved)) for gains in rows for broken, saved in gains)
    many = f"{count(len(rows), 'value')} of yours and {len(rows[0]):,} of mine"
    if best <= (0, 0):
        return f"let us move together: of {many}, no two would save me anything"
    return f"let us move together: of {many}, the best two would save me {_saved(*best)}"


def _accept_offer(_: Setting, said: Content) -> str:
    saved = _saved(said["broken"], said["cost"])
    return f"I take your offer: you take your value number {whole(said['place']) + 1}, and we save {saved} in all"


def _reject(_: Setting, __: Content) -> str:
    return "I do not take your offer"


def _go(_: Setting, said: Content) -> str:
    if not isinstance(said["go"], bool):
        raise TypeError
    if said["go"]:
        return "go: of my neighbours, nobody is to move before us"
    return "no go: one of my neighbours is to move instead"


def _tables(said: Content) -> str:
    return "; ".join(numbers(entries) for entries in listed(said["rows"])[:4])


def _r(setting: Setting, said: Content) -> str:
    many = len(listed(said["rows"]))
    by = "our function" if many == 1 else f"our {many:,} functions, one after the other"
    return f"by {by}, {setting.receiver}'s values cost {_tables(said)}"


def _q(setting: Setting, said: Content) -> str:
    many = len(listed(said["rows"]))
    by = "our function" if many == 1 else f"each of our {many:,} functions in turn"
    return f"without {by}, {setting.sender}'s values cost {_tables(said)}"


WORDS: Mapping[str, Wording] = MappingProxyType(
    {
        "FBCPA": _fb_cpa,
        "FBEstimate": _fb_estimate,
        "NewSolution": _new_solution,
        "Terminate": _terminate,
        "Path": _path,
        "Backtrack": _backtrack,
        "Above": _above,
        "Below": _below,
        "CPAs": _cpas,
        "Explored": _explored,
        "Solution": _solution,
        "Value": _value,
        "Cost": _cost,
        "Threshold": _threshold,
        "Wave": _wave,
        "Token": _token,
        "Back": _back,
        "Domain": _domain,
        "Dimensions": _dimensions,
        "Proceed": _proceed,
        "UTIL": _util,
        "VALUE": _places,
        "Gain": _gain,
        "Offer": _offer,
        "Reject": _reject,
        "Go": _go,
        "R": _r,
        "Q": _q,
    }
)
"""By the type's name."""

CPA: Wording = _afb_cpa
"""AFB's, which has bounds."""
ACCEPT: Wording = _accept_offer
"""MGM-2's, of an offer."""
