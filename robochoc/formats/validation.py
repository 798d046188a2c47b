"""Validate teams by the rules of docs/reference/format.md.

The reader of a team has already applied the same rules. A team built in Python, by hand, by a generator or by a
change, is validated before it is solved or written. Valid teams are cached for as long as the objects exist: teams are
immutable, and `dataclasses.replace` creates another object.
"""

from __future__ import annotations

import weakref
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TypeVar

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, MistakeError, shortened
from robochoc.formats.field_types import FIELD_TYPES_HINT, FieldTypeError, check_field_types
from robochoc.formats.locations import Location, ObjectLocations
from robochoc.formats.names import check_integer
from robochoc.formats.robot_rules import (
    NO_ROBOTS_LEFT,
    check_added_constraint,
    check_constraint_of_added_robot,
)
from robochoc.formats.robot_validation import RobotValidator, repeated_robots
from robochoc.formats.symbols import check_argument_types, kinds_by_variable
from robochoc.formats.team_consistency import check_between_robots
from robochoc.formats.team_members import TeamMember, TeamMembers
from robochoc.model.change import ExcessiveChangeError, apply_changes
from robochoc.model.priorities import priority_order
from robochoc.model.problem import AddAgent, AddConstraint, AddValue, Change, RemoveValue, Robot, ScenarioEvent, Team
from robochoc.model.team_edits import ChangeError
from robochoc.system.garbage import collection_paused

_NO_CHANGES = ScenarioEvent(())
_Ended = TypeVar("_Ended")

_valid: dict[int, weakref.ref[Team]] = {}
"""The teams known to be valid, by `id`, since hashing a team would take as long as validating it."""


@collection_paused()
def check_team(team: Team) -> None:
    """Raise `InvalidInputError` with every error in `team`, unless it is valid (docs/reference/format.md).

    The messages are those for files, but contain the robot and its part instead of the file and the line. A team that
    is known to be valid is not validated again.
    """
    if is_known_valid(team):
        return
    found = _team_mistakes(team) or _robot_mistakes(team) or list(_scenario_mistakes(team))
    if found:
        raise InvalidInputError(_numbered(found))
    note_valid(team)


def check_writable(team: Team) -> None:
    """Raise `InvalidInputError` unless `team` is valid, and files can express it.

    Files determine the order only by links, and do not contain `Robot.shown`, which is set by some changes of a team.
    """
    check_team(team)
    found = [
        ObjectLocations(robot.name)
        .robot()
        .mistake(
            f"`shown` contains '{shortened(robot.shown[0])}', which a file cannot express",
            "only changes of a team set `shown`: write the team as it was before",
        )
        for robot in team.robots
        if robot.shown
    ]
    if found:
        raise InvalidInputError(_numbered(found))
    by_links = priority_order({robot.name: [parent.name for parent in robot.parents] for robot in team.robots})
    if by_links != team.order:
        check_team(replace(team, robots=tuple(team[name] for name in by_links)))


def check_robot(robot: Robot) -> None:
    """Raise `InvalidInputError` if `robot` has errors that can be found without its neighbours."""
    found = RobotValidator().mistakes(robot)
    if found:
        raise InvalidInputError(_numbered(found))


def check_event(team: Team, event: ScenarioEvent) -> None:
    """Raise `InvalidInputError` if `event`, intended for `team`, contains invalid robots, constraints or values.

    Changes that are impossible for this team are allowed, because the team may have lost the affected robots.
    """
    place = Location("an event")
    found = list(_type_mistakes(event, ScenarioEvent, place)) or [
        mistake for change in event.changes for mistake in _change_mistakes(_robots(team, event), change, place)
    ]
    found = found or list(_excessive_changes(team, event.changes, place))
    if found:
        raise InvalidInputError(_numbered(found))


def _excessive_changes(team: Team, changes: Iterable[Change], place: Location) -> Iterator[Diagnostic]:
    """Yield changes with numbers that are too large, except changes that are invalid for other reasons."""
    for change in changes:
        try:
            team = apply_changes(team, [change])
        except ExcessiveChangeError as bad:
            yield place.mistake(bad.message, bad.hint)
        except ChangeError:
            continue


def with_checked_events(
    environment: Callable[[Team, _Ended, float | None], ScenarioEvent | None],
) -> Callable[..., ScenarioEvent | None]:
    """Return `environment` with its events validated before they happen."""

    def checked(team: Team, ended: _Ended, left_s: float | None) -> ScenarioEvent | None:
        event = environment(team, ended, left_s)
        if event:
            check_event(team, event)
        return event

    return checked


def note_valid(team: Team) -> None:
    """Record that `team` is valid, after its validation here or by its reader."""
    key = id(team)
    _valid[key] = weakref.ref(team, lambda _: _valid.pop(key, None))


def is_known_valid(team: Team) -> bool:
    """Return whether this object is already known to be valid."""
    known = _valid.get(id(team))
    return known is not None and known() is team


