"""Check the members of a team and their parents: the statements of two robots about each other.

docs/reference/format.md, "The team".
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from robochoc.formats.diagnostics import Diagnostic, shortened, suggestion
from robochoc.formats.team_members import TeamMembers
from robochoc.model.magnitudes import MagnitudeError, Magnitudes
from robochoc.model.priorities import CycleError, priority_order
from robochoc.model.problem import Constraint, ConstraintModel, Parent, Robot


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


def misplaced_constraints(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield constraints with parents whose scopes do not fit the place where they stand."""
    for robot in members.robots:
        if members.has_all_parents(robot.name):
            near = {robot.name, *members.agreed[robot.name]}
            for parent in robot.parents:
                for constraint in parent.constraints:
                    mistake = _foreign(members, near, parent, constraint) or _place(members, robot, parent, constraint)
                    if mistake:
                        yield members.files[robot.name].places.constraint(constraint).mistake(*mistake)


def _foreign(members: TeamMembers, near: set[str], parent: Parent, constraint: Constraint) -> tuple[str, str] | None:
    """Return a variable in the scope that belongs to no robot in `near` (itself and its parents), if there is one."""
    for name in constraint.variables:
        owners = members.owners.get(name, [])
        if not owners and not members.broken:
            known = members.own[parent.name]
            hint = f"{suggestion(name, known, 'variables')} ({members.place(parent.name)})"
            return f"no robot has the variable '{shortened(name)}'", hint
        if len(owners) == 1 and owners[0] not in near:
            message = f"the variable '{name}' belongs to '{owners[0]}', which is no parent of this robot"
            hint = "a constraint stands with the lowest robot of its scope, and the others are parents of that"
            return message, f"{hint} ({members.place(owners[0], name)})"
    return None


def _place(members: TeamMembers, robot: Robot, parent: Parent, constraint: Constraint) -> tuple[str, str] | None:
    """Return why the constraint should not stand under `parent`, if so."""
    found = [members.owners.get(name, []) for name in constraint.variables]
    if any(len(owners) != 1 for owners in found):
        return None  # another mistake, which is reported elsewhere
    others = {owners[0] for owners in found} - {robot.name}
    if parent.name not in others:
        message = f"the scope has no variable of the parent '{parent.name}', under which it stands"
        return message, f"move it to '{min(others)}'; '{parent.name}' is {members.place(parent.name)}"
    if constraint.model == ConstraintModel.PKC and len(others) > 1:
        message = "a PKC constraint over more than two robots"
        return message, f"only '{robot.name}' and '{parent.name}' ({members.place(parent.name)}) can share its parts"
    lowest = [max(others, key=rank.__getitem__) for rank in members.ranks]
    if lowest and parent.name not in lowest:
        message = f"the constraint stands under '{parent.name}', the lowest parent of its scope is '{lowest[0]}'"
        return message, f"move it to '{lowest[0]}' ({members.place(lowest[0])})"
    return None


def misplaced_parts(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield parents' parts of PKCs with variables of third robots, or with variables that the child does not show."""
    for robot in members.robots:
        for child in robot.children:
            if members.is_parent(robot.name, child.name):
                for part in child.constraints:
                    mistake = _foreign_to_both(members, robot, child.name, part) or _unshown(members, child.name, part)
                    if mistake:
                        yield members.files[robot.name].places.constraint(part).mistake(*mistake)


def _foreign_to_both(members: TeamMembers, robot: Robot, child: str, part: Constraint) -> tuple[str, str] | None:
    own, others = members.own[robot.name], members.own[child]
    for name in part.variables:
        if name not in own and name not in others:
            hint = f"{suggestion(name, others, 'variables')} ({members.place(child)})"
            return f"'{shortened(name)}' is no variable of '{robot.name}' or '{child}'", hint
    return None


def _unshown(members: TeamMembers, child: str, part: Constraint) -> tuple[str, str] | None:
    """Return the mistake that the parent's part has a variable which `child` shows to no robot."""
    if members.broken:
        return None
    robot = members.files[child].robot
    below = (members.needed(child, other.name) for other in robot.children if other.name in members.files)
    shown = {*robot.interface}.union(*below)
    for name in part.variables:
        if name in members.own[child] and name not in shown:
            message = f"the part looks at '{shortened(name)}', which '{child}' shows to nobody"
            return message, f"let '{child}' hold its part of the PKC as well ({members.place(child, name)})"
    return None


def missing_shown_variables(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield variables that a child's constraints need, and that its parent's file does not name for it."""
    for robot in members.robots:
        for child in robot.children:
            if members.is_parent(robot.name, child.name) and child.name not in members.files[robot.name].unsaid:
                needed = members.needed(robot.name, child.name)
                lacking = [name for name in needed if name not in child.variables]
                if lacking:
                    message = f"the child '{child.name}' must also know {shortened(' '.join(lacking))}"
                    where = members.files[child.name].places.constraint(needed[lacking[0]])
                    hint = f'write variable="{shortened(" ".join([*child.variables, *lacking]))}", as {where} needs it'
                    yield members.files[robot.name].places.neighbour(child).mistake(message, hint)


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
