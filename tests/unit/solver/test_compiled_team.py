"""A team and its compiled domains: the one is not to be had without the other, in whatever form the team is."""

from __future__ import annotations

import pickle
from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.profile import profile_of, ranges_of, restrict_to_team
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats import PREDEFINED
from robochoc.journal.events import Began, Decided, Improved, Lost
from robochoc.journal.journal import Header, JournalRecorder, read_journal
from robochoc.model.orders import with_dom_deg_order, with_priorities
from robochoc.model.problem import AddConstraint, Child, Constraint, Parent, Robot, ScenarioEvent, Team
from robochoc.model.team_edits import keep_interfaces, without_robots
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.traits import Traits
from robochoc.replay.rebuild import Rebuilder, ReplayOptions
from robochoc.replay.steps import RecordedRun
from robochoc.run import Options, Runtime, solve
from robochoc.run.scenario import ScenarioRun
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, agent_problems
from robochoc.solver.compiled_domain import CompiledDomain, compile_domain
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam, ensure_compiled
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.objective import Objective
from tests.support.cost_problems import with_costs
from tests.support.loose_problems import every_order, loose_team, turned_interface, untold_interface
from tests.support.problems import team_of

_UNLIKE = PREDEFINED["ne"]
SCHEDULE = Concurrent(0)


def lined_up(compiled: CompiledTeam) -> bool:
    """Whether all values are of the variables that their robot shows in that team."""
    return all(
        value == tuple(own.domain.solution(index)[name] for name in own.robot.interface)
        for own in compiled.robots.values()
        for index, value in enumerate(own.domain.values)
    )


def test_the_turned_team_has_domains_of_its_own() -> None:
    team = turned_interface()
    turned = with_priorities(team, ("C", "A", "B"))
    assert (team["A"].interface, turned["A"].interface) == (("x", "y"), ("y",))
    assert len(CompiledTeam(team)["A"].values) == 6
    assert CompiledTeam(turned)["A"].values == ((7,), (8,))
    assert [team for team in (team, turned) if not lined_up(CompiledTeam(team))] == []


def test_every_form_of_a_team_lines_up_with_its_domains() -> None:
    chance = Random("forms")
    for _ in range(8):
        team = loose_team("abt", chance)
        for order in every_order(team, chance):
            journey = ScenarioRun(team, order if isinstance(order, tuple) else None, CompiledTeam, lambda: None)
            assert lined_up(journey.compiled())
            assert journey.compiled().team == journey.ordered_team()
        assert lined_up(CompiledTeam(with_dom_deg_order(team)))
        left = without_robots(team, chance.sample(team.order, len(team.order) - 1))
        assert lined_up(CompiledTeam(left))
        assert lined_up(CompiledTeam(keep_interfaces(left, team)))


def test_a_robot_cannot_get_another_ones_domain() -> None:
    own = CompiledRobot(turned_interface()["A"])
    other = with_priorities(turned_interface(), ("C", "A", "B"))["A"]
    with pytest.raises(TypeError):
        replace(own, robot=other)
    with pytest.raises(AttributeError):
        own.robot = other  # type: ignore[misc]
    compiled = CompiledTeam(turned_interface())
    with pytest.raises(TypeError):
        compiled.robots["A"] = own  # type: ignore[index]


def test_compiled_robots_travel_to_other_processes() -> None:
    own = CompiledRobot(turned_interface()["A"])
    assert pickle.loads(pickle.dumps(own)) == own  # noqa: S301 - it is our own


def test_the_parameters_of_a_run_travel_to_other_processes() -> None:
    assert pickle.loads(pickle.dumps(DEFAULT_PARAMETERS)) == DEFAULT_PARAMETERS  # noqa: S301 - it is our own


def test_a_robot_with_other_links_is_compiled_again_only_if_it_shows_something_else() -> None:
    compiled: list[str] = []

    def noted(robot: Robot) -> CompiledDomain:
        compiled.append(robot.name)
        return compile_domain(robot)

    own = CompiledRobot(turned_interface()["A"], noted)
    same = replace(own.robot, children=(Child("B", ("y", "x")),))
    assert own.relinked(same, noted).domain is own.domain
    assert compiled == ["A"]
    less = replace(own.robot, children=(Child("B", ("y",)),))
    assert own.relinked(less, noted) == CompiledRobot(less)
    assert compiled == ["A", "A"]


def test_only_those_who_are_asked_for_are_compiled() -> None:
    some = CompiledTeam(turned_interface(), only={"B"})
    assert list(some.robots) == ["B"]
    assert list(agent_problems(some)) == ["B"]
    assert ensure_compiled(some) is some


def test_a_session_says_what_its_robots_work_on() -> None:
    turned = CompiledTeam(with_priorities(turned_interface(), ("C", "A", "B")))
    assert Simulation(turned, ABT, SCHEDULE).compiled is turned


# The journal's improvements are of the team that the robots work on


