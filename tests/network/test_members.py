"""Who is registered: once, in one life, as long as the team is open."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import msgspec
import pytest

from robochoc.communication.network.members import NetworkMembers, RegistrationRefusedError
from robochoc.communication.network.profile import Profile, Ranges
from robochoc.formats import PREDEFINED
from robochoc.model.problem import Constraint, Predicate, ProblemKind
from robochoc.protocols.traits import Traits
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team, team_of
from tests.support.sparse_teams import profiles_of

TRIANGLE = [Constraint("C", PREDEFINED["ne"], pair, pair) for pair in (("A", "B"), ("A", "C"), ("B", "C"))]
PROFILES = profiles_of(team_of(dict.fromkeys("ABC", (1, 2)), TRIANGLE))
RA, RB, RC = PROFILES


def join(members: NetworkMembers, *names: str, incarnation: str = "first") -> None:
    for name in names:
        members.register(name, PROFILES[name], incarnation).joined = True


def refused(members: NetworkMembers, name: str, profile: Profile, incarnation: str = "first") -> str:
    before = dict(members.robots)
    with pytest.raises(RegistrationRefusedError) as caught:
        members.register(name, profile, incarnation)
    assert members.robots == before
    return str(caught.value)


def test_registering_twice_is_registering_once() -> None:
    members = NetworkMembers()
    first = members.register(RA, PROFILES[RA], "first")
    assert members.register(RA, PROFILES[RA], "first") is first
    first.joined = True
    members.closed = True
    assert members.register(RA, PROFILES[RA], "first") is first


def test_a_name_is_one_robots() -> None:
    members = NetworkMembers()
    join(members, RA)
    assert refused(members, RA, PROFILES[RA], "second") == f"a robot called {RA} is registered already"


def test_who_was_away_may_come_in_another_life_while_the_team_is_open() -> None:
    members = NetworkMembers()
    join(members, RA)
    members.robots[RA].away_since = 12.5
    now = members.register(RA, PROFILES[RA], "second")
    assert (now.incarnation, now.joined, now.away_since) == ("second", False, None)
    now.away_since = 13.5
    assert "restart it" in refused(members, RA, PROFILES[RA], "first")
    members.closed = True
    assert "registered already" in refused(members, RA, PROFILES[RA], "third")


def test_who_was_given_up_comes_in_another_life_or_not_at_all() -> None:
    members = NetworkMembers()
    join(members, RA)
    members.remove([RA, "nobody"])
    assert "absent for too long: restart it" in refused(members, RA, PROFILES[RA], "first")
    assert members.register(RA, PROFILES[RA], "second").incarnation == "second"


def test_a_certificate_is_for_one_file() -> None:
    members = NetworkMembers()
    assert refused(members, RB, PROFILES[RA]) == f"its file is '{RA}''s, and its certificate {RB}'s"
    long = msgspec.structs.replace(PROFILES[RA], name="R" * 5000)
    assert len(refused(members, RB, long)) < 200


def test_strangers_are_not_taken_where_robots_are_expected() -> None:
    assert refused(NetworkMembers([RA, RB]), RC, PROFILES[RC]) == "it is not a member of the team"


def test_nobody_is_taken_once_the_team_is_closed() -> None:
    members = NetworkMembers([RA, RB, RC])
    join(members, RA, RB)
    members.closed = True
    assert refused(members, RC, PROFILES[RC]) == "the team is complete without it"


def test_absurd_profiles_and_contradictions_are_not_taken() -> None:
    members = NetworkMembers()
    join(members, RA)
    assert "not a valid name" in refused(members, RB, msgspec.structs.replace(PROFILES[RB], children=("?",)))
    stranger = msgspec.structs.replace(PROFILES[RB], parents=())
    assert "does not list it as a parent" in refused(members, RB, stranger)
    join(members, RB)


def test_who_comes_again_is_not_held_against_its_former_life() -> None:
    members = NetworkMembers()
    join(members, RA)
    members.robots[RA].away_since = 1.0
    other = msgspec.structs.replace(PROFILES[RA], children=(), variables={}, kind=ProblemKind.DISWCSP)
    assert members.register(RA, other, "second").profile is other


# When the team is complete


def test_complete_when_all_who_are_expected_are_there() -> None:
    members = NetworkMembers([RA, RB, RC])
    assert members.awaited == {RA, RB, RC}
    join(members, RC, RA)
    assert members.awaited == {RB}
    assert not members.complete
    join(members, RB)
    assert members.complete


def test_complete_when_all_neighbours_are_there() -> None:
    members = NetworkMembers()
    assert not members.complete
    join(members, RC)
    assert members.awaited == {RA, RB}
    join(members, RA, RB)
    assert members.complete


def test_complete_when_so_many_are_there_and_all_their_neighbours() -> None:
    lonely = Profile("RZ", ProblemKind.DISCSP, (), (), {}, {}, 1, 0, ())
    members = NetworkMembers(number=2)
    members.register("RZ", lonely, "first").joined = True
    assert not members.awaited
    assert not members.complete
    join(members, RA)
    assert not members.complete
    join(members, RB, RC)
    assert members.complete


def test_complete_when_all_have_read_their_welcome() -> None:
    members = NetworkMembers()
    join(members, RA, RB, RC)
    members.robots[RB].joined = False
    assert not members.complete


def test_an_open_team_misses_who_is_given_up() -> None:
    members = NetworkMembers()
    join(members, RA, RB, RC)
    members.remove([RB])
    assert members.awaited == {RB}
    assert not members.complete


def test_a_robot_that_has_dropped_out_is_waited_for_by_name_until_it_is_back() -> None:
    members = NetworkMembers(number=4)
    join(members, RA, RB)
    members.drop_out(RB)
    assert members.waited_for == [f"{RB} (it was there, and has dropped out)", RC, "1 more robot"]
    members.register(RB, PROFILES[RB], "second")
    assert members.waited_for == [RC, f"{RB} (it has registered, and does not answer)", "1 more robot"]
    join(members, RB, RC, incarnation="second")
    assert members.waited_for == ["1 more robot"]


# What others want to see


def looked_at() -> dict[str, Profile]:
    upper = Profile("A", ProblemKind.DISCSP, (), ("B",), {"X": ((1, 2),)}, {"B": ("Y", "Z")}, 1, 0, ())
    lower = Profile("B", ProblemKind.DISCSP, ("A",), (), {"Y": ((1, 2),)}, {}, 1, 0, ())
    return {"A": upper, "B": lower}


def test_the_team_of_an_earlier_master() -> None:
    members = NetworkMembers(number=1)
    join(members, RA, RC, incarnation="life")
    assert members.expect([RA, RB]) == {RC: "life"}
    assert set(members.robots) == {RA}
    assert refused(members, RC, PROFILES[RC], "second") == "it is not a member of the team"
    assert members.awaited == {RB, RC}
    members.give_up([RB, RC])
    assert members.complete
    assert not members.unseen()
    assert list(members.invalid_scopes()) == []


def test_variables_that_a_parent_looks_at_are_shown() -> None:
    members = NetworkMembers()
    members.register("A", looked_at()["A"], "first")
    assert members.unseen() == {}
    members.register("B", looked_at()["B"], "first")
    assert members.unseen() == {"B": ("Z",)}
    members.robots["B"].shown_later["Z"] = ((3, 4),)
    assert members.unseen() == {}
    task = members.tasks(1, "abt", Traits(), DEFAULT_PARAMETERS)["A"]
    assert task.interfaces == {"A": ("X",), "B": ("Y", "Z")}
    assert task.domains["Z"] == ((3, 4),)


def test_who_is_no_child_is_not_asked_to_show_anything() -> None:
    members = NetworkMembers()
    members.register("B", looked_at()["B"], "first")
    spy = Profile("S", ProblemKind.DISCSP, (), (), {}, {"B": ("Secret",)}, 1, 0, ())
    assert "refers to variables of B, which is not a child" in refused(members, "S", spy)
    assert members.unseen() == {}


def robot(
    name: str,
    parents: tuple[str, ...] = (),
    children: tuple[str, ...] = (),
    shown: str = "",
    wants: tuple[str, ...] = (),
) -> Profile:
    variables: dict[str, Ranges] = {shown: ((1, 2),)} if shown else {}
    return Profile(name, ProblemKind.DISCSP, parents, children, variables, {}, 1, 0, (), wants)


def test_what_a_childs_constraints_look_at_is_asked_for_whether_its_parent_says_so_or_not() -> None:
    members = NetworkMembers()
    members.register("A", robot("A", children=("B",)), "first")
    members.register("B", robot("B", parents=("A",), shown="Y", wants=("X",)), "first")
    assert members.unseen() == {"A": ("X",)}
    assert (
        members.show("A", {"X": ((1, 3),), "Secret": ((1, 1),)}) == "it has disclosed variables that were not requested"
    )
    assert members.show("A", {"X": ((1, 3),)}) == ""
    assert not members.unseen()
    assert not list(members.invalid_scopes())
    assert members.tasks(1, "abt", Traits(), DEFAULT_PARAMETERS)["B"].interfaces == {"A": ("X",), "B": ("Y",)}


def test_real_numbers_that_are_disclosed_later_have_decimals() -> None:
    members = NetworkMembers()
    members.register("A", robot("A", children=("B",)), "first")
    members.register("B", robot("B", parents=("A",), shown="Y", wants=("X",)), "first")
    assert members.show("A", {"X": ((100, 100), (300, 300))}, real_places={"X": 9}).startswith("real numbers have 0 to")
    assert members.show("A", {"X": ((1, 3),)}, symbolic=["X"]) == "a value of X is not the code of a symbol"
    assert members.show("A", {"X": ((1, 3),)}, real_places={"Z": 1}).startswith("it has disclosed variables that were")
    assert members.show("A", {"X": ((100, 100), (300, 300))}, real_places={"X": 2}) == ""
    (x,) = members.robots["A"].robot.variables
    assert x.domain.label(300) == 3.0


def test_two_that_show_one_variable_are_both_named() -> None:
    members = NetworkMembers()
    for name in ("A", "C"):
        members.register(name, robot(name, children=("B",)), "first")
    members.register("B", robot("B", parents=("A", "C"), shown="Y", wants=("X",)), "first")
    assert members.unseen() == {"A": ("X",), "C": ("X",)}
    assert members.show("A", {"X": ((1, 3),)}) == ""
    assert members.show("C", {"X": ((1, 3),)}) == "the variable X is A's, and C's too"


def test_a_constraint_over_what_no_neighbour_has_is_told() -> None:
    members = NetworkMembers()
    members.register("A", robot("A", children=("B",)), "first")
    members.register("B", robot("B", parents=("A",), shown="Y", wants=("V9",)), "first")
    assert members.unseen() == {"A": ("V9",)}
    assert members.show("A", {}) == ""
    assert not members.unseen()
    assert list(members.invalid_scopes()) == ["B has a constraint over V9, which is not a variable of a neighbour"]


def test_who_may_only_ask_does_not_take_part() -> None:
    with pytest.raises(RegistrationRefusedError, match="enrolled as an observer"):
        NetworkMembers().register("A", robot("A"), "first", admitted=False)


def test_a_robot_that_was_away_may_come_back_in_another_life() -> None:
    members = NetworkMembers()
    members.register("A", robot("A"), "first")
    with pytest.raises(RegistrationRefusedError, match="registered already"):
        members.register("A", robot("A"), "second")
    members.robots["A"].unconfirmed = True
    assert members.register("A", robot("A"), "second").incarnation == "second"


def test_a_team_is_not_complete_while_one_that_has_come_is_away_or_may_be_another() -> None:
    members = NetworkMembers()
    member = members.register("A", robot("A"), "first")
    steps: list[tuple[Callable[[], object], bool, dict[str, str]]] = [
        (lambda: member.join("another's", b""), False, {"A": "first"}),
        (lambda: member.join("first", b""), True, {}),
        (lambda: member.note_presence(there=False), False, {}),
        (lambda: member.note_presence(there=True), False, {"A": "first"}),
        (lambda: member.join("first", b""), True, {}),
        (lambda: member.note_presence(there=False), False, {}),
        (lambda: members.register("A", robot("A"), "first"), True, {}),
    ]
    for step, complete, to_welcome in steps:
        step()
        assert (members.complete, members.to_welcome()) == (complete, to_welcome)


# What is told at the end


def test_a_neighbourhood_is_what_sharers_of_constraints_show() -> None:
    any_three = Predicate("any", ("X", "Y", "Z"), PREDEFINED["ne"].body)
    scope = ("A", "B", "C")
    team = team_of(dict.fromkeys((*scope, "D"), (1, 2)), [Constraint("C", any_three, scope, scope)])
    members = NetworkMembers()
    for name, profile in profiles_of(team).items():
        members.register(name, profile, "first")
    values = {"RA": {"A": 1, "Hidden": 7}, "RB": {"B": 2}, "RC": {"C": 1}, "RD": {"D": 2}, "RX": {"A": 9}}
    assert members.neighbourhood("RA", values) == {"B": 2, "C": 1}
    assert members.neighbourhood("RC", values) == {"A": 1, "B": 2}
    assert members.neighbourhood("RD", values) == {}
    members.remove(["RB"])
    assert members.neighbourhood("RA", values) == {"C": 1}


def test_all_kinds_of_teams_are_taken_in_any_order() -> None:
    for seed in range(20):
        for make in (random_team, random_pkc_team):
            chance = Random(seed)
            profiles = list(profiles_of(make(chance)).items())
            chance.shuffle(profiles)
            members = NetworkMembers([name for name, _ in profiles])
            for name, profile in profiles:
                assert not members.complete
                members.register(name, profile, "incarnation").joined = True
            assert members.complete
