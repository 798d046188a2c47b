"""One test per rule of AFC-ng (Wahbi et al., Constraints 18(3), 2013, Section 3), named for it."""

from __future__ import annotations

from functools import partial
from random import Random
from typing import ClassVar

from robochoc.communication.host import message_decoder
from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint
from robochoc.protocols.message import Message, Value, encode
from robochoc.protocols.satisfaction.afc_ng import AFCng, first_difference
from robochoc.protocols.satisfaction.afc_ng_messages import CPA, Solved
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.complex_problems import complex_team
from tests.support.problems import random_team, team_of
from tests.support.small_teams import DIFFERENT, different, odd_triple, triangle

agent = partial(started_robot, AFCng)


def cpa(*assignments: tuple[int, int]) -> CPA:
    """A CPA of robots with one variable each: their values and counters."""
    return CPA(tuple(((value,), counter) for value, counter in assignments))


def test_the_first_robot_begins() -> None:
    assert started(robot_of(AFCng, triangle(), "RA")) == [("RB", cpa((1, 1))), ("RC", cpa((1, 1)))]
    second = robot_of(AFCng, triangle(), "RB")
    assert (started(second), second.value) == ([], None)


def test_the_predecessor_s_cpa_lets_a_robot_assign_and_each_assignment_raises_the_own_counter() -> None:
    afc = agent(triangle(3), "RB")
    assert replies(afc, ("RA", cpa((1, 1)))) == [("RC", cpa((1, 1), (2, 1)))]
    assert replies(afc, ("RA", cpa((2, 2)))) == [("RC", cpa((2, 2), (1, 2)))]


def test_another_robot_s_cpa_only_checks_forward_and_values_that_are_known_already_are_not_checked_again() -> None:
    afc = agent(triangle(3), "RC")
    assert replies(afc, ("RA", cpa((1, 1)))) == []
    assert value(afc) is None
    assert list(afc.store) == [{"RA": (1,)}]
    before = afc.problem.checks
    assert replies(afc, ("RA", cpa((1, 2)))) == []
    assert afc.problem.checks == before
    assert list(afc.store) == [{"RA": (1,)}]
    replies(afc, ("RB", cpa((1, 2), (3, 1))))
    assert afc.counters == [2, 1]


def test_a_cpa_goes_to_the_next_robot_and_to_those_that_share_a_constraint() -> None:
    said = started(robot_of(AFCng, different("ABCDE", "AD AE BC", 2), "RA"))
    assert [receiver for receiver, _ in said] == ["RB", "RD", "RE"]


def test_the_first_counter_that_differs_decides_which_cpa_is_stronger() -> None:
    afc = agent(triangle(3), "RC", ("RB", cpa((1, 2), (2, 1))))
    assert replies(afc, ("RB", cpa((2, 1), (1, 9)))) == []
    assert afc.view == {"RA": (1,), "RB": (2,)}
    assert replies(afc, ("RB", cpa((2, 3), (1, 1)))) == [("RD", cpa((2, 3), (1, 1), (3, 2)))]


def test_only_a_stronger_cpa_takes_the_value_and_what_was_known_of_robots_below_its_sender_but_counters() -> None:
    afc = agent(triangle(3), "RC", ("RB", cpa((1, 1), (2, 4))))
    assert replies(afc, ("RA", cpa((1, 1)))) == [], "it has the counters of the view"
    assert afc.view == {"RA": (1,), "RB": (2,)}
    assert value(afc) == (3,)
    assert replies(afc, ("RA", cpa((3, 2)))) == []
    assert afc.view == {"RA": (3,)}
    assert (value(afc), afc.counters) == (None, [2, 4])
    assert list(afc.store) == [{"RA": (3,)}]


def test_nogoods_that_agree_with_the_new_view_stay_and_are_not_checked_again() -> None:
    afc = agent(triangle(3), "RC", ("RB", cpa((1, 1), (2, 1))))
    checks = afc.problem.checks
    replies(afc, ("RB", cpa((1, 1), (3, 2))))
    assert list(afc.store) == [{"RA": (1,)}, {"RB": (3,)}]
    assert afc.problem.checks == checks + 2  # two values are left, and only RB's value is new
    afc = agent(triangle(3), "RC")
    assert replies(afc, ("RA", cpa((1, 1))), ("RB", cpa((1, 1), (2, 1))), ("RA", cpa((2, 2)))) == []
    assert afc.problem.checks == 3, "a packet is revised by its strongest CPA alone"


def test_nogoods_stay_when_only_a_variable_that_does_not_matter_to_them_has_changed() -> None:
    owned = {"R1": ("A", "B"), "R2": ("C",), "R3": ("D",)}
    constraints = [Constraint("C", DIFFERENT, pair, pair) for pair in (("A", "D"), ("B", "C"))]
    afc = agent(complex_team(owned, dict.fromkeys("ABCD", (1, 2)), constraints), "R3", ("R1", CPA((((1, 1), 1),))))
    checks = afc.problem.checks
    replies(afc, ("R1", CPA((((1, 2), 2),))))
    assert list(afc.store) == [{"R1": (1, None)}]
    assert afc.problem.checks == checks + 1


def test_the_better_of_two_nogoods_for_a_value_is_kept() -> None:
    """Of two conflicts that is the one with the highest lowest robot."""
    afc = agent(different("ABC", "AC BC", 3), "RC", ("RB", cpa((1, 1), (1, 1))))
    assert list(afc.store) == [{"RA": (1,)}]
    afc = agent(different("ABCD", "AD BD CD", 3), "RC", ("RB", cpa((1, 1), (2, 1))))
    replies(afc, ("RD", Nogood({"RA": (1,)}, (3,))), ("RD", Nogood({"RA": (1,), "RB": (2,)}, (3,))))
    assert list(afc.store) == [{"RA": (1,)}]