@pytest.mark.parametrize("protocol", ["syncbb", "adopt", "bnb-adopt", "afb", "sfb"])
def test_what_robots_have_heard_of_is_told_by_the_variables_that_they_show(protocol: str) -> None:
    """It was told by those that they show in the files: an error, where these are more."""
    team = with_costs(turned_interface())
    order = ("C", "A", "B")
    recorder = JournalRecorder(
        Header(team=team.name, protocol=protocol, runtime="simulator", seed=0), lambda: Objective(team)
    )
    solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, order=order), observer=recorder)
    improved = [event for event in read_journal(recorder.content()).events if isinstance(event, Improved)]
    assert improved
    assert improved[-1].cost == 0
    assert improved[-1].assignment["y"] == improved[-1].assignment["b"]


def test_what_is_heard_in_words_that_cannot_be_is_passed_over() -> None:
    objective = Objective(turned_interface())
    assert objective.shown({"A": (1, 7)}) == {"A": {"x": 1, "y": 7}}
    assert objective.shown({"A": (7,)}) is None
    assert objective.shown({"Z": (7,)}) is None
    assert objective.shown({"Z": ()}) is None


# Machines


def all_shown(team: Team) -> NetworkMembers:
    """All of `team`, registered, and asked for what they had not shown."""
    members = NetworkMembers(team.order)
    for robot in team.robots:
        members.register(robot.name, profile_of(robot), "visit")
    for name, variables in members.unseen().items():
        domains = {variable.name: variable.domain for variable in team[name].variables}
        assert not members.show(name, {one: ranges_of(domains[one]) for one in variables})
    members.closed = True
    return members


def test_who_shows_more_than_its_file_says_means_what_others_read() -> None:
    """The master lists what was asked for last, wherever it stands in the file."""
    team = untold_interface()
    task = all_shown(team).tasks(1, "abt", Traits(), DEFAULT_PARAMETERS)["A"]
    own = CompiledRobot(team["A"]).relinked(restrict_to_team(team["A"], task.interfaces))
    assert own.robot.interface == task.interfaces["A"] == ("y", "x")
    assert own.domain.values[0] == (7, 1)
    assert lined_up(CompiledTeam(Team("A", (own.robot,))))


def test_who_is_left_shows_what_it_showed_and_keeps_its_place() -> None:
    """Robots on a network are not told to show less. So neither may be what is computed for them elsewhere."""
    chance = Random("left on a network")
    for _ in range(40):
        team = loose_team("abt", chance)
        members = all_shown(team)
        assert members.order == team.order or any(robot.shown for robot in team.robots)
        gone = chance.sample(team.order, chance.randrange(len(team.order)))
        before = members.order
        members.remove(gone)
        assert members.order == tuple(name for name in before if name not in gone)
        left = keep_interfaces(without_robots(team, gone), team)
        for name, task in members.tasks(2, "abt", Traits(), DEFAULT_PARAMETERS).items():
            assert task.interfaces == {robot.name: robot.interface for robot in left.robots}
            assert restrict_to_team(team[name], task.interfaces).interface == left[name].interface


def test_an_order_does_not_change_when_somebody_is_lost() -> None:
    """Without Z, the parent of A, natural order would have A before B."""
    robots = (Robot("B", ()), Robot("Z", (), children=(Child("A"),)), Robot("A", (), parents=(Parent("Z"),)))
    members = NetworkMembers(["A", "B", "Z"])
    for robot in robots:
        members.register(robot.name, profile_of(robot), "visit")
    members.closed = True
    seen = [members.order]
    members.remove(["Z"])
    assert [*seen, members.order] == [("B", "Z", "A"), ("B", "A")]


def test_who_plays_machines_again_knows_what_they_showed_and_what_it_cost_to_step_aside() -> None:
    """RA, whose neighbour is gone, shows its variable still; and RC's constraint with RB still counts."""
    pairs = [("A", "B"), ("B", "C")]
    constraints = [Constraint("C", _UNLIKE, pair, pair, cost=5) for pair in pairs]
    team = with_costs(team_of(dict.fromkeys("ABC", (1, 2)), constraints))
    cast = Rebuilder(Header(team="t", protocol="abt", runtime="network", seed=0), ReplayOptions(team=team))
    decided = Decided(t=0, robot="RA", assignment={}, clock=0)
    cast.robots_of(RecordedRun(0, Began(t=0, protocol="DPOP"), None, [decided, Lost(t=1, robot="RB", why="gone")]))
    part = cast.robots_of(RecordedRun(1, Began(t=0, protocol="DPOP"), None, [decided])).parts["RC"]
    assert part.interfaces == {"RA": ("A",), "RC": ("C",)}
    assert part.parameters.withdrawal_cost == 1 + 5


# Changes


def test_costs_that_come_later_must_fit_as_well() -> None:
    team = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", _UNLIKE, ("A", "B"), ("A", "B"), cost=5)]))
    most = 10**18 - 1  # a file has no number of more digits
    dear = [
        AddConstraint("RB", "RA", Constraint(f"D{number}", _UNLIKE, ("A", "B"), ("A", "B"), cost=most))
        for number in range(5)
    ]
    with pytest.raises(UnsupportedError, match="scale the costs down"):
        solve(
            replace(team, scenario=(ScenarioEvent(tuple(dear)),)), Options(protocol="dpop", runtime=Runtime.SIMULATOR)
        )
