"""Who is in a team, and who is whose parent: what two files say of each other (FORMAT.md, "The team")."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from robochoc.formats.diagnostics import Diagnostic, shortened, suggestion
from robochoc.formats.members import Entry, Members
from robochoc.problem import CycleError, priority_order


def missing_files(members: Members) -> Iterator[Diagnostic]:
    """Neighbours that have no file."""
    known = dict.fromkeys([*members.files, *sorted(members.broken)])
    for entry in members.entries.values():
        if entry.other not in known:
            name = shortened(entry.other)
            message = f"the {entry.role} '{name}' has no file: there is no {members.folder / name}.xml"
            hint = f"write that file or delete this agent; {suggestion(name, known, 'robots')}"
            yield Diagnostic(entry.robot.file, entry.line, message, hint)


def disagreements(members: Members) -> Iterator[Diagnostic]:
    """Pairs of robots of which each should call the other the opposite of what it is called itself."""
    for entry in members.entries.values():
        name, other = entry.robot.name, entry.other
        answer = members.entries.get((other, name))
        if answer is None and other in members.files:
            message = f"the {entry.role} '{other}' does not list '{name}' as its {entry.role.opposite}"
            hint = f'add <agent name="{name}"> there, among the {entry.role.opposite} agents ({members.place(other)})'
            yield Diagnostic(entry.robot.file, entry.line, message, hint)
        elif answer and answer.role is entry.role and name < other:
            message = f"'{other}' is listed as {entry.role}, but lists '{name}' as {entry.role} itself"
            yield Diagnostic(entry.robot.file, entry.line, message, f"change it here or at {_place(answer)}")


def cycles(members: Members) -> Iterator[Diagnostic]:
    """Cycles of parents, each without a link in common with those before it."""
    parents = {name: set(agreed) for name, agreed in members.agreed.items()}
    while True:
        try:
            priority_order(parents)
        except CycleError as error:
            links = []
            for parent, child in zip(error.cycle, (*error.cycle[1:], error.cycle[0]), strict=True):
                parents[child].discard(parent)
                links.append(members.entries[child, parent])
            hint = f"one of these parents must go: the one here, or at {' or '.join(map(_place, links[1:]))}"
            yield Diagnostic(links[0].robot.file, links[0].line, f"the parents form a cycle: {error}", hint)
        else:
            return


def mixed_kinds(members: Members) -> Iterator[Diagnostic]:
    """Robots that differ from most others in being a DisCSP or a DisWCSP."""
    usual = Counter(robot.kind for robot in members.robots).most_common(1)
    for robot in members.robots:
        if robot.kind is not usual[0][0]:
            other = next(other for other in members.robots if other.kind is usual[0][0])
            message = f"the robot is a {robot.kind}, but '{other.name}' is a {other.kind}"
            hint = f"a team is one or the other: change the type here or at {members.place(other.name)}"
            yield Diagnostic(robot.file, members.files[robot.name].line, message, hint)


def shared_variables(members: Members) -> Iterator[Diagnostic]:
    """Variables that more than one robot calls its own."""
    for variable, (first, *others) in members.owners.items():
        for other in others:
            message = f"the variable '{shortened(variable)}' is also one of '{first}'"
            hint = f"names of variables are unique in a team: rename it here or at {members.place(first, variable)}"
            yield Diagnostic(members.files[other].robot.file, members.files[other].lines[variable], message, hint)


def _place(entry: Entry) -> str:
    return f"{entry.robot.file}:{entry.line}"
