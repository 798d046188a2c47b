"""The facts about an imported team shown on pages. They are computed when the team is opened, and saved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import islice

import msgspec

from robochoc.app.texts import say
from robochoc.flight.crafts import row_and_column
from robochoc.model.change import team_after_events
from robochoc.model.orders import constraint_graph
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    ConstraintModel,
    Domain,
    ProblemKind,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Team,
)
from robochoc.model.uncertainty import is_uncertain, random_variables

MOST_VARIABLES = 20_000
"""The maximum number of decisions listed with their robots."""
MOST_LINKS = 400
MOST_EVENTS = 100
MOST_CHANGES = 12
"""The maximum number of changes listed for an event."""
_MOST_RANGES = 8
_LONGEST_VALUES = 160
_LONGEST_NOTE = 400
_MOST_NOTES = 100


class Decides(msgspec.Struct, frozen=True):
    """A decision: the variable's name, the number of its values, and the values in words."""

    variable: str
    size: int
    values: str


class RobotFacts(msgspec.Struct, frozen=True):
    """A robot.

    Attributes:
        name: The robot's name.
        decides: The robot's decisions.
        weight: The weight of the robot's withdrawal.
        joins: True if the robot joins later.
    """

    name: str
    decides: tuple[Decides, ...]
    weight: int = 1
    joins: bool = False


class ImportedFacts(msgspec.Struct, frozen=True):
    """The facts about a team.

    Attributes:
        robots: The team's robots in order, followed by robots that join later.
        last: The robots after all events.
        variables: The number of decisions.
        constraints: The number of constraints at the start.
        private: The number of constraints that concern a single robot.
        partial: The number of parts of partially known constraints.
        links: The pairs of robots with a common constraint, up to a maximum number.
        linked: The number of all such pairs.
        costs: True if there are costs.
        maximised: True if costs are utilities, whose sum is maximised.
        objectives: The names of several objectives; empty if there is a single cost.
        events: The events in words.
        flies: True if the team's files contain positions of robots.
        files: For a team that was drawn here, the files that were changed later; otherwise empty.
        notes: The changes made by the import.
        origin: The name of the opened file.
    """

    robots: tuple[RobotFacts, ...]
    last: tuple[str, ...]
    variables: int
    constraints: int
    private: int = 0
    partial: int = 0
    links: tuple[tuple[str, str], ...] = ()
    linked: int = 0
    costs: bool = False
    maximised: bool = False
    objectives: tuple[str, ...] = ()
    events: tuple[str, ...] = ()
    flies: bool = False
    files: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    origin: str = ""

    @property
    def there(self) -> tuple[RobotFacts, ...]:
        """The robots at the start."""
        return tuple(robot for robot in self.robots if not robot.joins)


def facts_of(team: Team, *, files: Sequence[str] = (), notes: Sequence[str] = (), origin: str = "") -> ImportedFacts:
    """Return the facts about a team. See `ImportedFacts` for the other arguments."""
    constraints = [*team.constraints()]
    graph = constraint_graph(team)
    links = [(one, other) for one in team.order for other in graph[one] if one < other]
    return ImportedFacts(
        robots=tuple(_robots(team)),
        last=team_after_events(team, len(team.scenario)).order,
        variables=len(team.variables),
        constraints=len(constraints),
        private=sum(len(robot.private) for robot in team.robots),
        partial=sum(one.model == ConstraintModel.PKC for one in constraints),
        links=tuple(links[:MOST_LINKS]),
        linked=len(links),
        costs=team.kind == ProblemKind.DISWCSP,
        maximised=bool(team.robots) and team.robots[0].costs.maximize,
        objectives=team.objectives,
        events=events_in_words(team),
        flies=bool(team.robots) and all(map(has_place, team.robots)),
        files=tuple(files),
        notes=tuple(note[:_LONGEST_NOTE] for note in [*_random(team), *notes][:_MOST_NOTES]),
        origin=origin,
    )


def _random(team: Team) -> Iterator[str]:
    """Yield a sentence for each random variable of a team."""
    for one in random_variables(team) if is_uncertain(team) else ():
        weighted = zip(one.outcomes, one.weights, strict=True)
        chances = ", ".join(f"{value} ({Decimal(weight).scaleb(-one.places):f})" for value, weight in weighted)
        later = say("imported.observed", names=", ".join(one.seen_by)) if one.seen_by else ""
        yield say("imported.random", name=one.name, chances=chances) + later


def events_in_words(team: Team) -> tuple[str, ...]:
    """Return a sentence for each event in a team's scenario, up to a maximum number."""
    return tuple(_events(team.scenario, domains_of(team) if team.scenario else {}))


def all_robots(team: Team) -> list[Robot]:
    """Return a team's robots in order, followed by robots that join later, without duplicates."""
    joining = (change.robot for event in team.scenario for change in event.changes if isinstance(change, AddAgent))
    found = {robot.name: robot for robot in team.robots}
    for robot in joining:
        found.setdefault(robot.name, robot)
    return [*found.values()]


def domains_of(team: Team) -> dict[str, Domain]:
    """Return the domains of all variables, including those of robots that join later."""
    return {one.name: one.domain for robot in all_robots(team) for one in robot.variables}


def _robots(team: Team) -> Iterator[RobotFacts]:
    left = MOST_VARIABLES
    for robot in all_robots(team):
        own = robot.variables[:left]
        left -= len(own)
        decides = tuple(Decides(one.name, len(one.domain), _values(one.domain)) for one in own)
        yield RobotFacts(robot.name, decides, robot.weight, joins=robot.name not in team)


def _values(domain: Domain) -> str:
    """Return the values of a decision in short form: `1..4, 7`."""
    if domain.symbols:
        text = ", ".join(str(domain.label(value)) for value in islice(domain, _LONGEST_VALUES))
    else:
        parts = domain.ranges[:_MOST_RANGES]
        text = ", ".join(f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0]) for part in parts)
        text += ", …" if len(domain.ranges) > _MOST_RANGES else ""
    return text if len(text) <= _LONGEST_VALUES else f"{text[: _LONGEST_VALUES - 1]}…"


def has_place(robot: Robot) -> bool:
    """Return whether a robot has a position: in a topic, or in its name, such as `Robot3.1`."""
    text = any(coordinate is not None for topic in robot.topics for coordinate in (topic.x, topic.y, topic.z))
    return text or row_and_column(robot.name) is not None


def _events(scenario: Sequence[ScenarioEvent], domains: Mapping[str, Domain]) -> Iterator[str]:
    for event in scenario[:MOST_EVENTS]:
        when = (
            say("imported.when-decided") if event.after is None else say("imported.when-sent", count=f"{event.after:,}")
        )
        words = [_change_words(change, domains) for change in event.changes[:MOST_CHANGES]]
        if (more := len(event.changes) - len(words)) > 0:
            words.append(say("imported.more-changes", count=f"{more:,}"))
        yield f"{when} {'; '.join(words)}."


def _change_words(change: Change, domains: Mapping[str, Domain]) -> str:
    match change:
        case RemoveAgent(name):
            return say("imported.leaves", robot=name)
        case AddAgent(robot):
            return say("imported.comes", robot=robot.name)
        case RemoveValue(variable, value):
            return say("imported.loses", variable=variable, value=domains[variable].label(value))
        case AddValue(variable, value):
            return say("imported.gains", variable=variable, value=domains[variable].label(value))
        case AddConstraint(agent, parent, constraint):
            return say("imported.binds", one=parent, other=agent, name=constraint.name)
        case RemoveConstraint(agent, parent, name):
            return say("imported.frees", one=parent, other=agent, name=name)
