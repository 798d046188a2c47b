"""Meetings with the names of persons, meetings, days and hours, for players who read: the model `words`.

A robot is a person, as in `peav`, and its variables are its meetings: `Ada.budget` has the value `Mon-9h`, or
`no-meeting`. The working day has eight hours. All constraints are tables or equalities, since times are symbols.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from robochoc.formats import PREDEFINED
from robochoc.model.problem import Constraint, Domain, Relation, Semantics, Variable

if TYPE_CHECKING:
    from robochoc.generators.meetings import Meeting, Meetings

PERSONS = (
    *("Ada", "Ben", "Cleo", "Dan", "Eve", "Finn", "Gina", "Hugo", "Ida", "Jan", "Kim", "Leo", "Mia", "Noah", "Olga"),
    *("Paul", "Rosa", "Sven", "Tina", "Udo", "Vera", "Wim", "Yara", "Zoe"),
)
MEETINGS = (
    *("budget", "design", "hiring", "launch", "planning", "pricing", "review", "roadmap", "safety", "sales", "sprint"),
    *("strategy", "supply", "support", "testing", "training"),
)
DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri")
FIRST_HOUR = 9
HOURS = 8
NO_MEETING = "no-meeting"


def time_of(slot: int) -> str:
    """Return the name of a slot: `Tue-9h` is the ninth one, and `Mon-9h-week2` follows the first Friday."""
    day, hour = divmod(slot - 1, HOURS)
    week, day = divmod(day, len(DAYS))
    return f"{DAYS[day]}-{FIRST_HOUR + hour}h" + (f"-week{week + 1}" if week else "")


def meetings_in_words(problem: Meetings, *, preferences: bool) -> tuple[dict[str, list[Variable]], list[Constraint]]:
    """Return the variables of each robot, and the constraints.

    Args:
        problem: The meetings.
        preferences: True if meetings need not take place, and slots have values.
    """
    symbols = (NO_MEETING, *map(time_of, range(1, problem.slots + 1)))
    attended = {
        person: [meeting for meeting in problem.meetings if person in meeting.worth]
        for person in sorted({person for meeting in problem.meetings for person in meeting.worth})
    }

    def starts(meeting: Meeting) -> Domain:
        values = range(0 if preferences else 1, problem.starts(meeting).stop)
        return Domain(f"hours{meeting.length}", (values,), symbols)

    variables = {
        _name(PERSONS, person): [Variable(_variable(person, meeting), starts(meeting)) for meeting in own]
        for person, own in attended.items()
    }
    return variables, [*_constraints(problem, preferences=preferences)]


def _constraints(problem: Meetings, *, preferences: bool) -> Iterator[Constraint]:
    for meeting in problem.meetings:
        if preferences:
            for person in meeting.worth:
                yield _worth(problem, meeting, person)
        for pair in itertools.combinations(meeting.worth, 2):
            scope = tuple(_variable(person, meeting) for person in pair)
            yield Constraint("together", PREDEFINED["eq"], scope, scope)
    for one, other, shared in problem.rivals():
        for person in shared:
            scope = (_variable(person, one), _variable(person, other))
            rows = tuple(
                (start, then)
                for start, then in itertools.product(problem.starts(one), problem.starts(other))
                if start < then + other.length and then < start + one.length
            )
            overlap = Relation("overlap", 2, Semantics.CONFLICTS, rows)
            yield Constraint("overlap", overlap, scope, scope)


def _worth(problem: Meetings, meeting: Meeting, person: int) -> Constraint:
    rows = tuple((start,) for start in problem.starts(meeting))
    worth = tuple(problem.worth(meeting, person, start) for (start,) in rows)
    name = f"worth-{_name(MEETINGS, meeting.number)}"
    scope = (_variable(person, meeting),)
    return Constraint(name, Relation(name, 1, Semantics.SOFT, rows, worth), scope, scope)


def _variable(person: int, meeting: Meeting) -> str:
    return f"{_name(PERSONS, person)}.{_name(MEETINGS, meeting.number)}"


def _name(names: Sequence[str], number: int) -> str:
    """Return the name with this number, from 1; if there are more numbers than names, the name gets a number."""
    again, place = divmod(number - 1, len(names))
    return names[place] + (str(again + 1) if again else "")
