"""Meetings: a distributed multi-event scheduling problem (DiMES), with time slots or events as variables.

Maheswaran, Tambe, Bowring, Pearce and Varakantham, "Taking DCOP to the real world: efficient complete solutions for
distributed multi-event scheduling", AAMAS 2004. For each person, free slots have values, and so have the slots of the
person's meetings. A meeting needs all its participants at the same time, in consecutive slots; no person is in two
meetings at once. Meetings need not take place. The maximised utility is a sum over the participants and slots of all
meetings that take place: the value of the meeting minus the value of the free slot.

The three models of the paper, with the same maximum:

* `peav` (private events as variables): a robot is a person, with a variable for each of its meetings: the slot in which
  the meeting starts, or 0 if it does not take place. The values of meetings and slots stay private. All participants
  in a meeting have equal values of its variables.
* `eav` (events as variables): a robot is a meeting with one variable. Its utility is the sum over its participants.
  Meetings with a common participant do not overlap.
* `tsav` (time slots as variables): a robot is a person, with a variable for each slot: 0 if the slot is free, or a part
  of one of its meetings. A part is as long as a slot, and parts follow each other.

The model `words` is `peav` with names (`generators/meetings_in_words.py`).

Without preferences, all meetings must take place, and the problem is a DisCSP.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from random import Random
from typing import assert_never

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import (
    MAX_AGENTS,
    MAX_COST,
    MAX_VALUES,
    check_bounds,
    limited,
    random_integer,
    sample,
    seeded,
)
from robochoc.generators.meetings_in_words import meetings_in_words
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.expression import Type, parse
from robochoc.model.problem import Constraint, Domain, Predicate, ProblemKind, Relation, Semantics, Team, Variable
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.suggestions import member

_TERMS = ("X", "Y", "i", "j")
ONE_AFTER_THE_OTHER = Predicate(
    "apart", _TERMS, parse("or(eq(X, 0), eq(Y, 0), ge(Y, add(X, i)), ge(X, add(Y, j)))", _TERMS, Type.BOOLEAN)
)
"""Meetings that start in the slots X and Y, i and j slots long, do not overlap. The slot 0 means no meeting."""
AT_ONE_TIME = Predicate(
    "together",
    _TERMS,
    parse("or(eq(X, Y), and(or(lt(X, i), gt(X, j)), or(lt(Y, i), gt(Y, j))))", _TERMS, Type.BOOLEAN),
)
"""If X or Y, the same slot of two persons, is one of the parts i to j of a meeting, X and Y are equal."""
IN_A_ROW = Predicate(
    "next",
    _TERMS,
    parse("or(eq(Y, add(X, 1)), and(or(lt(X, i), ge(X, j)), or(le(Y, i), gt(Y, j))))", _TERMS, Type.BOOLEAN),
)
"""In two consecutive slots, X and Y, the parts i to j of a meeting follow each other."""
ONCE = Predicate("once", ("X", "Y"), parse("or(eq(X, 0), ne(X, Y))", ("X", "Y"), Type.BOOLEAN))
"""No part of a meeting is in two slots."""


class MeetingsModel(StrEnum):
    """The meaning of a variable: a person's meeting, a meeting, or a person's slot."""

    PEAV = "peav"
    EAV = "eav"
    TSAV = "tsav"
    WORDS = "words"


@dataclass(frozen=True)
class Meeting:
    """A meeting: its number, its value per slot for each participant, and its length in slots."""

    number: int
    worth: Mapping[int, int]
    length: int


@dataclass(frozen=True)
class Meetings:
    """A meeting scheduling problem.

    Attributes:
        slots: The number of slots, which are numbered from 1.
        free: The value of each slot if it stays free, by person.
        meetings: The meetings.
    """

    slots: int
    free: Mapping[int, Sequence[int]]
    meetings: Sequence[Meeting]

    def starts(self, meeting: Meeting) -> range:
        """Return the slots in which `meeting` can start."""
        return range(1, self.slots - meeting.length + 2)

    def worth(self, meeting: Meeting, person: int, start: int) -> int:
        """Return the utility of a participant if `meeting` begins in the slot `start`."""
        lost = sum(self.free[person][start - 1 : start - 1 + meeting.length])
        return meeting.worth[person] * meeting.length - lost

    def rivals(self) -> Iterator[tuple[Meeting, Meeting, list[int]]]:
        """Yield all pairs of meetings with common participants, and these participants."""
        for one, other in itertools.combinations(self.meetings, 2):
            shared = [person for person in one.worth if person in other.worth]
            if shared:
                yield one, other, shared


def meetings(
    agents: int,
    meetings: int,
    participants: int,
    slots: int,
    seed: int = 0,
    *,
    max_length: int = 1,
    max_value: int | None = 10,
    model: MeetingsModel | str = MeetingsModel.PEAV,
) -> Team:
    """Return a random problem of scheduling `meetings` with `participants` each.

    In `peav`, `Robot3` is a person, and `V3.2` is the start of meeting 2 for this person; there are no robots for
    persons without meetings. In `eav`, `Meeting2` owns `V2`. In `tsav`, `V3.2` is the part of a meeting in slot 2 of
    `Robot3`, where the parts of all meetings are numbered consecutively from 1. In `words`, `Ada.budget` is the time of
    a meeting for the robot `Ada`.

    Args:
        agents: The number of persons.
        meetings: The number of meetings.
        participants: The number of persons in each meeting, chosen uniformly at random.
        slots: The number of time slots.
        seed: The same seed gives the same problem on every machine, in all models.
        max_length: The maximum length of a meeting, in slots.
        max_value: The maximum value of a meeting in a slot, and of a free slot, for a participant. None: there are no
            preferences, and all meetings must take place.
        model: The meaning of a variable.

    Raises:
        ValueError: A number is out of bounds.
    """
    model = member(MeetingsModel, "model", model)
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "meetings": (meetings, 1, MAX_AGENTS)})
    check_bounds({"participants": (participants, 1, agents), "slots": (slots, 1, MAX_VALUES)})
    preferences = max_value is not None
    most = 1 if max_value is None else max_value
    check_bounds({"max-length": (max_length, 1, slots), "max-value": (most, 1, MAX_COST)})
    problem = drawn_meetings(seeded(seed), (agents, meetings, participants, slots), max_length, most)
    match model:
        case MeetingsModel.PEAV:
            variables, constraints = _peav(problem, preferences=preferences)
        case MeetingsModel.EAV:
            variables, constraints = _eav(problem, preferences=preferences)
        case MeetingsModel.TSAV:
            variables, constraints = _tsav(problem, preferences=preferences)
        case MeetingsModel.WORDS:
            variables, constraints = meetings_in_words(problem, preferences=preferences)
        case never:
            assert_never(never)
    label = f"-{max_length}-{max_value}" if preferences else f"-{max_length}-required"
    return assemble(
        f"meetings-{model}-{agents}-{meetings}-{participants}-{slots}{label}-{seed}",
        variables,
        limited(constraints),
        kind=ProblemKind.DISWCSP if preferences else ProblemKind.DISCSP,
        costs=CostUnits(maximize=True) if preferences else PLAIN_COSTS,
    )


def drawn_meetings(chance: Random, sizes: tuple[int, int, int, int], max_length: int, max_value: int) -> Meetings:
    """Return random meetings; `sizes` are the numbers of persons, meetings, participants and slots."""
    agents, count, participants, slots = sizes
    free = {person: [random_integer(chance, 0, max_value) for _ in range(slots)] for person in range(1, agents + 1)}
    found = []
    for number in range(1, count + 1):
        length = random_integer(chance, 1, max_length)
        persons = [place + 1 for place in sample(chance, agents, participants)]
        found.append(Meeting(number, {person: random_integer(chance, 1, max_value) for person in persons}, length))
    return Meetings(slots, free, found)


_Parts = tuple[dict[str, list[Variable]], Iterable[Constraint]]
"""The variables of each robot, and the constraints."""


def _peav(problem: Meetings, *, preferences: bool) -> _Parts:
    variables: dict[str, list[Variable]] = {}
    for person in sorted({person for meeting in problem.meetings for person in meeting.worth}):
        variables[f"Robot{person}"] = [
            Variable(f"V{person}.{meeting.number}", _starts(problem, meeting, preferences=preferences))
            for meeting in problem.meetings
            if person in meeting.worth
        ]

    def constraints() -> Iterator[Constraint]:
        for meeting in problem.meetings:
            for person in meeting.worth:
                if preferences:
                    worth = {start: problem.worth(meeting, person, start) for start in problem.starts(meeting)}
                    yield _worth(f"{person}.{meeting.number}", worth)
            for pair in itertools.combinations(meeting.worth, 2):
                scope = tuple(f"V{person}.{meeting.number}" for person in pair)
                yield Constraint(f"M{meeting.number}", PREDEFINED["eq"], scope, scope)
        for one, other, shared in problem.rivals():
            for person in shared:
                yield _apart((f"V{person}.{one.number}", f"V{person}.{other.number}"), one, other)

    return variables, constraints()


def _eav(problem: Meetings, *, preferences: bool) -> _Parts:
    variables = {
        f"Meeting{meeting.number}": [Variable(f"V{meeting.number}", _starts(problem, meeting, preferences=preferences))]
        for meeting in problem.meetings
    }

    def constraints() -> Iterator[Constraint]:
        for meeting in problem.meetings:
            if preferences:
                starts = problem.starts(meeting)
                worth = {at: sum(problem.worth(meeting, one, at) for one in meeting.worth) for at in starts}
                yield _worth(str(meeting.number), worth)
        for one, other, _ in problem.rivals():
            yield _apart((f"V{one.number}", f"V{other.number}"), one, other)

    return variables, constraints()


def _tsav(problem: Meetings, *, preferences: bool) -> _Parts:
    parts = _parts(problem)
    attended = {
        person: [meeting for meeting in problem.meetings if person in meeting.worth]
        for person in sorted({person for meeting in problem.meetings for person in meeting.worth})
    }
    slots = range(1, problem.slots + 1)
    variables = {
        f"Robot{person}": [
            Variable(
                f"V{person}.{slot}",
                Domain(f"Slot{person}.{slot}", (range(1), *(_there(problem, one, parts, slot) for one in own))),
            )
            for slot in slots
        ]
        for person, own in attended.items()
    }

    def constraints() -> Iterator[Constraint]:
        for person, own in attended.items():
            names = [f"V{person}.{slot}" for slot in slots]
            for pair in itertools.combinations(names, 2):
                yield Constraint("once", ONCE, pair, pair)
            for one, pair in itertools.product(own, itertools.pairwise(names)):
                if one.length > 1:
                    yield Constraint("next", IN_A_ROW, pair, (*pair, parts[one.number][0], parts[one.number][-1]))
            if preferences:
                yield from _worth_of_slots(problem, person, own, parts)
            else:
                yield from (_takes_place(person, one, parts[one.number][0], problem.slots) for one in own)
        for meeting, slot in itertools.product(problem.meetings, slots):
            numbers = parts[meeting.number]
            for persons in itertools.combinations(meeting.worth, 2):
                scope = tuple(f"V{person}.{slot}" for person in persons)
                yield Constraint(f"M{meeting.number}", AT_ONE_TIME, scope, (*scope, numbers[0], numbers[-1]))

    return variables, constraints()


def _parts(problem: Meetings) -> dict[int, range]:
    """Return the numbers of each meeting's parts."""
    ends = itertools.accumulate((meeting.length for meeting in problem.meetings), initial=1)
    bounds = zip(problem.meetings, itertools.pairwise(ends), strict=True)
    return {meeting.number: range(begin, end) for meeting, (begin, end) in bounds}


