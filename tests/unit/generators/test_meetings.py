"""Meetings: what the calendars say is what all models say, and they have the same maximum."""

from __future__ import annotations

import itertools
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team
from robochoc.generators.meetings import Meetings, MeetingsModel, drawn_meetings, meetings
from robochoc.generators.meetings_in_words import time_of
from robochoc.model.problem import ProblemKind
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.seats.words import problem_in_words
from tests.support.cases import looped
from tests.support.evaluation import best, digest
from tests.support.examples import examples


def schedules(problem: Meetings, *, required: bool) -> list[int]:
    """Return the value of every schedule, by marking calendars."""
    values = []
    for starts in itertools.product(*(range(problem.slots + 1) for _ in problem.meetings)):
        calendar: set[tuple[int, int]] = set()
        value, good = 0, True
        for meeting, start in zip(problem.meetings, starts, strict=True):
            if start == 0:
                good &= not required
                continue
            good &= start + meeting.length - 1 <= problem.slots
            for person, slot in itertools.product(meeting.worth, range(start, start + meeting.length)):
                good &= (person, slot) not in calendar
                calendar.add((person, slot))
                value += meeting.worth[person] - (problem.free[person][slot - 1] if slot <= problem.slots else 0)
        if good:
            values.append(value)
    return values


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    teams = [
        meetings(5, 4, 2, 4, 7, max_length=2),
        meetings(5, 4, 2, 4, 7, max_length=2, model="eav"),
        meetings(4, 3, 3, 3, max_value=None),
        meetings(5, 4, 2, 4, 7, max_length=2, model="tsav"),
        meetings(5, 4, 2, 4, 7, max_length=2, model="words"),
    ]
    assert {team.name: digest(team) for team in teams} == {
        "meetings-peav-5-4-2-4-2-10-7": "7c1315e8b8df7ea3",
        "meetings-eav-5-4-2-4-2-10-7": "04b17d2af7fccddf",
        "meetings-peav-4-3-3-3-1-required-0": "67ff2cf09bb197aa",
        "meetings-tsav-5-4-2-4-2-10-7": "caa448be8878af80",
        "meetings-words-5-4-2-4-2-10-7": "263fef1a6c7cc912",
    }


@given(st.integers(1, 3), st.integers(1, 3), st.integers(1, 3), st.integers(0, 2**32))
@examples(12)
def test_all_models_have_the_maximum_of_the_calendars(agents: int, count: int, slots: int, seed: int) -> None:
    """Two participants at most: PEAV's assignments are tried one after the other."""
    participants, length = min(2, agents), min(2, slots)
    problem = drawn_meetings(Random(seed), (agents, count, participants, slots), length, 6)
    wanted = max(schedules(problem, required=False))
    for model in MeetingsModel:
        team = meetings(agents, count, participants, slots, seed, max_length=length, max_value=6, model=model)
        check_team(team)
        assert best(team) == wanted >= 0


@looped("seed", range(3))
def test_protocols_find_the_maximum(seed: int) -> None:
    problem = drawn_meetings(Random(seed), (4, 4, 2, 4), 2, 10)
    wanted = max(schedules(problem, required=False))
    for model in MeetingsModel:
        team = meetings(4, 4, 2, 4, seed, max_length=2, model=model)
        outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
        assert (outcome.cost, outcome.verdict) == (wanted, "optimal")


@looped("seed", range(4))
@looped(("slots", "length"), [(2, 1), (3, 2)])
def test_required_meetings_take_place_or_there_is_no_solution(slots: int, length: int, seed: int) -> None:
    problem = drawn_meetings(Random(seed), (4, 4, 2, slots), length, 1)
    wanted = "solution" if schedules(problem, required=True) else "no-solution"
    for model in MeetingsModel:
        team = meetings(4, 4, 2, slots, seed, max_length=length, max_value=None, model=model)
        assert team.kind is ProblemKind.DISCSP
        assert solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR)).verdict == wanted


def test_persons_meetings_and_times_have_names() -> None:
    team = meetings(4, 3, 2, 5, 1, max_length=2, model="words")
    words = problem_in_words(team, "Ada").splitlines()
    assert words[0] == "You decide for the robot Ada: Ada.design and Ada.hiring."
    assert "Ada.design is one of: no-meeting Mon-9h Mon-10h Mon-11h Mon-12h Mon-13h." in words
    assert "Rule together: Ada.hiring = Dan.hiring." in words
    assert any(line.startswith("Gain worth-design: a gain for each") for line in words)
    assert words[-1] == "Rules must hold. The sum of all gains of the whole team should be as large as possible."
    assert [time_of(slot) for slot in (1, 8, 9, 40, 41)] == ["Mon-9h", "Mon-16h", "Tue-9h", "Fri-16h", "Mon-9h-week2"]
    many = meetings(30, 20, 2, 2, 1, model="words")
    assert {"Ada2", "Finn2"} & {*many.order}


def test_who_decides_what() -> None:
    peav = meetings(6, 4, 3, 5, 2)
    held = [variable for variable in peav.variables if variable.endswith(".1")]
    assert len(held) == 3
    assert len(peav.variables) == 12
    assert all(name.split(".")[0] == f"V{peav.owner[name][5:]}" for name in peav.variables)
    eav = meetings(6, 4, 3, 5, 2, model="eav")
    assert eav.order == ("Meeting1", "Meeting2", "Meeting3", "Meeting4")
    assert list(eav.variables) == ["V1", "V2", "V3", "V4"]
