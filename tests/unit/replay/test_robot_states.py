"""What a robot knows after each of its steps, in words, and why it has changed its mind."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from random import Random
from types import SimpleNamespace
from typing import Any, NoReturn

import msgspec
import numpy as np
import pytest

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Concluded, Sent, actor
from robochoc.model.problem import Constraint, Team
from robochoc.protocols.findings import Incumbent
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.replay import CannotReplayError, ReplayOptions, RobotState, TeamStates, states_of
from robochoc.replay.inspection import MOST_VALUES
from robochoc.replay.reasons import MOST_BACKTRACKS, MOST_REASONS
from robochoc.replay.safe_repr import MAX_LENGTH, safe_repr
from robochoc.replay.value_text import ValueText
from robochoc.run import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.cases import cases
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.problems import random_team, team_of
from tests.support.replays import in_text, random_run, recorded, with_events

pytestmark = pytest.mark.usefixtures("quick_encryption")

SIMULATED = Options(protocol="abt", runtime=Runtime.SIMULATOR)


def differ(*names: str) -> Constraint:
    from robochoc.formats import PREDEFINED  # noqa: PLC0415 - one constraint

    return Constraint("C", PREDEFINED["ne"], names, names)


def pair(values: int = 3) -> Team:
    return team_of({"A": range(1, values + 1), "B": range(1, values + 1)}, [differ("A", "B")])


def states(team: Team, robot: str, protocol: str = "abt", options: ReplayOptions | None = None) -> list[RobotState]:
    journal = recorded(team, replace(SIMULATED, protocol=protocol))
    return list(states_of(journal, robot, options))


def test_why_a_robot_changes_its_mind() -> None:
    began, then = states(pair(), "RB")
    assert (began.step, began.value, began.view, began.nogoods) == (0, {"B": 1}, [], [])
    assert began.why == ["it takes B = 1, the first value that nothing rules out"]
    assert (then.step, then.value, then.view) == (1, {"B": 2}, [("RA", "A = 1")])
    assert then.nogoods == ["while A = 1: B != 1"]
    assert [(one.value, one.ruled_out_by) for one in then.domain] == [
        ("B = 1", "A = 1"),
        ("B = 2", None),
        ("B = 3", None),
    ]
    assert then.why == [
        "B = 1 was ruled out by: A = 1 (RA said Ok: A = 1)",
        "it takes B = 2, the first value that nothing rules out",
    ]
    assert then.more["higher"] == "{'RA'}"


def test_a_nogood_from_below_and_a_domain_without_a_value() -> None:
    team = team_of({"A": [1, 2], "B": [1], "C": [1]}, [differ("A", "B"), differ("A", "C")])
    last = states(team, "RA")[-1]
    assert last.nogoods == ["A != 1, whatever the others take"]
    assert last.why[0].startswith("A = 1 was ruled out whatever the others take (R")
    assert "RB said Nogood: A != 1, whatever the others take" in last.why[0]
    lower = states(team, "RB")[1]
    assert lower.why == [
        "B = 1 was ruled out by: A = 1",
        "no value was left, and it said Nogood to RA: A != 1, whatever the others take",
        "it assumes that RA will change its value, and keeps B = 1, the first value that nothing rules out",
    ]
    assert lower.view == []  # forgotten, as another value is sure to come


def test_a_robot_sends_an_unchanged_value_again() -> None:
    why = [line for state in states(queens3d(4), "Robot1.2") for line in state.why]
    assert "Robot3.1 asked for this robot's value (AddLink)" in why
    (outdated,) = [line for line in why if "again" in line]
    assert outdated == (
        "Robot2.1 said Nogood: while V1.1 = 3: V1.2 != 1; this nogood is outdated, and Robot2.1 forgot V1.2 = 1 "
        "when it sent the nogood, so this robot sends V1.2 = 1 again"
    )


def test_a_robot_without_a_value_left_says_what_had_ruled_out_each() -> None:
    team = queens3d(3)
    told = [state for state in states(team, "Robot1.2") if any("no value was left" in line for line in state.why)]
    first = told[0]
    place = next(place for place, line in enumerate(first.why) if line.startswith("no value was left"))
    assert place <= MOST_REASONS
    values = {name for line in first.why[:place] for name in re.findall(r"V1\.2 = \d", line.split(" ruled out")[0])}
    assert values == {"V1.2 = 1", "V1.2 = 2", "V1.2 = 3"}
    assert all(re.search("ruled out(?: by: V| whatever)", line) for line in first.why[:place])
    assert re.match(r"no value was left, and it said Nogood to Robot1\.1: .*V1\.1 != \d", first.why[place])


def test_so_it_does_in_other_protocols_once_for_each_time() -> None:
    with cases() as each:
        for protocol in ("awc", "sbt", "afc", "afc-ng", "disfc"):
            with each(protocol):
                journal = recorded(queens3d(3), replace(SIMULATED, protocol=protocol))
                told = [state.why for robot in queens3d(3).order for state in states_of(journal, robot) if state.why]
                ends = [why for why in told if any(line.startswith("no value was left, and it said ") for line in why)]
                assert ends
                assert all(len(why) <= (MOST_REASONS + 2) * (MOST_BACKTRACKS + 1) for why in told)
                assert any("ruled out by: " in why[0] for why in ends)
                assert all(len({*why}) == len(why) for why in ends if protocol == "awc")


def test_a_robot_that_ends_the_search_says_so() -> None:
    team = team_of({"A": [1], "B": [1], "C": [1]}, [differ("A", "B"), differ("A", "C")])
    (ended,) = [state for state in states(team, "RA") if "concluded" in str(state.why)]
    assert ended.why == [
        "A = 1 was ruled out whatever the others take",
        "it has no value now",
        "it concluded that there is no solution: no value is left, whatever the others take",
    ]


def test_whoever_ends_the_search_says_so_in_every_protocol() -> None:
    team = team_of({"A": [1], "B": [1]}, [differ("A", "B")])
    with cases() as each:
        for protocol in (name for name in protocol_names() if protocol_named(name).traits.complete):
            with each(protocol):
                journal = recorded(team, replace(SIMULATED, protocol=protocol))
                concluded = {event.robot for event in journal.events if isinstance(event, Concluded)}
                assert concluded
                for robot in concluded:
                    told = [line for state in states_of(journal, robot) for line in state.why]
                    assert sum(line.startswith("it concluded that ") for line in told) == 1


def test_views_stand_in_the_order_of_priority_and_what_is_empty_is_left_out() -> None:
    journal = recorded(queens3d(3), SIMULATED)
    order = queens3d(3).order
    for state in states_of(journal, "Robot3.3"):
        names = [name for name, _ in state.view]
        assert names == sorted(names, key=order.index)
        assert not {"{}", "[]", "None"} & {*state.more.values()}


VIEWS = {
    "sbt": ("A = 1", "A = 1, by C"),
    "afc": ("A = 1", "A = 1, by C"),
    "afc-ng": ("A = 1", "A = 1"),
    "awc": ("A = 1", "A = 1, by C"),
    "disfc": ("assignment 1 of RA", "assignment 1 of RA"),
    "syncbb": ("A = 1", "A = 1, by C"),
    "adopt": ("A = 1", "A = 1, by C"),
    "mgm2": ("A = 1", "A = 1, by C"),
}
"""By protocol: RA's value in RB's view, and what rules out that value of RB's."""


