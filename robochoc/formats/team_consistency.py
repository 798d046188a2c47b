"""Check that the robots of a team are consistent: their neighbours, costs, variables and shared constraints.

docs/reference/format.md, "The team", and "One robot" on n-ary constraints.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice

from robochoc.formats.diagnostics import Diagnostic, shortened, suggestion
from robochoc.formats.objectives import mixed_objectives
from robochoc.formats.random_variables import differing_random_variables
from robochoc.formats.symbols import different_tables, mistyped_constraints
from robochoc.formats.team_members import TeamMembers
from robochoc.formats.tkc_copies import differing_copies
from robochoc.model.magnitudes import MagnitudeError, Magnitudes
from robochoc.model.priorities import CycleError, priority_order
from robochoc.model.problem import Constraint, ConstraintModel, Parent, Robot

MAX_BETWEEN = 1000
"""The maximum number of reported errors between the robots of a team."""


def check_between_robots(members: TeamMembers) -> list[Diagnostic]:
    """Return the errors between the robots of a team."""
    return list(islice(_between(members), MAX_BETWEEN))


def _between(members: TeamMembers) -> Iterator[Diagnostic]:
    yield from missing_robots(members)
    yield from disagreements(members)
    yield from cycles(members)
    yield from out_of_order(members)
    yield from mixed_kinds(members)
    yield from mixed_costs(members)
    yield from mixed_objectives(members)
    yield from shared_variables(members)
    yield from differing_random_variables(members)
    yield from different_tables(members)
    yield from mistyped_constraints(members)
    scopes = list(misplaced_constraints(members))
    yield from scopes
    yield from misplaced_parts(members)
    yield from missing_shown_variables(members)
    yield from excessive_numbers(members)
    yield from differing_copies(members, {mistake.file for mistake in scopes})


def missing_robots(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield neighbours that are missing in the team."""
    known = dict.fromkeys([*members.files, *sorted(members.broken)])
    for entry in members.entries.values():
        if entry.other not in known:
            name = shortened(entry.other)
            absent, step = members.files[entry.robot.name].places.absent(name)
            hint = f"{step}; {suggestion(name, known, 'robots')}"
            yield entry.place.mistake(f"the {entry.role} '{name}' {absent}", hint)


