"""Edits of a team that are common to several changes, with checks. Every function returns another team."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

from robochoc.model.absence import DroppedConstraint, broken, restated
from robochoc.model.problem import Child, Constraint, Parent, Robot, Team, Variable, WhenAbsent
from robochoc.system.errors import RobochocError

MAX_SHOWN = 60
"""The maximum length of a name, or of a list, in a message."""


class ChangeError(RobochocError, ValueError):
    """Raised for a change that is impossible for a team.

    Attributes:
        message: The error message.
        hint: A suggestion to the user.
        missing: The missing name, if the error is that the team has no such name.
        line: The line of the error in the file of an added robot. 0: the error is not in a single line.
    """

    def __init__(self, message: str, hint: str, *, missing: str = "", line: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.missing = missing
        self.line = line


def without_robots(team: Team, names: Iterable[str], *, with_files: bool = False) -> Team:
    """Return `team` without the robots `names` and their variables.

    Their shared constraints are restated for the remaining robots, or dropped and listed in `Team.dropped`.

    Args:
        team: The team.
        names: The robots that leave. Names not in the team are ignored.
        with_files: True if the constraints held by these robots are lost too, since no other robot knows them.
    """
    gone = {name for name in names if name in team}
    if not gone:
        return team
    absence = Absence(team, gone, with_files=with_files)
    robots = []
    for robot in team.robots:
        if robot.name not in gone:
            parents = [
                replace(one, constraints=absence.untouched(one.constraints))
                for one in robot.parents
                if one.name not in gone
            ]
            below = [
                replace(one, constraints=absence.untouched(one.constraints), copies=absence.untouched(one.copies))
                for one in robot.children
                if one.name not in gone
            ]
            robots.append(replace(robot, parents=tuple(parents), children=tuple(below)))
    left = replace(team, robots=tuple(robots), dropped=(*team.dropped, *absence.dropped))
    if left.robots:
        for constraint in absence.restated:
            left = with_shared_constraint(left, constraint)
    return keep_needed_interfaces(left)


class Absence:
    """Computes the constraints of `team` without the robots `absent`.

    Attributes:
        restated: The constraints that were restated for the remaining robots.
        dropped: The constraints that were dropped, except private constraints of the absent robots.
    """

    def __init__(self, team: Team, absent: Collection[str], *, with_files: bool = False) -> None:
        self._gone = {variable.name for name in absent if name in team for variable in team[name].variables}
        self.restated: list[Constraint] = []
        self.dropped: list[DroppedConstraint] = []
        self._team = team
        self._rank = {name: place for place, name in enumerate(team.order)}
        for robot in team.robots:
            is_unknown = with_files and robot.name in absent
            for constraint in robot.private if robot.name in absent and not is_unknown else ():
                if constraint.when_absent == WhenAbsent.FAIL or constraint.robots:
                    self._restate_or_drop(constraint)
            for constraint in (*robot.shared, *(part for child in robot.children for part in child.constraints)):
                if self._gone.isdisjoint(constraint.variables):
                    continue
                if is_unknown:
                    self.dropped.append(DroppedConstraint(constraint.name, self._robots(constraint)))
                else:
                    self._restate_or_drop(constraint, robot if with_files else None)

    def _restate_or_drop(self, constraint: Constraint, holder: Robot | None = None) -> None:
        """Restate `constraint`. Drop it if nothing remains, or nothing that mentions the `holder`, if given."""
        left = restated(constraint, self._gone)
        if left is not None and holder is not None and left.when_absent != WhenAbsent.FAIL:
            left = left if any(variable.name in left.variables for variable in holder.variables) else None
        if left is None:
            self.dropped.append(DroppedConstraint(constraint.name, self._robots(constraint)))
        else:
            self.restated.append(replace(left, robots=self._robots(constraint)))

    def _robots(self, constraint: Constraint) -> tuple[str, ...]:
        """Return the robots of `constraint`, including those that left earlier, in priority order."""
        owners = {self._team.owner[name] for name in constraint.variables if name in self._team.owner}
        return constraint.robots or tuple(sorted(owners, key=self._rank.__getitem__))

    def untouched(self, constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        """Return those `constraints` that mention no absent robot."""
        return tuple([one for one in constraints if self._gone.isdisjoint(one.variables)])

    def in_force(self, constraints: Iterable[Constraint]) -> list[Constraint]:
        """Return the `constraints` that mention no absent robot, and all restated constraints."""
        return [*self.untouched(constraints), *self.restated]


def constraints_in_force(team: Team, absent: Collection[str]) -> list[Constraint]:
    """Return the constraints of `team` that stay in force without the robots `absent`."""
    return Absence(team, absent).in_force(team.constraints()) if absent else list(team.constraints())


def dropped_constraints(team: Team, absent: Collection[str]) -> tuple[DroppedConstraint, ...]:
    """Return the constraints dropped because robots in their scopes have left `team` or are in `absent`."""
    before = (one for one in team.dropped if any(name not in team for name in one.robots))
    return (*before, *Absence(team, absent).dropped)


def on_intervals(team: Team) -> Team:
    """Return `team` for a continuous protocol: robots may choose any step of their real variables."""

    def opened(variable: Variable) -> Variable:
        real = variable.domain.real and replace(variable.domain.real, any_step=True)
        return replace(variable, domain=replace(variable.domain, real=real))

    robots = (replace(robot, variables=tuple(map(opened, robot.variables))) for robot in team.robots)
    return replace(team, robots=tuple(robots))


def with_shared_constraint(team: Team, constraint: Constraint) -> Team:
    """Return `team` with `constraint` added to the lowest robot in its scope. It is private if the scope has one robot.

    All robots in the scope are linked to the lowest one. A constraint without robots becomes private to the first robot
    in the team.
    """
    owners = [name for name in team.order if name in {team.owner[name] for name in constraint.variables}]
    if len(owners) <= 1:
        robot = team[owners[0]] if owners else team.robots[0]
        if not owners:
            constraint = broken(constraint, (robot.variables[0].name,))
        return replace_robot(team, replace(robot, private=(*robot.private, replace(constraint, model=None))))
    *_, parent, agent = owners
    for owner in owners[:-1]:
        shown = tuple(name for name in constraint.variables if team.owner[name] == owner)
        team = link(team, agent, owner, shown)
    holder = team[agent]
    parents = (
        replace(one, constraints=(*one.constraints, constraint)) if one.name == parent else one
        for one in holder.parents
    )
    return replace_robot(team, replace(holder, parents=tuple(parents)))


def keep_interfaces(team: Team, before: Team) -> Team:
    """Return `team`, a part of `before`, with the same interface variables of each robot as in `before`."""
    return replace(team, robots=tuple(replace(robot, shown=before[robot.name].interface) for robot in team.robots))


def keep_needed_interfaces(team: Team) -> Team:
    """Return `team` with every variable shown that occurs in a parent's part of a partially known constraint."""
    for robot in team.robots:
        for child in robot.children:
            needed = {name for part in child.constraints for name in part.variables if team.owner[name] == child.name}
            hidden = needed.difference(team[child.name].interface) if needed else ()
            if hidden:
                below = team[child.name]
                team = replace_robot(team, replace(below, shown=(*below.shown, *sorted(hidden))))
    return team


