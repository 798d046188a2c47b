"""A robot's state at one moment, as text. Inspection changes nothing, and its checks are not counted.

Agent views, nogood stores, partial assignments and contexts are found by the names and types of the protocol's
attributes. A protocol can describe other special attributes itself (`protocols/protocol.py`). All other attributes are
shown by `safe_repr`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import cache
from itertools import islice
from typing import Any

from robochoc.model.priorities import natural_key
from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.nogood import NogoodStore
from robochoc.replay.safe_repr import safe_repr
from robochoc.replay.value_text import NumberedValueText, ValueText, as_value, cut
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiled_core import attributes_of

MOST_VALUES = 60
"""The maximum number of values of the robot that are shown besides the current one."""
MOST_NOGOODS = 60
MOST_SEEN = 200
"""The maximum number of robots whose values are shown."""
MOST_ELSE = 40
ALWAYS = "what holds whatever the others take"
VIEWS = ("view", "cpa", "path", "assignments", "context")
"""Attributes in which protocols store the known values of other robots."""
_KNOWN = {
    *(
        "problem",
        "order",
        "outbox",
        "secret",
        "checks_at_send",
        "value",
        "verdict",
        "chance",
        "settings",
        "store",
        "nogoods",
        "allowed",
    )
}
"""Attributes that are shown elsewhere, or are not informative."""

Seen = Callable[[], dict[str, Value]]
"""Returns the others' values against which a robot checks its own."""