def test_views_of_other_protocols_are_understood() -> None:
    with cases() as each:
        for protocol, (view, ruled_out) in VIEWS.items():
            with each(protocol):
                seen = [state for state in states(pair(), "RB", protocol) if ("RA", view) in state.view]
                assert seen
                assert ruled_out in {one.ruled_out_by for state in seen for one in state.domain}


def test_costs_and_bounds_stand_with_the_values() -> None:
    from tests.support.cost_problems import random_cost_team  # noqa: PLC0415 - here only

    team = random_cost_team(Random(2))
    last = states(team, team.order[0], "adopt")[-1]
    assert all("(LB " in one.value for one in last.domain)
    assert {"lb", "ub", "threshold", "bounds"} <= {*last.more}
    assert any("(costs " in one.value for one in states(team, team.order[-1], "syncbb")[-1].domain)


def test_the_last_states_alone_are_the_same() -> None:
    journal = recorded(queens3d(3), SIMULATED)
    all_of_them = list(states_of(journal, "Robot3.3"))
    assert list(states_of(journal.events, "Robot3.3", header=journal.header, since=5)) == all_of_them[5:]


def test_what_the_text_form_loses_is_said_again_by_those_who_said_it() -> None:
    journal = recorded(random_team(Random(5)), replace(SIMULATED, protocol="adopt"))
    lossy = in_text(journal)
    assert any("null" in msgspec.json.encode(e).decode() for e in lossy.events if isinstance(e, Sent))
    for robot in ("RX00", "RX01"):
        assert list(states_of(lossy, robot)) == list(states_of(journal, robot))