def disagreements(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield pairs of neighbours that disagree about which of them is the parent."""
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
    """Yield cycles of parents. No two cycles have a common link."""
    if members.priority is not None:
        return
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
            hint = f"delete one of these parents: here, or at {elsewhere}"
            yield links[0].place.mistake(f"the parents form a cycle: {error}", hint)
        else:
            return


def mixed_kinds(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots whose kind of problem (DisCSP or DisWCSP) differs from that of most other robots."""
    usual = Counter(robot.kind for robot in members.robots).most_common(1)
    for robot in members.robots:
        if robot.kind is not usual[0][0]:
            other = next(other for other in members.robots if other.kind is usual[0][0])
            message = f"the robot is a {robot.kind}, but '{other.name}' is a {other.kind}"
            hint = f"a team has one kind of problem: change the type here or at {members.place(other.name)}"
            yield members.place(robot.name).mistake(message, hint)


def mixed_costs(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots whose objective or unit of costs differs from that of most other robots."""
    usual = Counter((robot.costs.maximize, robot.costs.places) for robot in members.robots).most_common(1)
    for robot in members.robots:
        maximize, places = robot.costs.maximize, robot.costs.places
        if (maximize, places) == usual[0][0]:
            continue
        other = next(one for one in members.robots if (one.costs.maximize, one.costs.places) == usual[0][0])
        if maximize is not other.costs.maximize:
            message = f"the robot {_objective(robot)} costs, but '{other.name}' {_objective(other)} them"
            hint = f"a team has one objective: change it here or at {members.place(other.name)}"
        else:
            message = f"costs with {places} decimal places, but '{other.name}' has {other.costs.places}"
            hint = "use one unit of costs for all robots of the team"
        yield members.place(robot.name).mistake(message, hint)


def _objective(robot: Robot) -> str:
    return "maximizes" if robot.costs.maximize else "minimizes"


def shared_variables(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield variables that several robots own."""
    for variable, (first, *others) in members.owners.items():
        for other in others:
            message = f"the variable '{shortened(variable)}' belongs to '{first}' too"
            hint = f"names of variables are unique in a team: rename it here or at {members.place(first, variable)}"
            yield members.place(other, variable).mistake(message, hint)


def out_of_order(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots that precede one of their parents in the order of a team built in Python."""
    rank = {name: place for place, name in enumerate(members.order)}
    if not members.ranks:
        return  # the links themselves are invalid
    for name, parents in members.agreed.items() if rank else ():
        late = next((parent for parent in parents if rank[parent] > rank[name]), None)
        if late is not None:
            message = f"the robot precedes its parent '{late}' in the team"
            hint = "list robots in priority order, parents before their children"
            yield members.place(name).mistake(message, hint)


def misplaced_constraints(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield constraints listed under the wrong robot or under the wrong parent."""
    for robot in members.robots:
        if members.has_all_parents(robot.name):
            near = {robot.name, *members.agreed[robot.name]}
            for parent in robot.parents:
                for constraint in parent.constraints:
                    mistake = _unrelated_variable(members, near, parent, constraint)
                    mistake = mistake or _wrong_parent(members, robot, parent, constraint)
                    if mistake:
                        yield members.files[robot.name].places.constraint(constraint).mistake(*mistake)


def _unrelated_variable(
    members: TeamMembers, near: set[str], parent: Parent, constraint: Constraint
) -> tuple[str, str] | None:
    """Return the error if a variable in the scope belongs to no robot in `near`, the robot and its parents."""
    for name in constraint.variables:
        owners = members.owners.get(name, [])
        if not owners and not members.broken:
            known = members.own[parent.name]
            hint = f"{suggestion(name, known, 'variables')} ({members.place(parent.name)})"
            return f"no robot has the variable '{shortened(name)}'", hint
        if len(owners) == 1 and owners[0] not in near:
            message = f"the variable '{name}' belongs to '{owners[0]}', which is not a parent of this robot"
            hint = "list a constraint with the lowest robot of its scope, and all others as parents of that robot"
            return message, f"{hint} ({members.place(owners[0], name)})"
    return None


def _wrong_parent(members: TeamMembers, robot: Robot, parent: Parent, constraint: Constraint) -> tuple[str, str] | None:
    """Return the error if the constraint does not belong under `parent`."""
    found = [members.owners.get(name, []) for name in constraint.variables]
    if any(len(owners) != 1 for owners in found):
        return None  # reported as another error
    others = {owners[0] for owners in found} - {robot.name}
    if parent.name not in others:
        message = f"the scope has no variable of the parent '{parent.name}', under which the constraint is listed"
        return message, f"move it to '{min(others)}'; '{parent.name}' is at {members.place(parent.name)}"
    if constraint.model == ConstraintModel.PKC and len(others) > 1:
        message = "a PKC constraint over more than two robots"
        return message, f"only '{robot.name}' and '{parent.name}' ({members.place(parent.name)}) can share its parts"
    lowest = [max(others, key=rank.__getitem__) for rank in members.ranks]
    if lowest and parent.name not in lowest:
        message = f"the constraint is listed under '{parent.name}', but the lowest parent of its scope is '{lowest[0]}'"
        return message, f"move it to '{lowest[0]}' ({members.place(lowest[0])})"
    return None


def misplaced_parts(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield parents' parts of PKCs with variables of third robots, or with variables that the child does not show."""
    for robot in members.robots:
        for child in robot.children:
            if members.is_parent(robot.name, child.name):
                for part in child.constraints:
                    mistake = _third_variable(members, robot, child.name, part)
                    mistake = mistake or _hidden_variable(members, child.name, part)
                    if mistake:
                        yield members.files[robot.name].places.constraint(part).mistake(*mistake)


def _third_variable(members: TeamMembers, robot: Robot, child: str, part: Constraint) -> tuple[str, str] | None:
    """Return the error if a variable in the part belongs to neither of the two robots."""
    own, others = members.own[robot.name], members.own[child]
    for name in part.variables:
        if name not in own and name not in others:
            hint = f"{suggestion(name, others, 'variables')} ({members.place(child)})"
            return f"'{shortened(name)}' is not a variable of '{robot.name}' or '{child}'", hint
    return None


def _hidden_variable(members: TeamMembers, child: str, part: Constraint) -> tuple[str, str] | None:
    """Return the error if the parent's part contains a variable that `child` shows to no robot."""
    if members.broken:
        return None
    robot = members.files[child].robot
    below = (members.needed(child, other.name) for other in robot.children if other.name in members.files)
    shown = {*robot.interface}.union(*below)
    for name in part.variables:
        if name in members.own[child] and name not in shown:
            message = f"the part contains '{shortened(name)}', which '{child}' shows to no robot"
            return message, f"add the part of '{child}' to its file as well ({members.place(child, name)})"
    return None


def missing_shown_variables(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield variables that a child's constraints need but the parent's file does not list for the child."""
    for robot in members.robots:
        for child in robot.children:
            if (
                members.is_parent(robot.name, child.name)
                and child.name not in members.files[robot.name].implied_children
            ):
                needed = members.needed(robot.name, child.name)
                lacking = [name for name in needed if name not in child.variables]
                if lacking:
                    message = f"the child '{child.name}' must also know {shortened(' '.join(lacking))}"
                    where = members.files[child.name].places.constraint(needed[lacking[0]])
                    hint = f'write variable="{shortened(" ".join([*child.variables, *lacking]))}", as {where} needs it'
                    yield members.files[robot.name].places.neighbour(child).mistake(message, hint)


def excessive_numbers(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield constraints whose expressions may reach numbers that are too large."""
    domains = {variable.name: variable.domain for robot in members.robots for variable in robot.variables}
    magnitudes = Magnitudes(domains, max((robot.costs.places for robot in members.robots), default=0))
    for member in members.files.values():
        for constraint in member.robot.constraints():
            try:
                magnitudes.check(constraint)
            except MagnitudeError as error:
                yield member.places.constraint(constraint).mistake(error.message, error.hint)
