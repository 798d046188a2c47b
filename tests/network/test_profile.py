"""Profiles: what the master makes of them is what robots of a whole team know, and what cannot be is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.network.control_messages import SearchTask
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.profile import (
    LARGEST_WEIGHT,
    LONGEST_NAME,
    MOST_NEIGHBOURS,
    MOST_VARIABLES,
    Profile,
    ProfileError,
    domain_of,
    missing,
    possible_neighbours,
    profile_contradictions,
    profile_of,
    ranges_of,
    restrict_to_team,
    visible_robot,
)
from robochoc.formats import read_team
from robochoc.formats.definitions import MAX_VALUES
from robochoc.model.problem import Domain, ProblemKind, Robot, Team, Variable
from robochoc.model.team_edits import without_robots
from robochoc.protocols.traits import Traits
from robochoc.solver.agent_problem import (
    DEFAULT_PARAMETERS,
    AgentProblem,
    RunParameters,
    TeamKnowledge,
    agent_problems,
)
from robochoc.solver.compiled_domain import CompiledDomain
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.examples import examples
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team
from tests.support.program import ROOT
from tests.support.sparse_teams import profiles_of, sparse_team

MAKERS: list[Callable[[Random], Team]] = [
    random_team,
    random_complex_team,
    random_cost_team,
    random_complex_cost_team,
    random_pkc_team,
    lambda chance: sparse_team(chance.getrandbits(32)),
]
TREE = Traits(tree=True)
random_teams = st.builds(lambda make, seed: make(Random(seed)), st.sampled_from(MAKERS), st.integers(0, 2**32))


def registered(team: Team) -> NetworkMembers:
    """All of `team`, come in any order, with the variables that others want to see."""
    members = NetworkMembers(team.order)
    robots = list(team.robots)
    Random(len(team.name)).shuffle(robots)
    for robot in robots:
        members.register(robot.name, profile_of(robot), "incarnation").joined = True
    for name, variables in members.unseen().items():
        domains = {variable.name: variable.domain for variable in team[name].variables}
        members.robots[name].shown_later.update({one: ranges_of(domains[one]) for one in variables})
    assert members.complete
    assert not members.unseen()
    return members


def nothing_of(_robot: Robot) -> CompiledDomain:
    """No values: nobody searches here, and large files need no solver then."""
    return CompiledDomain((), (), (), (), (), ())


def part_of(robot: Robot, task: SearchTask) -> AgentProblem:
    """What a robot knows across machines."""
    parameters = RunParameters(task.seed, task.settings, task.aside)
    domains = {name: domain_of(name, ranges) for name, ranges in task.domains.items()}
    own = CompiledRobot(restrict_to_team(robot, task.interfaces), nothing_of)
    everyone = TeamKnowledge(tuple(task.order), task.interfaces, domains, task.links)
    return AgentProblem(own, everyone, (), task.secretive, parameters)


def comparable(part: AgentProblem) -> AgentProblem:
    """Without what says the same twice: the names of domains, and what a robot shows that its file implies."""
    domains = {name: Domain(name, domain.ranges) for name, domain in part.known.domains.items()}
    return part._replace(
        own=part.own.relinked(replace(part.robot, shown=())),
        known=TeamKnowledge(part.order, dict(part.interfaces), domains, part.known.links),
        pkc_holders=tuple(sorted(part.pkc_holders)),
    )


def assert_same(team: Team, members: NetworkMembers, robots: Sequence[Robot], parameters: RunParameters) -> None:
    """What robots know by the master's word is what they would know in a process of the whole team."""
    expected = agent_problems(CompiledTeam(team, nothing_of), parameters, tree=True)
    tasks = members.tasks(1, "abt", TREE, parameters)
    assert list(tasks) == list(expected)
    for robot in robots:
        known = part_of(robot, tasks[robot.name])
        assert comparable(known) == comparable(expected[robot.name])
        assert known.robot.interface == expected[robot.name].robot.interface == known.interfaces[robot.name]


def folders() -> list[Path]:
    files = [file for place in ("instances", "docs/examples") for file in (ROOT / place).rglob("*.xml")]
    return sorted({file.parent for file in files if file.parent.name != "late"})  # who comes late is no team


@looped("folder", folders)
def test_robots_of_files_know_what_the_whole_team_would_tell_them(folder: Path) -> None:
    team = read_team(folder)
    parameters = RunParameters(3, {"p": "0.5"}, 17.5)
    assert_same(team, registered(team), team.robots, parameters)


@given(team=random_teams)
@examples(120)
def test_robots_know_what_the_whole_team_would_tell_them(team: Team) -> None:
    assert_same(team, registered(team), team.robots, DEFAULT_PARAMETERS)