def check_variables_free(team: Team, robot: Robot) -> None:
    """Raise `ChangeError` if a variable of `robot` belongs to another robot of `team`."""
    for variable in robot.variables:
        owner = team.owner.get(variable.name, robot.name)
        if owner != robot.name:
            raise ChangeError(f"the variable {quoted(variable.name)} belongs to {quoted(owner)}", "rename one of them")


def check_holder(team: Team, agent: str, parent: str, constraint: Constraint) -> None:
    """Raise `ChangeError` unless `agent` is the lowest robot of the scope, and `parent` the second lowest."""
    robot_named(team, agent), robot_named(team, parent)
    if agent == parent:
        raise ChangeError(f"{quoted(agent)} cannot be its own parent", "share the constraint with another robot")
    for name in constraint.variables:
        check_variable(team, name)
    owners = {team.owner[name] for name in constraint.variables}
    what = quoted(constraint.name)
    if agent not in owners or parent not in owners:
        message = f"the scope of {what} lacks variables of {quoted(agent)} or {quoted(parent)}"
        raise ChangeError(message, "add variables of both")
    *_, above, lowest = (name for name in team.order if name in owners)
    if (above, lowest) != (parent, agent):
        hint = f"add it to the lowest robot of its scope, {quoted(lowest)}, under the second lowest, {quoted(above)}"
        raise ChangeError(f"{what} does not belong to {quoted(agent)} under {quoted(parent)}", hint)


def link(team: Team, child: str, parent: str, variables: tuple[str, ...]) -> Team:
    """Return `team` with a link between `parent` and `child`. `parent` also shows `variables` to the child."""
    below, above = team[child], team[parent]
    if not any(one.name == parent for one in below.parents):
        below = replace(below, parents=(*below.parents, Parent(parent)))
    if not any(one.name == child for one in above.children):
        above = replace(above, children=(*above.children, Child(child)))
    children = (
        replace(one, variables=tuple(dict.fromkeys((*one.variables, *variables)))) if one.name == child else one
        for one in above.children
    )
    return replace_robot(replace_robot(team, below), replace(above, children=tuple(children)))


def check_variable(team: Team, variable: str) -> None:
    """Raise `ChangeError` unless a robot of `team` has `variable`."""
    if variable not in team.owner:
        hint = "name a variable of the robots in the team"
        raise ChangeError(f"no robot has the variable {quoted(variable)}", hint, missing=variable)


def replace_robot(team: Team, robot: Robot) -> Team:
    """Return `team` with `robot` in place of the robot with the same name."""
    return replace(team, robots=tuple(robot if one.name == robot.name else one for one in team.robots))


def robot_named(team: Team, name: str) -> Robot:
    """Return the robot called `name`. Raises `ChangeError` if there is no such robot."""
    if name not in team:
        raise no_robot(name)
    return team[name]


def no_robot(name: str, line: int = 0) -> ChangeError:
    """Return the error that the team has no robot called `name`."""
    hint = "name a robot of the team at that time"
    return ChangeError(f"there is no robot {quoted(name)}", hint, missing=name, line=line)


def quoted(name: str) -> str:
    """Return `name` in quotes, shortened for a message."""
    return f"'{shortened(name)}'"


def shortened(text: str) -> str:
    """Return `text`, truncated to fit into a message."""
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."
