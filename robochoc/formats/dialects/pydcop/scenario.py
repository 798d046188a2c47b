"""pyDCOP's scenarios: robots that leave."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.dialect import ConversionNote, NameMap
from robochoc.formats.dialects.pydcop.owners import name_text
from robochoc.formats.yaml_tree import Node
from robochoc.model.problem import RemoveAgent, ScenarioEvent, Team
from robochoc.system.plain_text import counted


def read_scenario(
    root: Node, team: Team, names: NameMap, agents: Collection[str], notes: list[ConversionNote]
) -> tuple[ScenarioEvent, ...]:
    """Return the events of a scenario.

    Args:
        root: The file.
        team: The team at its start.
        names: Maps the names of agents to those of robots.
        agents: All agents in the problem, including agents without variables.
        notes: Notes on ignored parts are added to this list.

    Raises:
        MistakeError: if the scenario is not valid.
    """
    remaining, events, delays, left_out = {robot.name for robot in team.robots}, [], 0, 0
    listed, inputs = root.get("events"), root.get("inputs")
    if inputs is not None:
        inputs.skip()  # a remark of the program that wrote the file
    if listed is None or listed.items is None:
        raise MistakeError("has no events", "write events: and a list of them", root.line)
    for event in listed.items:
        delay, name = event.get("delay"), event.get("id")
        for ignored in filter(None, (delay, name)):
            ignored.skip()
        delays += delay is not None
        changes: list[RemoveAgent] = []
        for action in _actions(event, is_delay=delay is not None):
            robot = _removed_robot(action, names, agents)
            if robot is None:
                left_out += 1
            elif robot in remaining:
                remaining.remove(robot)
                changes.append(RemoveAgent(robot))
        if not remaining:
            raise MistakeError("an event removes the last robot", "keep at least one robot", event.line)
        if changes:
            events.append(ScenarioEvent(tuple(changes)))
    notes += _notes(len(events), delays, left_out)
    return tuple(events)


def _notes(events: int, delays: int, left_out: int) -> Iterator[ConversionNote]:
    if events:
        text = "in pyDCOP other agents take over the variables of a removed agent; here they leave with their robot"
        yield ConversionNote("scenario", text)
    if delays:
        yield ConversionNote(
            "scenario", f"{counted(delays, 'delay')} in seconds: an event follows the solution of the problem before it"
        )
    if left_out:
        yield ConversionNote("dropped", f"{left_out} actions other than remove_agent, which pyDCOP ignores, too")


def _actions(event: Node, *, is_delay: bool) -> list[Node]:
    actions = event.get("actions")
    if actions is None and not is_delay:
        raise MistakeError("an event has neither delay nor actions", "write actions: or delay:", event.line)
    return (actions.items if actions else None) or []


def _removed_robot(action: Node, names: NameMap, agents: Collection[str]) -> str | None:
    """Return the robot that an action removes, or None if it is another kind of action."""
    kind = action.get("type")
    if kind is None or kind.scalar != "remove_agent":
        action.skip()
        return None
    agent = action.get("agent")
    name = name_text(agent.scalar if agent else None, action.line)
    if name not in agents:
        what = f"removes the agent '{shortened(name)}', which the problem has not"
        raise MistakeError(what, suggestion(name, agents, "agents"), action.line)
    return names.allowed(name)
