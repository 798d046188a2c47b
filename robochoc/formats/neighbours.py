"""Check the members of a team and their parents: the statements of two robots about each other.

docs/reference/format.md, "The team".
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from robochoc.formats.diagnostics import Diagnostic, shortened, suggestion
from robochoc.formats.team_members import TeamMembers
from robochoc.model.priorities import CycleError, priority_order
from robochoc.model.problem import Robot


def missing_robots(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield neighbours that are not there."""
    known = dict.fromkeys([*members.files, *sorted(members.broken)])
    for entry in members.entries.values():
        if entry.other not in known:
            name = shortened(entry.other)
            absent, step = members.files[entry.robot.name].places.absent(name)
            hint = f"{step}; {suggestion(name, known, 'robots')}"
            yield entry.place.mistake(f"the {entry.role} '{name}' {absent}", hint)


def disagreements(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield pairs of robots of which each should call the other the opposite of what it is called itself."""
    for entry in members.entries.values():
        name, other = entry.robot.name, entry.other
        answer = members.entries.get((other, name))
        if answer is None and other in members.files:
            message = f"the {entry.role} '{other}' does not list '{name}' as its {entry.role.opposite}"
            hint = f'add <agent name="{name}"> there, among the {entry.role.opposite} agents ({members.place(other)})'
            yield entry.place.mistake(message, hint)
        elif answer and answer.role is entry.role and name < other:
            message = f"'{other}' is listed as {entry.role}, but lists '{name}' as {entry.role} itself"
            yield entry.place.mistake(message, f"change it here or at {answer.place}")


def cycles(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield cycles of parents, each without a link in common with those before it."""
    parents = {name: set(agreed) for name, agreed in members.agreed.items()}
    while True:
        try:
            priority_order(parents)
        except CycleError as error:
            links = []
            for parent, child in zip(error.cycle, (*error.cycle[1:], error.cycle[0]), strict=True):
                parents[child].discard(parent)
                links.append(members.entries[child, parent])
            elsewhere = " or ".join(str(link.place) for link in links[1:])
            hint = f"one of these parents must go: the one here, or at {elsewhere}"
            yield links[0].place.mistake(f"the parents form a cycle: {error}", hint)
        else:
            return


def mixed_kinds(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots that differ from most others in being a DisCSP or a DisWCSP."""
    usual = Counter(robot.kind for robot in members.robots).most_common(1)
    for robot in members.robots:
        if robot.kind is not usual[0][0]:
            other = next(other for other in members.robots if other.kind is usual[0][0])
            message = f"the robot is a {robot.kind}, but '{other.name}' is a {other.kind}"
            hint = f"a team is one or the other: change the type here or at {members.place(other.name)}"
            yield members.place(robot.name).mistake(message, hint)


def mixed_costs(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots that differ from most others in what is done with the sum of costs, or in the unit of costs."""
    usual = Counter((robot.costs.maximize, robot.costs.places) for robot in members.robots).most_common(1)
    for robot in members.robots:
        maximize, places = robot.costs.maximize, robot.costs.places
        if (maximize, places) == usual[0][0]:
            continue
        other = next(one for one in members.robots if (one.costs.maximize, one.costs.places) == usual[0][0])
        if maximize is not other.costs.maximize:
            message = f"the robot {_objective(robot)} costs, but '{other.name}' {_objective(other)} them"
            hint = f"a team does one or the other: change the objective here or at {members.place(other.name)}"
        else:
            message = f"costs of {places} decimal places, but '{other.name}' has {other.costs.places}"
            hint = "the robots of a team count costs in one unit"
        yield members.place(robot.name).mistake(message, hint)


def _objective(robot: Robot) -> str:
    return "maximizes" if robot.costs.maximize else "minimizes"


def shared_variables(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield variables that more than one robot calls its own."""
    for variable, (first, *others) in members.owners.items():
        for other in others:
            message = f"the variable '{shortened(variable)}' is also one of '{first}'"
            hint = f"names of variables are unique in a team: rename it here or at {members.place(first, variable)}"
            yield members.place(other, variable).mistake(message, hint)


def out_of_order(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots that stand before one of their parents, where the team says an order of its own."""
    rank = {name: place for place, name in enumerate(members.order)}
    if not members.ranks:
        return  # the links themselves have a mistake
    for name, parents in members.agreed.items() if rank else ():
        late = next((parent for parent in parents if rank[parent] > rank[name]), None)
        if late is not None:
            message = f"the robot stands before its parent '{late}' in the team"
            hint = "the robots of a team stand in priority order, parents before their children"
            yield members.place(name).mistake(message, hint)
