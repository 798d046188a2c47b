"""The robots of a team, read from files or built in Python, with data shared by several checks of the team."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from enum import StrEnum
from functools import cached_property

from robochoc.formats.locations import Location, Locations
from robochoc.model.priorities import CycleError, priority_order
from robochoc.model.problem import Child, Constraint, Parent, Robot
from robochoc.system.lazy_dataclass import dataclass


class NeighbourRole(StrEnum):
    """The role of a neighbour: parent or child."""

    PARENT = "parent"
    CHILD = "child"

    @property
    def opposite(self) -> NeighbourRole:
        """Return the robot's role from the neighbour's point of view."""
        return NeighbourRole.CHILD if self == NeighbourRole.PARENT else NeighbourRole.PARENT


@dataclass(frozen=True)
class TeamMember:
    """A robot with the locations of its parts, and further data from its file."""

    robot: Robot
    places: Locations
    copies: Mapping[str, tuple[Constraint, ...]] = field(default_factory=dict)
    """By child: copies of its TKC constraints, which the original platform's files also list with the parent."""
    implied_children: frozenset[str] = frozenset()
    """Children without the attribute `variable`. The variables that they must know follow from the scopes."""


@dataclass(frozen=True)
class NeighbourEntry:
    """The entry of a neighbour: a line in a robot's file, or an object."""

    robot: Robot
    other: str
    role: NeighbourRole
    place: Location


@dataclass(frozen=True)
class TeamMembers:
    """The valid robots of a team.

    `broken` contains the robots that are invalid by themselves. Checks that need these robots are skipped, so that no
    error is reported twice. `order` is the order of the robots in a team built in Python; without it, the order follows
    from the links.
    """

    files: Mapping[str, TeamMember]
    broken: frozenset[str]
    order: tuple[str, ...] = ()

    @property
    def robots(self) -> Iterator[Robot]:
        """The valid robots."""
        return (file.robot for file in self.files.values())

    @cached_property
    def entries(self) -> dict[tuple[str, str], NeighbourEntry]:
        """The entries of neighbours, by the names of the two robots."""
        return {
            (name, neighbour.name): NeighbourEntry(
                member.robot, neighbour.name, role, member.places.neighbour(neighbour)
            )
            for name, member in self.files.items()
            for role, neighbour in _listed(member.robot)
        }

    def is_parent(self, parent: str, child: str) -> bool:
        """Return whether both robots are valid, and agree that `parent` is a parent of `child`."""
        below, above = self.entries.get((parent, child)), self.entries.get((child, parent))
        return (
            below is not None
            and above is not None
            and below.role == NeighbourRole.CHILD
            and above.role == NeighbourRole.PARENT
        )

    @cached_property
    def agreed(self) -> dict[str, list[str]]:
        """The parents of each robot, limited to parents that list it as a child."""
        return {
            robot.name: [parent.name for parent in robot.parents if self.is_parent(parent.name, robot.name)]
            for robot in self.robots
        }

    @cached_property
    def priority(self) -> tuple[str, ...] | None:
        """The priority order that follows from the links; None if they form a cycle."""
        try:
            return priority_order(self.agreed)
        except CycleError:
            return None

    def has_all_parents(self, name: str) -> bool:
        """Return whether every parent of `name` is valid and lists it as a child."""
        return len(self.agreed[name]) == len(self.files[name].robot.parents)

    @cached_property
    def owners(self) -> dict[str, list[str]]:
        """The robots that own each variable. More than one owner is an error."""
        owners: dict[str, list[str]] = {}
        for robot in self.robots:
            for variable in robot.variables:
                owners.setdefault(variable.name, []).append(robot.name)
        return owners

    @cached_property
    def ranks(self) -> tuple[Mapping[str, int], ...]:
        """Each robot's index in the priority order; empty if errors leave the order unknown.

        Several orders may respect the links. The first is the one computed by readers of files, the second is `order`.
        """
        if self.broken or not all(self.has_all_parents(name) for name in self.files):
            return ()
        if self.priority is None:
            return ()
        orders = {self.priority, self.order or self.priority}
        return tuple({name: place for place, name in enumerate(order)} for order in orders)

    @cached_property
    def own(self) -> dict[str, dict[str, None]]:
        """The variables of each robot."""
        return {robot.name: dict.fromkeys(variable.name for variable in robot.variables) for robot in self.robots}

    @cached_property
    def _used(self) -> dict[str, dict[str, Constraint]]:
        """For each robot, the variables in its shared constraints, each with the first constraint that uses it."""
        used: dict[str, dict[str, Constraint]] = {}
        for robot in self.robots:
            first = used[robot.name] = {}
            for constraint in robot.shared:
                for variable in constraint.variables:
                    first.setdefault(variable, constraint)
        return used

    def needed(self, parent: str, child: str) -> dict[str, Constraint]:
        """Return the variables of `parent` in shared constraints of `child`, each with the first such constraint."""
        used = self._used[child]
        return {variable: used[variable] for variable in self.own[parent] if variable in used}

    def place(self, robot: str, variable: str = "") -> Location:
        """Return the location of a robot, or of a variable of the robot, for a message about two robots."""
        places = self.files[robot].places
        return places.variable(variable) if variable else places.robot()


def _listed(robot: Robot) -> Iterator[tuple[NeighbourRole, Parent | Child]]:
    for parent in robot.parents:
        yield NeighbourRole.PARENT, parent
    for child in robot.children:
        yield NeighbourRole.CHILD, child