class Inspector:
    """Describes the state of a robot with its `part` of the problem."""

    def __init__(self, part: AgentProblem) -> None:
        self._part = part
        self._problem = LocalProblem(part)  # a separate problem, so that its checks are not counted
        self._own = ValueText(part.interfaces)
        self.agent = part.robot.name
        self._ranks = part.known.rank
        self._last_messages: dict[str, Message] = {}
        self._last_values: dict[str, Value] = {}

    def record_received(self, sender: str, message: Message) -> None:
        """Record a message received by the robot, for protocols without a view."""
        self._last_messages[sender] = message
        value = as_value(getattr(message, "value", None))
        width = len(self._part.interfaces.get(sender, ()))
        if value is not None and len(value) == width and not hasattr(message, "lhs"):
            self._last_values[sender] = value

    def view(self, protocol: Protocol) -> list[tuple[str, str]]:
        """Return the known values of other robots, or otherwise their last messages."""
        others = self._others(protocol)
        known = self._known(protocol)
        if protocol.numbered_values:
            pairs = {name: others.value(name, (number,)) for name, number in attributes_of(protocol)["view"].items()}
        elif known is not None:
            pairs = {name: others.own_value_text(name, value) for name, value in known.items()}
        else:
            pairs = {name: self._own.own_value_text(name, value) for name, value in self._last_values.items()}
            for name, message in self._last_messages.items():
                if name not in pairs:
                    pairs[name] = self.message_text(name, message) or type(message).__name__
        shown = [(name, pairs[name]) for name in sorted(pairs, key=self._rank)[:MOST_SEEN]]
        more = len(pairs) - len(shown)
        return [*shown, ("", f"and {more:,} more")] if more else shown

    def has_forgotten(self, protocol: Protocol, robot: str) -> bool:
        """Return whether the protocol stores others' values by name, but none of `robot`."""
        view = attributes_of(protocol).get(self._view_in(protocol))
        return isinstance(view, Mapping) and robot not in view

    def _rank(self, robot: str) -> tuple[int, object]:
        """Return a sort key: robots in priority order, then other names."""
        rank = self._ranks.get(robot)
        return (0, rank) if rank is not None else (1, natural_key(robot))

    def message_text(self, sender: str, message: Message, receiver: str = "") -> str:
        """Return a message as text. The receiver is this robot unless `receiver` is given."""
        fields = {name: getattr(message, name) for name in message.__struct_fields__}
        value, lhs = as_value(fields.get("value")), fields.get("lhs")
        if value is not None and isinstance(lhs, Mapping):
            held = self._own.all(self._pairs(lhs, ()))
            against = self._own.against(receiver or self.agent, value)
            return f"while {held}: {against}" if held else f"{against}, whatever the others take"
        if value is not None:
            fields["value"] = self._own.own_value_text(sender, value)
        elif "value" in fields and fields["value"] is None:
            fields["value"] = "withdraws"
        for name in VIEWS:
            if isinstance(fields.get(name), Mapping | list | tuple):
                fields[name] = self._own.all(self._pairs(fields[name], self._part.order)) or "no robot has a value"
        told = {name: thing if isinstance(thing, str) else safe_repr(thing) for name, thing in fields.items()}
        return cut(", ".join(text if name == "value" else f"{name}: {text}" for name, text in told.items()))

    def domain(self, protocol: Protocol) -> list[tuple[str, str | None]]:
        """Return each value of the robot with the known reason that excludes it, or None."""
        count = len(protocol.problem.values)
        places = list(range(min(count, MOST_VALUES)))
        if protocol.value is not None and protocol.value >= len(places):
            places.append(protocol.value)
        seen = cache(lambda: self._seen(protocol))  # computed at most once, and only if a value needs it
        shown = [(self.own_value(protocol, index, seen), self.against(protocol, index, seen)) for index in places]
        more = count - len(places)
        return [*shown, (f"and {more:,} more", None)] if more else shown

    def own_value(self, protocol: Protocol, index: int, seen: Seen | None = None) -> str:
        """Return the value at `index` as text, with its cost if any value has a cost. `seen`: see `_seen`."""
        text = self._own.own_value_text(self.agent, protocol.problem.values[index])
        notes = protocol.value_notes(index)
        if notes:
            return f"{text} ({', '.join(f'{name} {safe_repr(number)}' for name, number in notes.items())})"
        if protocol.traits.costs:
            cost = self._problem.cost(index, seen() if seen else self._seen(protocol))
            return f"{text} (costs {safe_repr(cost)})" if cost < INFINITE else text
        return text

    def against(self, protocol: Protocol, index: int, seen: Seen | None = None) -> str | None:
        """Return the known reason that excludes the value at `index`; None if it is not excluded."""
        found = self.ruling(protocol, index, seen)
        return None if found is None else found[0]

    def ruling(self, protocol: Protocol, index: int, seen: Seen | None = None) -> tuple[str, Collection[str]] | None:
        """Return the reason that excludes the value at `index`, with the robots whose values it involves."""
        store = attributes_of(protocol).get("store")
        if isinstance(store, NogoodStore):
            lhs = store[index]
            return None if lhs is None else (self._others(protocol).all(lhs) or ALWAYS, lhs)
        broken = self._problem.conflict_with_key(index, seen() if seen else self._seen(protocol))
        if broken is not None:
            lhs, key = broken
            return f"{self._own.all(lhs) or 'its own constraints'}, by {cut(key.partition(':')[2])}", lhs
        return ("a try: nobody below could go on with it", ()) if protocol.tried(index) else None

    def nogoods(self, protocol: Protocol) -> list[str]:
        """Return the stored nogoods as text: while V1.1 = 2: V2.1 != 3."""
        found = [
            f"while {lhs}: {against}" if lhs else f"{against}, whatever the others take"
            for lhs, against in islice(self._nogoods(protocol), MOST_NOGOODS + 1)
        ]
        return [*found[:MOST_NOGOODS], "and more"] if len(found) > MOST_NOGOODS else found

    def more(self, protocol: Protocol) -> dict[str, str]:
        """Return all other attributes of the protocol; for built-in protocols, only public non-empty ones."""
        ours = type(protocol).__module__.startswith("robochoc.")
        skipped = {*_KNOWN, safely(lambda: self._view_in(protocol), "")}
        told: dict[str, str] = {}
        if type(protocol.order) is not PriorityOrder:
            told["order"] = safe_repr(protocol.order)
        if protocol.verdict is not None:
            told["verdict"] = str(protocol.verdict)
        for name, thing in attributes_of(protocol).items():
            if name in skipped or (ours and name.startswith("_")) or len(told) == MOST_ELSE:
                continue
            if not (ours and _is_empty(thing)):
                told.setdefault(name.lstrip("_"), safe_repr(thing))
        return told

    # Knowledge about other robots

    def _others(self, protocol: Protocol) -> ValueText:
        """Return the formatter for the values of others: some protocols (DisFC) send numbers of assignments instead."""
        return NumberedValueText(self._part.interfaces) if protocol.numbered_values else self._own

    def _view_in(self, protocol: Protocol) -> str:
        """Return the name of the attribute that contains the values of others; empty if there is none."""
        there = attributes_of(protocol)
        return next((name for name in VIEWS if isinstance(there.get(name), Mapping | list | tuple)), "")

    def _known(self, protocol: Protocol) -> dict[str, Value] | None:
        """Return the values of others that the protocol stores; None if it stores none."""
        name = self._view_in(protocol)
        if not name:
            return None
        return self._pairs(attributes_of(protocol)[name], protocol.order.names)

    def _pairs(self, kept: Mapping[str, object] | Sequence[object], order: Sequence[str]) -> dict[str, Value]:
        """Return the values in `kept`, by name; a sequence contains the values of the first robots in `order`."""
        pairs = kept.items() if isinstance(kept, Mapping) else zip(order, kept, strict=False)
        found = {who: value for who, thing in pairs if (value := _value_in(thing)) is not None}
        return {who: value for who, value in found.items() if who in self._part.interfaces}

    def _seen(self, protocol: Protocol) -> dict[str, Value]:
        """Return the others' values against which the robot checks its own; without a view, the values in messages."""
        known = protocol.checked_against
        if known is None:
            known = self._known(protocol)
        if known is None:
            known = self._last_values
        widths = self._part.interfaces
        return {name: value for name, value in known.items() if len(value) == len(widths.get(name, ()))}

    def _nogoods(self, protocol: Protocol) -> list[tuple[str, str]]:
        store = attributes_of(protocol).get("store")
        values = protocol.problem.values
        if isinstance(store, NogoodStore):
            others = self._others(protocol)
            return [
                (others.all(lhs), self._own.against(self.agent, values[index]))
                for index in range(len(values))
                if (lhs := store[index]) is not None
            ]
        return [self._both_sides(dict(nogood)) for nogood in protocol.kept_nogoods]

    def _both_sides(self, nogood: dict[str, Value]) -> tuple[str, str]:
        own = nogood.pop(self.agent, ())
        lhs = sorted(nogood.items(), key=lambda pair: self._part.order.index(pair[0]))
        return self._own.all(lhs), self._own.against(self.agent, own)


def safely(inspect: Callable[[], Any], otherwise: Any) -> Any:  # noqa: ANN401 - any attribute
    """Return the result of `inspect`, or `otherwise` if it raises: a user's protocol may have any attributes."""
    try:
        return inspect()
    except Exception:  # noqa: BLE001 - see above
        return otherwise


def _value_in(thing: object) -> Value | None:
    """Return a value, without the cost or counter that may accompany it."""
    value = as_value(thing)
    if value is None and isinstance(thing, Sequence) and thing and not isinstance(thing, str | bytes):
        value = as_value(thing[0])
    return value


def _is_empty(thing: object) -> bool:
    return thing is None or (isinstance(thing, Mapping | Sequence | AbstractSet) and not thing)