def _numbered(found: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """Yield `found`, with numbers added to equal diagnostics, since two objects may have the same name and scope."""
    seen: Counter[Diagnostic] = Counter()
    for mistake in found:
        seen[mistake] += 1
        yield mistake if seen[mistake] == 1 else replace(mistake, file=f"{mistake.file} (no. {seen[mistake]})")


def _team_mistakes(team: Team) -> list[Diagnostic]:
    """Return the errors that prevent further checks: no robots, or objects of wrong types."""
    given: object = team
    place = Location("the team")
    found = list(_type_mistakes(replace(given, robots=()) if isinstance(given, Team) else given, Team, place))
    if found:
        return found
    place = Location(f"team {shortened(team.name)}")
    robots: object = team.robots
    if not isinstance(robots, tuple):
        return [place.mistake(f"robots: {FieldTypeError(robots, 'a tuple')}", FIELD_TYPES_HINT)]
    try:
        team.name.encode()
    except UnicodeEncodeError:
        return [place.mistake("its name cannot be encoded in UTF-8", "rename it")]
    if not team.robots:
        return [place.mistake("the team has no robots", "add at least one")]
    return []


def _type_mistakes(value: object, kind: type, place: Location) -> Iterator[Diagnostic]:
    try:
        check_field_types(value, kind)
    except FieldTypeError as error:
        yield place.mistake(error.explanation, FIELD_TYPES_HINT)


def _robot_mistakes(team: Team) -> list[Diagnostic]:
    validator = RobotValidator()
    found: list[Diagnostic] = []
    valid: dict[str, TeamMember] = {}
    broken: set[str] = set()
    for robot in team.robots:
        mistakes = validator.mistakes(robot)
        found += mistakes
        name = getattr(robot, "name", None)
        if mistakes and isinstance(name, str):
            broken.add(name)
        elif not mistakes:
            valid.setdefault(robot.name, TeamMember(robot, ObjectLocations(robot.name)))
    named = [robot for robot in team.robots if isinstance(getattr(robot, "name", None), str)]
    repeated = list(repeated_robots(named))
    for name in broken:
        valid.pop(name, None)
    if repeated or len(named) < len(team.robots):
        return [*found, *repeated]
    return [*found, *check_between_robots(TeamMembers(valid, frozenset(broken), team.order))]


# Changes over time


def _scenario_mistakes(team: Team) -> Iterator[Diagnostic]:
    """Yield all errors in the first invalid event. Errors in later events might only be consequences."""
    now = replace(team, scenario=()) if team.scenario else team
    for number, event in enumerate(team.scenario, start=1):
        place = Location(f"event {number} of the scenario")
        found = list(_time_mistakes(event, place))
        for change in event.changes:
            mistakes = list(_change_mistakes(_robots(now), change, place))
            found += mistakes
            if not mistakes:
                try:
                    now = apply_changes(now, [change])
                except ChangeError as bad:
                    found.append(place.mistake(bad.message, bad.hint))
        if not found and not now.robots:
            found.append(place.mistake(*NO_ROBOTS_LEFT))
        if found:
            yield from found
            return


def _time_mistakes(event: ScenarioEvent, place: Location) -> Iterator[Diagnostic]:
    try:
        check_integer(event.after or 0)
    except MistakeError as mistake:
        yield place.mistake(mistake.message, mistake.hint)
    if event.after is not None and event.after < 0:
        yield place.mistake(f"an event after {event.after} messages", "use None, or a number of messages from 0 on")


def _robots(team: Team, event: ScenarioEvent = _NO_CHANGES) -> dict[str, Robot]:
    """Return the robots in `team` and the robots added by `event`, by name."""
    coming = [change.robot for change in event.changes if isinstance(change, AddAgent)]
    return {robot.name: robot for robot in (*team.robots, *coming)}


def _check_symbol(variable: str, value: int, robots: Mapping[str, Robot]) -> None:
    """Raise `MistakeError` if a symbolic variable gets or loses a `value` that is not the code of a symbol."""
    for robot in robots.values():
        for one in robot.variables:
            if one.name == variable and one.domain.symbols and not 0 <= value < len(one.domain.symbols):
                message = f"the value {value} of '{shortened(variable)}' is not the code of a symbol"
                raise MistakeError(message, f"use codes from 0 to {len(one.domain.symbols) - 1}")


def _check_same_places(robot: Robot, robots: Mapping[str, Robot]) -> None:
    """Raise `MistakeError` unless a joining robot has the same unit of costs as the robots in the team."""
    for other in robots.values():
        if other.costs.places != robot.costs.places:
            message = f"'{shortened(robot.name)}' has costs with {robot.costs.places} decimal places"
            raise MistakeError(message, f"'{other.name}' has {other.costs.places}: use one unit of costs in a team")


def _change_mistakes(robots: Mapping[str, Robot], change: Change, place: Location) -> Iterator[Diagnostic]:
    """Yield errors in a change that do not depend on the rest of the team."""
    try:
        match change:
            case AddAgent(robot):
                yield from RobotValidator().mistakes(robot)
                _check_same_places(robot, robots)
                for constraint in robot.shared:
                    check_constraint_of_added_robot(constraint)
            case AddConstraint(agent, _, constraint):
                check_added_constraint(constraint)
                check_argument_types(constraint, kinds_by_variable(robots.values()))
                if agent in robots:
                    yield from RobotValidator().mistakes_of_constraint(constraint, robots[agent])
            case AddValue(variable, value) | RemoveValue(variable, value):
                check_integer(value)
                _check_symbol(variable, value, robots)
            case _:
                pass
    except MistakeError as mistake:
        yield place.mistake(mistake.message, mistake.hint)
