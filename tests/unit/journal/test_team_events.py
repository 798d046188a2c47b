"""What robots are given, as an event and back: the team is the same, whatever its problem."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import msgspec
import pytest

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Given
from robochoc.journal.team_events import GivenProblemError, TeamReader, TeamWriter, invalidated_of, run_parameters_of
from robochoc.model.orders import Order, OrderError, with_order
from robochoc.model.problem import Constraint, Domain, ProblemKind, Relation, Robot, Semantics, Team, Variable
from robochoc.model.team_edits import without_robots
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.explanation import invalidated_by
from tests.support.cases import looped
from tests.support.complex_changes import random_complex_changing_team
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team, team_of
from tests.support.random_changes import random_changing_team, stages

FAMILIES = (
    random_team,
    random_cost_team,
    random_complex_team,
    random_complex_cost_team,
    random_pkc_team,
    random_changing_team,
    random_complex_changing_team,
)
PER_FAMILY = 9


def normal(team: Team) -> Team:
    """`team` without what no robot looks at: what definitions and domains are called, and how a domain is cut."""
    return replace(team, name="", scenario=(), robots=tuple(_normal(robot) for robot in team.robots))


def _normal(robot: Robot) -> Robot:
    def told(constraints: tuple[Constraint, ...]) -> tuple[Constraint, ...]:
        return tuple(replace(one, definition=replace(one.definition, name="")) for one in constraints)

    values = (
        (variable.name, tuple(range(value, value + 1) for value in variable.domain)) for variable in robot.variables
    )
    return replace(
        robot,
        variables=tuple(Variable(name, Domain("", ranges)) for name, ranges in values),
        private=tuple(replace(one, model=None) for one in told(robot.private)),
        parents=tuple(replace(one, constraints=told(one.constraints)) for one in robot.parents),
        children=tuple(replace(one, constraints=told(one.constraints)) for one in robot.children),
    )


def through(given: Given) -> Given:
    """As a journal gives it back."""
    event = msgspec.json.decode(msgspec.json.encode(given), type=AnyEvent)
    assert isinstance(event, Given)
    return event


def arranged(team: Team, chance: Random) -> Team:
    try:
        return with_order(team, chance.choice((Order.GIVEN, Order.MIN_WIDTH, Order.MAX_DEGREE)))
    except OrderError:
        return team


@looped("family", FAMILIES)
def test_a_team_comes_back(family) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001 - makers of teams
    """Through all its epochs, in another order, and without one of its robots."""
    for seed in range(PER_FAMILY):
        chance = Random(f"given {family.__name__} {seed}")
        team = family(chance)
        writer, reader = TeamWriter(), TeamReader()
        epochs = list(stages(team))
        epochs += [arranged(epochs[-1], chance), without_robots(epochs[-1], [chance.choice(epochs[-1].order)])]
        for epoch in epochs:
            given = through(writer.given(epoch))
            assert not given.why
            assert normal(reader.team(given)) == normal(epoch)


def test_only_what_is_new_is_told() -> None:
    team = queens3d(3)
    writer = TeamWriter()
    assert {*writer.given(team).robots} == {*team.order}
    assert writer.given(team).robots == {}
    smaller = without_robots(team, ["Robot1.1"])
    changed = {robot.name for robot in smaller.robots if robot != team[robot.name]}
    assert {*writer.given(smaller).robots} == changed


def test_what_stands_beside_the_problem_comes_back() -> None:
    team, parameters = queens3d(2), RunParameters(7, {"cycles": "3"}, 12)
    stale = invalidated_by(team, without_robots(team, ["Robot1.1"]))
    given = through(TeamWriter().given(team, parameters, stale, fresh=["Robot2.1"], quiet=False))
    assert (run_parameters_of(given), invalidated_of(given), given.fresh, given.quiet) == (
        parameters,
        stale,
        ("Robot2.1",),
        False,
    )
    assert isinstance(given.aside, int)


def test_a_team_that_cannot_be_written_is_told_so() -> None:
    relation = Relation("R", 2, Semantics.SOFT, ((1, 2),), (5.0,), 0)
    team = team_of({"A": [1, 2], "B": [1, 2]}, [Constraint("C", relation, ("A", "B"), ("A", "B"))])
    team = replace(team, robots=tuple(replace(robot, kind=ProblemKind.DISWCSP) for robot in team.robots))
    given = TeamWriter().given(team)
    assert given.why == "RB cannot be written: the cost 5.0 of C is not an integer"
    assert given.robots == {}
    with pytest.raises(GivenProblemError, match=r"could not be written: RB cannot be written: the cost 5\.0"):
        TeamReader().team(given)


def test_one_that_can_be_written_after_it_is_told_whole() -> None:
    writer = TeamWriter()
    team = queens3d(2)
    odd = replace(team, robots=(replace(team.robots[0], name="no name"), *team.robots[1:]))
    assert writer.given(odd).why == "no name cannot be written: 'no name' cannot be a name in a file"
    assert {*writer.given(team).robots} == {*team.order}


@looped(
    ("change", "says"),
    [
        ({"order": ("Robot1.1", "Robot9.9")}, "the problem of Robot9.9 is missing"),
        ({"order": ("Robot1.1", "Robot1.1")}, "twice in the order"),
        ({"order": ("Robot1.1",)}, "the problem of Robot1.1 contains Robot"),
        ({"robots": {"Robot1.1": "<instance/>"}}, "the problem of Robot1.1 cannot be read: Robot1.1.xml"),
        ({"robots": {"../Robot1.1": "<instance/>"}}, "cannot be a robot's name"),
        ({"robots": {"Robot1.1": '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'}}, "a DOCTYPE is not accepted"),
    ],
)
def test_what_strangers_say_is_held_against_what_can_be(change: dict[str, object], says: str) -> None:
    given = msgspec.structs.replace(TeamWriter().given(queens3d(2)), **change)
    with pytest.raises(GivenProblemError, match=says):
        TeamReader().team(given)


def test_two_robots_may_not_own_one_variable() -> None:
    given = TeamWriter().given(queens3d(2))
    files = {**given.robots, "Robot1.2": given.robots["Robot1.1"]}
    with pytest.raises(GivenProblemError):
        TeamReader().team(msgspec.structs.replace(given, robots=files))
