"""Check shared constraints against the robots of their scopes.

docs/reference/format.md, "One robot" on n-ary constraints, and "The team".
"""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.formats.diagnostics import Diagnostic, shortened, suggestion
from robochoc.formats.team_members import TeamMembers
from robochoc.model.problem import Constraint, ConstraintModel, Parent, Robot


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