@given(team=random_teams, data=st.data())
@examples(120)
def test_robots_left_behind_know_what_a_smaller_team_would_tell_them(team: Team, data: st.DataObject) -> None:
    gone = data.draw(st.sets(st.sampled_from(team.order), max_size=len(team.order) - 1))
    members = registered(team)
    members.remove(gone)
    left = without_robots(team, gone, with_files=True)
    assert members.order == left.order
    expected = agent_problems(CompiledTeam(left, nothing_of), tree=True)
    for name, task in members.tasks(2, "abt", TREE, DEFAULT_PARAMETERS).items():
        known = part_of(team[name], task)
        assert replace(known.robot, shown=()) == replace(left[name], shown=())
        assert known.known.links == expected[name].known.links
        assert sorted(known.pkc_holders) == sorted(expected[name].pkc_holders)
        assert set(known.interfaces) == set(expected[name].interfaces)
        for other, shown in expected[name].interfaces.items():  # what others have shown once they go on showing
            assert set(shown) <= set(known.interfaces[other]) <= {v.name for v in team[other].variables}


@given(team=random_teams)
@examples(60)
def test_profiles_travel_and_agree(team: Team) -> None:
    profiles = profiles_of(team)
    for name, profile in profiles.items():
        assert msgspec.msgpack.decode(msgspec.msgpack.encode(profile), type=Profile) == profile
        assert missing({name: profile}) == set(profile.neighbours)
    assert not list(profile_contradictions(profiles))
    assert not missing(profiles)


@given(team=random_teams)
@examples(60)
def test_acquaintances_are_neighbours_and_sharers_of_constraints(team: Team) -> None:
    met = possible_neighbours(profiles_of(team))
    for robot in team.robots:
        mine = {robot.name, *met[robot.name]}
        assert len(mine) == len(met[robot.name]) + 1
        for other in robot.parents:
            assert robot.name in met[other.name]
            assert other.name in mine
        for constraint in robot.shared:
            owners = {team.owner[name] for name in constraint.variables}
            for one in owners:
                assert owners <= {one, *met[one]}


def test_a_profile_tells_nothing_of_what_nobody_sees() -> None:
    for seed in range(20):
        for make in MAKERS:
            for robot in make(Random(seed)).robots:
                assert set(profile_of(robot).variables) == set(robot.interface)
                shape = visible_robot(profile_of(robot), {})
                assert shape.interface == robot.interface
                assert not shape.private
                assert not shape.shared


# What cannot be

GOOD = Profile("R1", ProblemKind.DISCSP, ("R0",), ("R2",), {"X": ((1, 3), (5, 5))}, {"R2": ("Z",)}, 1, 4, ("/goal",))


def changed(**news: object) -> Profile:
    return msgspec.structs.replace(GOOD, **news)


def test_a_visible_robot_shows_what_is_in_the_profile() -> None:
    shape = visible_robot(GOOD, {"Y": ((0, 0),)})
    assert [(one.name, list(one.domain)) for one in shape.variables] == [("X", [1, 2, 3, 5]), ("Y", [0])]
    assert shape.interface == ("X", "Y")
    assert ([p.name for p in shape.parents], [c.name for c in shape.children]) == (["R0"], ["R2"])


@looped(
    ("profile", "why"),
    [
        (changed(name="1R"), "'1R' is not a valid name"),
        (changed(name=""), "'' is not a valid name"),
        (changed(parents=("R0/R9",)), "'R0/R9' is not a valid name"),
        (changed(children=("*",), looks_at={}), r"'\*' is not a valid name"),
        (changed(parents=("R" * (LONGEST_NAME + 1),)), "is not a valid name"),
        (changed(variables={"X Y": ((1, 1),)}), "'X Y' is not a valid name"),
        (changed(looks_at={"R2": ("Z\n",)}), "is not a valid name"),
        (changed(looks_at={"R0": ("Z",)}), "refers to variables of R0, which is not a child"),
        (changed(looks_at={"R7": ("Z",)}), "refers to variables of R7, which is not a child"),
        (changed(looks_at={"*": ()}), "not a child"),
        (changed(parents=("R1",)), "names itself"),
        (changed(parents=("R2",)), "a neighbour twice"),
        (changed(children=("R2", "R2")), "a neighbour twice"),
        (changed(parents=tuple(f"R{n}" for n in range(3, MOST_NEIGHBOURS + 3))), "too many"),
        (changed(variables={f"X{n}": ((1, 1),) for n in range(MOST_VARIABLES + 1)}), "too many"),
        (changed(looks_at={"R2": tuple(f"X{n}" for n in range(MOST_VARIABLES + 1))}), "too many"),
        (changed(variables={"X": ()}), "X has 0 values"),
        (changed(variables={"X": ((3, 1),)}), "not ascending"),
        (changed(variables={"X": ((1, 3), (3, 4))}), "not ascending"),
        (changed(variables={"X": ((5, 6), (1, 2))}), "not ascending"),
        (changed(variables={"X": ((1, MAX_VALUES + 1),)}), "X has 100,001 values"),
        (changed(variables={"X": ((-(2**63), 2**63 - 1),)}), "X has 18,446,744,073,709,551,616 values"),
        (changed(max_cost=float("nan")), "costs"),
        (changed(max_cost=float("inf")), "costs"),
        (changed(max_cost=-1.0), "costs"),
        (changed(weight=0), "weight"),
        (changed(weight=LARGEST_WEIGHT + 1), "weight"),
    ],
)
def test_absurd_profiles_are_refused(profile: Profile, why: str) -> None:
    with pytest.raises(ProfileError, match=why):
        visible_robot(profile, {})