@pytest.mark.parametrize("protocol", ["abt", "adopt", "dpop", "dynabt", "mgm2"])
@count("number", fast=4, slow=60)
def test_the_states_of_a_team_equal_those_of_its_robots(protocol: str, number: int) -> None:
    """Teams and events are read once for all robots; some runs have epochs, and the text form loses contents."""
    for seed in range(number):
        team, options = random_run(protocol, Random(f"team {protocol} {seed}"), seed)
        if any(robot.private for robot in team.robots):
            continue
        journal = recorded(team, options)
        for read in (journal, in_text(journal)):
            together = TeamStates(read)
            for robot in reversed(team.order):
                assert _states_or_why(together.of(robot)) == _states_or_why(states_of(read, robot))


def _states_or_why(found: Iterator[RobotState]) -> list[RobotState] | str:
    try:
        return list(found)
    except CannotReplayError as why:
        return str(why)


def test_large_domains_are_shown_in_part() -> None:
    (_, then) = states(pair(500), "RB")
    assert len(then.domain) == MOST_VALUES + 1
    assert then.domain[-1].value == f"and {500 - MOST_VALUES} more"


def test_a_robot_whose_news_is_lost_says_where_it_ends() -> None:
    journal = recorded(pair(), SIMULATED)
    events = [event for event in journal.events if actor(event) != "RA"]
    began, partial, last = states_of(with_events(journal, events), "RB")
    assert began.value == {"B": 1}
    assert partial.more["replay"].startswith("ends here: the journal lacks events of this step")
    assert [state.step for state in (began, partial, last)] == [0, 1, 2]
    assert last.more == {"replay": "ends here: the message Ok from RA is not in the journal"}


class Backwards(ABT):
    """Takes the last value that will do."""

    def _choose_value(self, view: Any) -> int | None:  # noqa: ANN401 - as its base
        places = reversed(range(len(self.problem.values)))
        return next((index for index in places if self._consistent(index, view)), None)


def test_another_protocol_than_the_one_recorded_is_no_insight() -> None:
    journal = recorded(pair(), SIMULATED)
    with pytest.raises(CannotReplayError, match="the replay of RB differs from the record: in its step 0 of run 0"):
        list(states_of(journal, "RB", ReplayOptions(protocols={"ABT": Backwards})))


def test_nobody_of_that_name_has_no_states() -> None:
    assert list(states_of(recorded(pair(), SIMULATED), "Nobody")) == []


# Whatever a protocol keeps


class Grim:
    """Does not want to be looked at."""

    def __getattribute__(self, name: str) -> NoReturn:
        raise RuntimeError(name)

    def __repr__(self) -> str:
        raise RuntimeError


class Odd(ABT):
    """Keeps what nobody expects, under names that say something else."""

    def __init__(self, *own: Any) -> None:  # noqa: ANN401 - as its base
        super().__init__(*own)
        self.context = Grim()
        self.endless: list[Any] = []
        self.endless.append(self.endless)
        self._hidden = {"key": deque(range(1000))}
        self.table = np.zeros((3, 4))
        self.best = Incumbent(3.0, {"RA": (1,)})


def test_what_a_user_keeps_is_shown_as_far_as_it_can_be() -> None:
    then = states(pair(), "RB", options=ReplayOptions(protocols={"ABT": Odd}))[-1]
    assert then.value == {"B": 2}
    assert then.more["table"] == "<array of 3 x 4>"
    assert then.more["hidden"].startswith("{'key': deque([0, 1, 2, ")
    assert then.more["hidden"].endswith(", ...])}")
    assert then.more["context"] == "<Grim cannot be shown: RuntimeError>"
    assert then.more["best"] == "Incumbent(cost=3, values={'RA': (1,)})"
    assert then.more["endless"] == "[[[[...]]]]"


class Broken(ABT):
    """Its view is none."""

    def settle(self) -> None:
        super().settle()
        self.store = None  # type: ignore[assignment]
        self.problem.values = None  # type: ignore[assignment]


@plain_python_only
def test_a_robot_that_breaks_what_is_looked_at_has_a_state_nevertheless() -> None:
    then = states(pair(), "RB", options=ReplayOptions(protocols={"ABT": Broken}))[-1]
    assert (then.value, then.domain) == ({"B": 2}, [])


def test_the_safe_repr_of_things_is_short() -> None:
    things = [
        None, True, 12_000, 0.5, float("inf"), b"abc", {}, {"a": (1, 2)}, {3, 1, 2}, ValueText,
        SimpleNamespace(of=1, _own=(2,)),
    ]  # fmt: skip
    assert [*map(safe_repr, things)] == [
        "None", "True", "12000", "0.5", "inf", "<3 bytes>", "{}", "{'a': (1, 2)}", "{1, 2, 3}", "ValueText",
        "SimpleNamespace(of=1, own=(2,))",
    ]  # fmt: skip
    for thing in ("x" * 10**6, list(range(10**6)), {number: [number] * 100 for number in range(1000)}, 10**5000):
        assert len(safe_repr(thing)) <= MAX_LENGTH
