"""Lists with windows, durations and precedence: the optimum of all allocations, orders and starts."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.run import Options, Runtime, solve
from tests.support.random_task_lists import Meaning, exact, random_list, read_or_refused, rounded_fraction, written
from tests.support.task_lists import imported, mistakes

LIST = """tours: yes
robots:
  ann: {at: [0, 0], skills: arm, most: 3}
  bob: {at: [9, 0], skills: eye}
tasks:
  unlock: {at: [4, 0], needs: eye, worth: 20, window: [0, 12], duration: 2}
  carry: {at: [4, 3], needs: arm, worth: 20, after: unlock, window: [2, 12], duration: 1}
  look: {at: [0, 3], needs: arm, worth: 9, window: [10, 20]}
"""
Plan = tuple[tuple[str, ...], Fraction, Mapping[str, int]]
"""Tasks, the cost of the way minus synergies, and the starts of ordered tasks, in steps."""


class TimedMeaning(Meaning):
    """The meaning of a list with times, by brute force."""

    def __init__(self, told: Mapping[str, Any]) -> None:
        super().__init__(told)
        self.step = exact(told.get("step", 1))
        self.after = {name: self.names(task.get("after", [])) for name, task in self.tasks.items()}
        self.ordered = {name for name, before in self.after.items() for name in (name, *before) if before}

    @staticmethod
    def names(after: str | Sequence[str]) -> list[str]:
        return [after] if isinstance(after, str) else [*after]

    def best(self) -> Fraction:
        plans = [[*self.plans(one)] for one in self.robots.values()]
        return max(found for each in itertools.product(*plans) if (found := self.value_of(each)) is not None)

    def plans(self, robot: Mapping[str, Any]) -> Iterator[Plan]:
        """Yield the shortest way for each set of tasks and each choice of starts."""
        able = [name for name, task in self.tasks.items() if self.is_able(robot, task)]
        for number in range(min(robot.get("most", len(able)), len(able)) + 1):
            for tasks in itertools.combinations(able, number):
                if sum(self.tasks[name].get("load", 1) for name in tasks) > robot.get("capacity", len(tasks) * 9):
                    continue
                extra = sum(exact(one["worth"]) for one in self.synergies if {*one["tasks"]} <= {*tasks})
                found: dict[tuple[tuple[str, int], ...], Fraction] = {}
                for order in itertools.permutations(tasks):
                    for length, starts in self.schedules(robot, order):
                        found[starts] = min(length, found.get(starts, length))
                for starts, length in found.items():
                    yield tasks, extra - rounded_fraction(length, self.places), dict(starts)

    def schedules(
        self, robot: Mapping[str, Any], order: Sequence[str]
    ) -> Iterator[tuple[Fraction, tuple[tuple[str, int], ...]]]:
        """Yield the length of a way and the starts, for each possible choice of starts."""
        speed = exact(robot.get("speed", 1))
        ready = [(Fraction(), Fraction(), robot.get("at"), ())]
        for name in order:
            task, reached = self.tasks[name], []
            for length, time, at, starts in ready:
                way = self.length(at, task.get("at"), 9) if robot.get("at") else Fraction()
                here = task["at"] if robot.get("at") and task.get("at") else at
                arrival = time + way / speed
                if arrival > exact(task.get("deadline", 10**9)):
                    continue
                earliest, latest = map(exact, task.get("window", (0, 10**9)))
                begin = max(arrival, earliest)
                for start in self.starts(name, begin, latest):
                    used = () if name not in self.ordered else ((name, int(start / self.step)),)
                    end = start + exact(task.get("duration", 0))
                    reached.append((length + way, end, here, (*starts, *used)))
            ready = reached
        for length, _, _, starts in ready:
            yield length, tuple(sorted(starts))

    def starts(self, name: str, begin: Fraction, latest: Fraction) -> list[Fraction]:
        if begin > latest:
            return []
        if name not in self.ordered:
            return [begin]
        return [slot * self.step for slot in range(-int(-begin // self.step), int(latest // self.step) + 1)]

    def value_of(self, each: Sequence[Plan]) -> Fraction | None:
        for name, before in self.after.items():
            for other in before:
                late = [starts[name] for tasks, _, starts in each if name in tasks]
                soon = [starts[other] for tasks, _, starts in each if other in tasks]
                if late and not soon:
                    return None
                gap = exact(self.tasks[other].get("duration", 0))
                if any((one - two) * self.step < gap for one in late for two in soon):
                    return None
        return self.value([(tasks, cost) for tasks, cost, _ in each])


def timed_list(chance: Random) -> dict[str, Any]:
    """Return a random list with times."""
    told = {**random_list(chance), "tours": True, "model": "several", "step": chance.choice((1, 2, 0.5))}
    names = [*told["tasks"]]
    for place, (name, task) in enumerate(told["tasks"].items()):
        task["worth"] = 6 * chance.randrange(2, 9)
        if chance.random() < 0.5:
            task["duration"] = chance.choice((1, 2.5, 3))
        if chance.random() < 0.4:
            earliest = chance.choice((0, 2, 5.5))
            task["window"] = [earliest, earliest + chance.choice((1, 4, 9))]
        if place and chance.random() < 0.5:
            others = names[:place] if chance.random() < 0.5 else names[place - 1 : place]
            told["tasks"][name]["after"] = others if len(others) > 1 or chance.random() < 0.5 else others[0]
            for one in (name, *others):
                early = chance.randrange(4)
                told["tasks"][one].setdefault("window", [early, early + 4])
    return told


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.slow)])
def test_random_lists_with_times_have_the_optimum_of_all_orders(count: int, tmp_path: Path) -> None:
    chance, solved, ordered = Random(f"times {count}"), 0, 0
    while solved < count:
        told = timed_list(chance)
        meaning = TimedMeaning(told)
        path = tmp_path / "list.yaml"
        path.write_text(written(told, "block"))
        team, error = read_or_refused(path)
        if team is None:
            assert "can do any" in error or "a different number" in error or "divided" in error, (
                error + path.read_text()
            )
            continue
        best = meaning.best()
        found = solve(team, Options(protocol=("sfb", "dpop")[solved % 2], runtime=Runtime.SIMULATOR)).cost
        assert found is not None
        assert Fraction(found) == best, path.read_text()
        solved += 1
        ordered += bool(meaning.ordered)
    assert ordered > count / 3


def test_a_task_begins_after_another_robot_has_ended_one(tmp_path: Path) -> None:
    team = imported(LIST, tmp_path).team
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert outcome.cost == 20 + 20 + 9 - 5 - (5 + 4)
    rows = outcome_report(team, outcome).splitlines()
    assert rows[1:4] == ["    robot  does", "    ann    carry (starts at 7), look", "    bob    unlock (starts at 5)"]
    late = LIST.replace("window: [2, 12]", "window: [2, 6]")
    assert solve(imported(late, tmp_path).team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)).cost == 20 + 9 - 8


def test_a_task_after_one_that_nobody_can_do_is_left_out(tmp_path: Path) -> None:
    notes = imported(LIST.replace("skills: eye", "skills: ear"), tmp_path).notes
    assert [note.text for note in notes if note.kind == "left out"] == [
        "the robot bob, which can do none of the tasks",
        "the task unlock, which no robot can do",
        "the task carry, which no robot can do",
    ]


@pytest.mark.parametrize(
    ("now", "then", "told"),
    [
        (
            "after: unlock",
            "after: unlck",
            "7: the task 'carry' is after 'unlck', which is not in the list (did",
        ),
        ("after: unlock", "after: carry", "7: the order of tasks is a cycle: carry, carry (delete one after:)"),
        ("window: [2, 12], ", "", "7: the task 'carry' precedes or follows another task, and has no window (write"),
        ("[2, 12]", "[12, 2]", "7: the task 'carry' has a window whose end is before its beginning"),
        ("[2, 12]", "[2]", "7: the task 'carry' cannot have this value as 'window' (write window: [EARLIEST, LATEST])"),
        (
            "tours: yes",
            "tours: no",
            "6: the task 'unlock' has duration:, but robots that do several tasks have no",
        ),
        ("tours: yes", "model: assignment", "has after:, which the model assignment does not support"),
        ("tours: yes", "tours: yes\nstep: 0", "2: the list has the step 0 (write a number above 0)"),
        ("tours: yes", "tours: yes\nstep: 0.001", "the task 'unlock' has more than 1,000 starts in its window"),
    ],
)
def test_mistakes_in_times_have_their_line(now: str, then: str, told: str, tmp_path: Path) -> None:
    assert told in mistakes(LIST.replace(now, then), tmp_path)
