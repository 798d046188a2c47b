"""The owners of a pyDCOP problem's variables: by the distribution, by hints, or by the order of both."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from heapq import heapify, heapreplace

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.dialect import ConversionNote, owners_by
from robochoc.formats.yaml_tree import Node, Scalar


@dataclass
class VariableOwners:
    """The variables that each agent owns.

    Attributes:
        agents: The agents, in the order of the file.
        variables: The variables, likewise.
        constraints: Names that may be hosted, too, and have no owner here.
        owners: The agent of each variable.
        notes: What was decided here.
    """

    agents: list[str]
    variables: Sequence[str]
    constraints: Collection[str]
    owners: dict[str, str] = field(default_factory=dict)
    notes: list[ConversionNote] = field(default_factory=list)

    def assign_by_pattern(self, pattern: str) -> None:
        """Let variables belong together that `pattern` finds the same in: its first group, or all of its match."""
        self.owners = owners_by(pattern, self.variables)
        self.agents = list(dict.fromkeys(self.owners.values()))

    def assign_by_agent(self, node: Node, what: str) -> None:
        """Take the owners from a mapping of agents to what they host. Those that are known stay."""
        if not node.is_mapping:
            raise MistakeError(f"the {what} is no mapping", "write AGENT: [VARIABLE, VARIABLE]", node.line)
        found: dict[str, str] = {}
        variables, agents = set(self.variables), set(self.agents)
        for agent, hosted in _named(node):
            if agent not in agents:
                message = f"the {what} names the agent '{shortened(agent)}', which the problem has not"
                raise MistakeError(message, suggestion(agent, self.agents, "agents"), hosted.line)
            for name in _names(hosted):
                if name in variables:
                    if found.setdefault(name, agent) != agent:
                        message = f"the {what} gives '{shortened(name)}' to {shortened(found[name])} and to {agent}"
                        raise MistakeError(message, "let one of them have it", hosted.line)
                elif name not in self.constraints and what != "distribution":
                    message = f"the {what} names '{shortened(name)}', which is no variable and no constraint"
                    raise MistakeError(message, suggestion(name, list(self.variables), "variables"), hosted.line)
        for name, agent in found.items():
            self.owners.setdefault(name, agent)

    def assign_remaining(self) -> None:
        """Give what nobody owns to the agents that own least, in their order; without agents, each gets its own."""
        left = [name for name in self.variables if name not in self.owners]
        if not left:
            return
        if not self.agents:
            self.agents = list(self.variables)
            self.owners.update((name, name) for name in left)
            self.notes.append(ConversionNote("owner", "there are no agents: each variable is a robot's of its own"))
            return
        load = dict.fromkeys(self.agents, 0)
        for agent in self.owners.values():
            load[agent] += 1
        least = [(number, place, agent) for place, (agent, number) in enumerate(load.items())]
        heapify(least)
        for name in left:
            number, place, agent = least[0]
            self.owners[name] = agent
            heapreplace(least, (number + 1, place, agent))
        text = f"the file says no owner of {len(left)} variables: agents that had least took them, in their order"
        self.notes.append(ConversionNote("owner", text))

    def robots(self) -> dict[str, list[str]]:
        """Return the variables of each agent that owns some. The others are left out, and noted."""
        owned: dict[str, list[str]] = {agent: [] for agent in self.agents}
        for name in self.variables:
            owned[self.owners[name]].append(name)
        idle = [agent for agent, names in owned.items() if not names]
        if idle:
            self.notes.append(ConversionNote("dropped", f"agents that own no variable: {shortened(' '.join(idle))}"))
        return {agent: names for agent, names in owned.items() if names}


def agent_names(node: Node | None) -> list[str]:
    """Return the agents in `node`: a list, or a mapping to attributes that only concern pyDCOP's distribution."""
    if node is None or node.is_empty:
        return []
    if not node.is_mapping:
        return list(dict.fromkeys(_names(node)))
    names = []
    for name, attributes in _named(node):
        attributes.skip()
        names.append(name)
    return names


def _named(node: Node) -> Iterator[tuple[str, Node]]:
    for key, one in node.named():
        yield name_text(key, one.line), one


def _names(node: Node) -> Iterator[str]:
    if node.is_empty:
        return
    for one in node.items if node.items is not None else [node]:
        yield name_text(one.scalar, one.line)


def name_text(key: Scalar, line: int) -> str:
    """Return a name. Raises `MistakeError` unless it is one: YAML takes `no` and `on` for truth values."""
    if isinstance(key, int) and not isinstance(key, bool):
        return str(key)
    if not isinstance(key, str) or not key:
        what = f"'{shortened(str(key))}' where a name should stand"
        raise MistakeError(what, "YAML takes yes, no, on, off, true and false for truth values: write quotes", line)
    return key