def _there(problem: Meetings, meeting: Meeting, parts: Mapping[int, range], slot: int) -> range:
    """Return the parts of `meeting` that can be in `slot`."""
    numbers, starts = parts[meeting.number], problem.starts(meeting)
    return numbers[max(0, slot - starts[-1]) : min(meeting.length, slot)]


def _worth_of_slots(
    problem: Meetings, person: int, attended: Sequence[Meeting], parts: Mapping[int, range]
) -> Iterator[Constraint]:
    for slot, free in enumerate(problem.free[person], 1):
        worth = {part: one.worth[person] - free for one in attended for part in _there(problem, one, parts, slot)}
        yield _worth(f"{person}.{slot}", worth)


def _takes_place(person: int, meeting: Meeting, first: int, slots: int) -> Constraint:
    """Return the constraint that the first part of `meeting` is in one of the person's slots."""
    names = tuple(f"S{slot}" for slot in range(1, slots + 1))
    parts = [f"eq({name}, i)" for name in names]
    body = f"or({', '.join(parts)})" if slots > 1 else parts[0]
    scope = tuple(f"V{person}.{slot}" for slot in range(1, slots + 1))
    predicate = Predicate("held", (*names, "i"), parse(body, (*names, "i"), Type.BOOLEAN))
    return Constraint(f"held{person}.{meeting.number}", predicate, scope, (*scope, first))


def _starts(problem: Meetings, meeting: Meeting, *, preferences: bool) -> Domain:
    """Return the slots in which `meeting` can start, and 0 if the meeting need not take place."""
    starts = problem.starts(meeting)
    return Domain(f"Length{meeting.length}", (range(0 if preferences else 1, starts.stop),))


def _worth(name: str, worth: Mapping[int, int]) -> Constraint:
    relation = Relation(f"U{name}", 1, Semantics.SOFT, tuple((start,) for start in worth), tuple(worth.values()))
    return Constraint(f"U{name}", relation, (f"V{name}",), (f"V{name}",))


def _apart(names: tuple[str, str], one: Meeting, other: Meeting) -> Constraint:
    terms = (*names, one.length, other.length)
    return Constraint("apart", ONE_AFTER_THE_OTHER, terms, terms)
