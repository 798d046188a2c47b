"""The owners of a pyDCOP problem's variables: by a regular expression, the distribution, hints, or in turn."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import field
from heapq import heapify, heapreplace

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.dialect import ConversionNote, owners_by
from robochoc.formats.yaml_tree import Node, Scalar
from robochoc.system.lazy_dataclass import dataclass


@dataclass
class VariableOwners:
    """The variables that each agent owns.

    Attributes:
        agents: The agents, in the order of the file.
        variables: The variables, in the order of the file.
        constraints: The constraints. A file may assign them to hosts, but here they have no owners.
        owners: The agent of each variable.
        notes: Notes on the decisions made.
    """

    agents: list[str]
    variables: Sequence[str]
    constraints: Collection[str]
    owners: dict[str, str] = field(default_factory=dict)
    notes: list[ConversionNote] = field(default_factory=list)

    def assign_by_pattern(self, pattern: str) -> None:
        """Group the variables by the first group in the match of `pattern`, or by the whole match."""
        self.owners = owners_by(pattern, self.variables)
        self.agents = list(dict.fromkeys(self.owners.values()))

    def assign_by_agent(self, node: Node, what: str) -> None:
        """Read owners from a mapping of agents to the names that they host. Variables that have an owner keep it."""
        if not node.is_mapping:
            raise MistakeError(f"the {what} is not a mapping", "write AGENT: [VARIABLE, VARIABLE]", node.line)
        found: dict[str, str] = {}
        variables, agents = set(self.variables), set(self.agents)
        for agent, hosted in _named(node):
            if agent not in agents:
                message = f"the {what} names the agent '{shortened(agent)}', which is not in the problem"
                raise MistakeError(message, suggestion(agent, self.agents, "agents"), hosted.line)
            for name in _names(hosted):
                if name in variables:
                    if found.setdefault(name, agent) != agent:
                        message = f"the {what} gives '{shortened(name)}' to {shortened(found[name])} and to {agent}"
                        raise MistakeError(message, "give it to one of them", hosted.line)
                elif name not in self.constraints and what != "distribution":
                    message = f"the {what} names '{shortened(name)}', which is neither a variable nor a constraint"
                    raise MistakeError(message, suggestion(name, list(self.variables), "variables"), hosted.line)
        for name, agent in found.items():
            self.owners.setdefault(name, agent)

    def assign_remaining(self) -> None:
        """Assign each variable without an owner to the agent with the fewest; without agents, to its own robot."""
        left = [name for name in self.variables if name not in self.owners]
        if not left:
            return
        if not self.agents:
            self.agents = list(self.variables)
            self.owners.update((name, name) for name in left)
            self.notes.append(ConversionNote("owner", "there are no agents: each variable gets its own robot"))
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
        text = f"{len(left)} variables have no owner in the file: given in turn to the agents with the fewest"
        self.notes.append(ConversionNote("owner", text))

    def robots(self) -> dict[str, list[str]]:
        """Return the variables of each agent that owns any, and add a note on the other agents."""
        owned: dict[str, list[str]] = {agent: [] for agent in self.agents}
        for name in self.variables:
            owned[self.owners[name]].append(name)
        idle = [agent for agent, names in owned.items() if not names]
        if idle:
            self.notes.append(ConversionNote("dropped", f"agents without variables: {shortened(' '.join(idle))}"))
        return {agent: names for agent, names in owned.items() if names}


def agent_names(node: Node | None) -> list[str]:
    """Return the agents in `node`: a list, or a mapping to attributes, which only concern pyDCOP's distribution."""
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
    """Return a key as a name. Raises `MistakeError` if it is not a name: YAML reads `no` and `on` as truth values."""
    if isinstance(key, int) and not isinstance(key, bool):
        return str(key)
    if not isinstance(key, str) or not key:
        what = f"expected a name, found '{shortened(str(key))}'"
        raise MistakeError(
            what, "put the name in quotes: YAML reads yes, no, on, off, true, false as truth values", line
        )
    return key
