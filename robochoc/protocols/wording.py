"""Parts of the sentences that show messages: values with the names of their variables, costs, nogoods.

`Message.in_words` uses them. A message may come from a journal of unknown origin, so long lists are cut, and values of
unknown robots get names too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from robochoc.system.plain_text import listed

RobotValue = Sequence[int | None]
"""A robot's value: the values of its interface variables (`Value` of `model/problem.py`)."""
T = TypeVar("T")


def cost_text(cost: float) -> str:
    """Return a cost as text: `3`, `2.5`, `infinity`."""
    if math.isinf(cost) or math.isnan(cost):
        return "infinity"
    shown = round(cost, 3)
    return f"{int(shown):,}" if shown == int(shown) else f"{shown:,}"


def costs_text(costs: Iterable[float]) -> str:
    """Return the costs of values as text: `0, 1 and 3`."""
    return listed(map(cost_text, costs))


def incumbent_text(cost: float) -> str:
    """Return a clause about the incumbent, the best solution so far, with this cost; infinity: there is none."""
    return "no solution is known yet" if math.isinf(cost) else f"the best solution so far costs {cost_text(cost)}"


def is_withdrawn(value: RobotValue) -> bool:
    """Return whether a robot with this value is withdrawn: it has variables, and none of them has a value."""
    return bool(value) and all(part is None for part in value)


class Wording(NamedTuple):
    """The sender and the receiver of a message, and the names to use in its sentence.

    `order` and `interfaces` are empty if the team is unknown.

    Attributes:
        sender: The robot that sent the message.
        receiver: The robot that receives it.
        order: All robots, the highest priority first.
        interfaces: For each robot, the variables whose values appear in its messages.
        branch: The robots whose values appear in a partial assignment, the highest first: the priority order; in a
            protocol on the order's pseudo-tree, the sender's ancestors and the sender.
        symbols: For each symbolic variable, the names of its values.
    """

    sender: str
    receiver: str
    order: Sequence[str] = ()
    interfaces: Mapping[str, Sequence[str]] = {}
    branch: Sequence[str] = ()
    symbols: Mapping[str, Sequence[str]] = {}

    def variables(self, robot: str) -> str:
        """Return a name for a robot's value: the names of its variables."""
        names = self.interfaces.get(robot, ())
        return listed(names) if names else f"the value of {robot}"

    def parts(self, robot: str, value: RobotValue) -> list[tuple[str, str]]:
        """Return the variables that have a value in a robot's value, each with its value."""
        names = self.interfaces.get(robot, ())
        if len(names) != len(value):
            names = (robot,) if len(value) == 1 else [f"{robot}[{place}]" for place in range(1, len(value) + 1)]
        known = zip(names, value, strict=True)
        return [(name, self._called(name, part)) for name, part in known if part is not None]

    def _called(self, variable: str, value: int) -> str:
        symbols = self.symbols.get(variable, ())
        return symbols[value] if 0 <= value < len(symbols) else str(value)

    def facts(self, robot: str, value: RobotValue) -> list[str]:
        """Return the value of a robot, one text for each variable: `V1.1 = 2`, or `V1 withdraws`."""
        if is_withdrawn(value):
            return [f"{robot} withdraws"]
        return [f"{name} = {part}" for name, part in self.parts(robot, value)]

    def own_value(self, value: RobotValue, otherwise: str = "I have a value") -> str:
        """Return the sender's value in the first person; `otherwise` if no variable has a value."""
        return "I withdraw" if is_withdrawn(value) else listed(self.facts(self.sender, value)) or otherwise

    def assigned(self, values: Iterable[tuple[str, RobotValue]]) -> str:
        """Return the values of robots: `V1.1 = 2 and V1.3 = 1`."""
        return listed([fact for robot, value in values for fact in self.facts(robot, value)]) or "nothing yet"

    def partial(self, values: Sequence[RobotValue]) -> str:
        """Return a partial assignment: the values of the first robots of `branch`."""
        return self.assigned(along(self.branch, values))

    def condition(self, lhs: Mapping[str, RobotValue]) -> str:
        """Return the left side of a nogood as a condition, `as long as V1.1 = 2, `; empty if there is none.

        Variables that do not matter are left out.
        """
        facts = [f"{name} = {part}" for robot, value in lhs.items() for name, part in self.parts(robot, value)]
        return f"as long as {listed(facts)}, " if facts else ""

    def nogood(self, lhs: Mapping[str, RobotValue], value: RobotValue) -> str:
        """Return a nogood: `as long as V1.1 = 2, V2.1 cannot be 3`, where `value` is the receiver's."""
        condition = self.condition(lhs)
        return f"{condition}{self._cannot_be(value)}{'' if condition else ', whatever the others do'}"

    def _cannot_be(self, value: RobotValue) -> str:
        match self.parts(self.receiver, value):
            case []:
                return f"{self.receiver} has no value left"
            case [(name, part)]:
                return f"{name} cannot be {part}"
            case facts:
                both = "both" if len(facts) == len("ab") else "all"
                return f"{listed([f'{name} = {part}' for name, part in facts])} cannot {both} hold"

    def context(self, values: Mapping[str, tuple[RobotValue, int]]) -> str:
        """Return a context of ADOPT (values with counters): `as long as V1.1 = 2, `; empty if there is none."""
        facts = [fact for robot, (value, _) in values.items() for fact in self.facts(robot, value)]
        return f"as long as {listed(facts)}, " if facts else ""

    def domain(self, values: Sequence[RobotValue]) -> str:
        """Return the possible values of the sender: `V2.1 is 1, 2 or 3`."""
        names = self.interfaces.get(self.sender, ())
        flying = [value for value in values if not is_withdrawn(value)]
        withdrawn = ", or I withdraw" if len(flying) < len(values) else ""
        parts = [[part for _, part in self.parts(self.sender, value)] for value in flying]
        if all(len(value) == 1 for value in flying):
            shown = listed([part for value in parts for part in value], "or")
        else:
            shown = listed([f"({', '.join(value)})" for value in parts], "or")
        called = names[0] if len(names) == 1 else f"({', '.join(names)})" if names else self.sender
        return f"{called} is {shown or 'nothing'}{withdrawn}"


def along(names: Sequence[str], things: Sequence[T]) -> list[tuple[str, T]]:
    """Return each thing with its robot, in the order of `names`; robots beyond the list are numbered."""
    known = [*names[: len(things)], *(f"robot {place + 1}" for place in range(len(names), len(things)))]
    return list(zip(known, things, strict=True))