def test_what_is_shown_later_is_looked_at_as_well() -> None:
    with pytest.raises(ProfileError, match="Y has 0 values"):
        visible_robot(GOOD, {"Y": ()})
    with pytest.raises(ProfileError, match="is not a valid name"):
        visible_robot(GOOD, {"": ((1, 1),)})


@given(
    ranges=st.lists(st.tuples(st.integers(-(2**63), 2**64), st.integers(-(2**63), 2**64)), max_size=4).map(tuple)
    | st.lists(st.tuples(st.integers(-3, 9), st.integers(-3, 9)), max_size=3).map(tuple)
)
@examples(150)
def test_any_ranges_are_a_domain_or_refused(ranges: tuple[tuple[int, int], ...]) -> None:
    try:
        domain = domain_of("X", ranges)
    except ProfileError:
        return
    assert list(domain) == sorted(set(domain))
    assert 0 < len(domain) <= MAX_VALUES
    assert list(domain) == [value for low, high in ranges for value in range(low, high + 1)]
    assert domain_of("X", ranges_of(domain)) == domain


def two(**news: object) -> dict[str, Profile]:
    upper = Profile("A", ProblemKind.DISCSP, (), ("B",), {"X": ((1, 2),)}, {}, 1, 0, ())
    lower = Profile("B", ProblemKind.DISCSP, ("A",), (), {"Y": ((1, 2),)}, {}, 1, 0, ())
    return {"A": upper, "B": msgspec.structs.replace(lower, **news)}


def test_profiles_that_agree_do_not_contradict() -> None:
    assert not list(profile_contradictions(two()))
    assert not list(profile_contradictions({}))


@looped(
    ("profiles", "why"),
    [
        (two(variables={"X": ((1, 1),)}), "the variable X is A's, and B's too"),
        (two(parents=()), "A calls B its child, which does not list it as a parent"),
        (two(parents=(), children=("A",)), "B calls A its child, which does not list it as a parent"),
        (two(kind=ProblemKind.DISWCSP), "A is a DisCSP and B is a DisWCSP: a team is one or the other"),
    ],
)
def test_contradictions_are_named(profiles: dict[str, Profile], why: str) -> None:
    assert why in list(profile_contradictions(profiles))


def test_a_parent_that_knows_no_child_contradicts() -> None:
    profiles = two()
    profiles["A"] = msgspec.structs.replace(profiles["A"], children=())
    assert list(profile_contradictions(profiles)) == ["B calls A its parent, which does not list it as a child"]


def test_parents_in_a_circle_contradict() -> None:
    around = {
        name: Profile(name, ProblemKind.DISCSP, (above,), (below,), {}, {}, 1, 0, ())
        for above, name, below in (("C", "A", "B"), ("A", "B", "C"), ("B", "C", "A"))
    }
    (why,) = profile_contradictions(around)
    assert why.startswith("the parents form a cycle: ")
    assert set(why.partition(": ")[2].split(" -> ")) == {"A", "B", "C"}


def test_only_robots_that_are_there_are_held_against_each_other() -> None:
    profiles = two()
    del profiles["A"]
    assert not list(profile_contradictions(profiles))
    assert missing(profiles) == {"A"}


def test_robots_that_count_symbols_differently_are_no_team() -> None:
    upper = Profile("A", ProblemKind.DISCSP, (), ("B",), {"X": ((0, 1),)}, {}, 1, 0, (), symbols=("red", "green"))
    lower = Profile("B", ProblemKind.DISCSP, ("A",), (), {"Y": ((0, 1),)}, {}, 1, 0, (), symbols=("red", "green"))
    other = msgspec.structs.replace(lower, symbols=("green", "red"))
    none = msgspec.structs.replace(lower, symbols=())
    assert list(profile_contradictions({"A": upper, "B": lower})) == []
    assert list(profile_contradictions({"A": upper, "B": none})) == []
    (told,) = profile_contradictions({"A": upper, "B": other})
    assert told.startswith("the symbols of A and B have different codes")


def test_a_profile_names_the_symbols_of_what_others_see() -> None:
    colours = Domain("D", (range(1, 2),), ("red", "green"))
    robot = Robot("A", (Variable("X", colours), Variable("Hidden", colours)), shown=("X",))
    profile = profile_of(robot)
    assert (profile.symbols, profile.symbolic) == (("red", "green"), ("X",))
    assert visible_robot(profile, {}).variables[0].domain.label(1) == "green"


@looped(
    ("symbols", "why"),
    [
        (("red", "red"), "one of them twice"),
        (("red", "\x1b[31m"), "is not a valid symbol"),
        (("red",), "is not the code of a symbol"),
    ],
)
def test_symbols_that_no_file_can_have(symbols: tuple[str, ...], why: str) -> None:
    profile = Profile("A", ProblemKind.DISCSP, (), (), {"X": ((0, 1),)}, {}, 1, 0, ())
    profile = msgspec.structs.replace(profile, symbols=symbols, symbolic=("X",))
    with pytest.raises(ProfileError, match=why):
        visible_robot(profile, {})