def test_an_n_ary_constraint_is_checked_when_all_its_robots_are_known() -> None:
    afc = agent(odd_triple(), "RC", ("RA", cpa((1, 1))))
    assert afc.problem.checks == 0
    replies(afc, ("RB", cpa((1, 1), (1, 1))))
    assert value(afc) == (2,)
    assert list(afc.store) == [{"RA": (1,), "RB": (1,)}]


def test_backtrack_tells_the_lowest_cause_and_forgets_it_and_all_below_it_but_not_their_counters() -> None:
    afc = agent(different("ABCD", "AD BD CD", 2), "RD")
    said = replies(afc, ("RB", cpa((1, 1), (2, 1))))
    assert said == [("RB", Nogood({"RA": (1,)}, (2,)))], "before the CPA has come"
    afc = agent(different("ABCD", "AD BD CD", 2), "RD", ("RC", cpa((1, 1), (2, 1), (1, 3))))
    assert afc.view == {"RA": (1,)}
    assert afc.counters == [1, 1, 3]
    assert list(afc.store) == [{"RA": (1,)}]
    assert replies(afc, ("RC", cpa((1, 1), (2, 1), (1, 3)))) == []


def test_a_compatible_nogood_about_the_value_makes_the_robot_take_another_and_one_about_another_is_stored() -> None:
    afc = agent(triangle(3), "RB", ("RA", cpa((1, 1))))
    assert replies(afc, ("RC", Nogood({"RA": (1,)}, (3,)))) == []
    assert list(afc.store) == [{"RA": (1,)}] * 2
    afc = agent(triangle(3), "RB", ("RA", cpa((1, 1))))
    assert replies(afc, ("RC", Nogood({"RA": (1,)}, (2,)))) == [("RC", cpa((1, 1), (3, 2)))]


def test_a_nogood_that_does_not_agree_with_the_view_is_ignored() -> None:
    for known in ([("RA", cpa((2, 1)))], []):
        afc = agent(triangle(3), "RB", *known)
        before = list(afc.store)
        assert replies(afc, ("RC", Nogood({"RA": (1,)}, (1,)))) == []
        assert list(afc.store) == before


def test_an_empty_nogood_or_domain_ends_the_search_without_solution() -> None:
    afc = agent(triangle(1), "RA")
    assert replies(afc, ("RB", Nogood({}, (1,)))) == []
    assert afc.verdict is Verdict.NO_SOLUTION
    assert agent(team_of({"A": (1, 2), "B": (), "C": (1,)}, []), "RB").verdict is Verdict.NO_SOLUTION


def test_a_robot_alone_solves_its_problem_in_silence() -> None:
    afc = robot_of(AFCng, team_of({"A": (4, 5)}, []), "RA")
    assert (started(afc), afc.assignment) == ([], {"A": 4})


def test_the_last_robot_s_value_makes_a_solution_and_who_is_told_it_takes_its_value_and_is_silent() -> None:
    solution: dict[str, Value] = {"RA": (1,), "RB": (2,), "RC": (3,), "RD": (1,)}
    said = replies(agent(triangle(3), "RD"), ("RC", cpa((1, 1), (2, 1), (3, 1))))
    assert said == [(name, Solved(solution)) for name in ("RA", "RB", "RC")]
    afc = agent(triangle(3), "RB", ("RA", cpa((1, 1))))
    told = ("RD", Solved({**solution, "RB": (3,), "RC": (2,)}))
    assert replies(afc, told, ("RA", cpa((2, 2))), ("RC", Nogood({}, (3,)))) == []
    assert value(afc) == (3,)


class HoldsTheSolution(AFCng):
    """Has to hold the value of the solution already when it is told of it."""

    def receive(self, sender: str, message: Message) -> None:
        if isinstance(message, Solved):
            assert self.assignment
            assert value(self) == message.solution[self.problem.agent]
        super().receive(sender, message)


def test_all_robots_hold_the_values_of_a_solution_when_it_is_found() -> None:
    chance = Random("held")
    results = [Simulation(random_team(chance), HoldsTheSolution, RandomChannels(seed)).run(60) for seed in range(150)]
    assert sum("Solved" in result.metrics.messages for result in results) > 50


class IsSharedAsItTravels(AFCng):
    """Has to say what its receivers would decode, as in the simulator they get it as it is."""

    heard: ClassVar[list[Message]] = []

    def send(self, receiver: str, message: Message) -> None:
        assert message_decoder(self.messages).decode(encode(message)) == message
        super().send(receiver, message)

    def receive(self, sender: str, message: Message) -> None:
        self.heard.append(message)
        super().receive(sender, message)


def test_receivers_of_a_cpa_share_it_in_the_simulator() -> None:
    IsSharedAsItTravels.heard.clear()
    Simulation(different("ABCD", "AC AD BC BD", 2), IsSharedAsItTravels, RandomChannels(0)).run()
    heard = IsSharedAsItTravels.heard
    cpas = [message for message in heard if isinstance(message, CPA)]
    assert len(cpas) > len({message.assignments for message in cpas}) == len({id(message) for message in cpas})


def test_long_partial_assignments_are_compared_as_short_ones() -> None:
    chance = Random("long")
    for _ in range(200):
        left = (((1,), 1),) * chance.randrange(200)
        right = left[: chance.randrange(len(left) + 1)] + (((1,), chance.randrange(1, 3)),) * chance.randrange(3)
        differ = [place for place, (one, other) in enumerate(zip(left, right, strict=False)) if one != other]
        assert first_difference(left, right) == min([*differ, len(left), len(right)])
