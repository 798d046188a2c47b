"""One test per rule of AFC (Meisels, Zivan, Constraints 12(1), 2007), named for it."""

from __future__ import annotations

from random import Random

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.afc import AFC, FilteredDomain
from robochoc.protocols.satisfaction.afc_messages import CPA, Assignments, BacktrackCPA, FcCPA, NotOk
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import robot_of
from tests.support.brute_force import solutions
from tests.support.cases import cases
from tests.support.problems import random_team, team_of
from tests.support.small_teams import differ, odd_triple
from tests.support.spent import spent


def square(values: int = 3) -> Team:
    """A, B, C and D, each different from each; E differs from A and B only."""
    domains = {name: range(1, values + 1) for name in "ABCDE"}
    pairs = ("AB", "AC", "BC", "AD", "BD", "CD", "AE", "BE")
    return team_of(domains, [differ(*pair) for pair in pairs])


def agent(team: Team, name: str, *packet: Message) -> AFC:
    """The protocol object of one robot, started, which has read `packet`."""
    afc = robot_of(AFC, team, name)
    afc.start()
    if packet:
        told(afc, *packet)
    return afc


def told(afc: AFC, *packet: Message) -> list[tuple[str, Message]]:
    """What `afc` says to a packet, and has not said before."""
    afc.outbox.clear()
    for message in packet:
        afc.receive("somebody", message)
    afc.settle()
    return list(afc.outbox)


def values(*numbers: int) -> Assignments:
    return tuple((number,) for number in numbers)


# assign_CPA


def test_the_first_robot_makes_the_cpa_and_the_others_wait() -> None:
    team = square()
    said = [("RB", CPA(values(1), 1)), *((name, FcCPA(values(1), 1)) for name in ("RC", "RD", "RE"))]
    assert agent(team, "RA").outbox == said
    assert [agent(team, name).outbox for name in ("RB", "RE")] == [[], []]


def test_assign_cpa_counts_a_step_and_sends_the_cpa_to_the_next_robot_and_copies_to_all_below_it() -> None:
    afc = agent(square(), "RB")
    said = told(afc, CPA(values(1), 7))
    assert said == [("RC", CPA(values(1, 2), 8)), ("RD", FcCPA(values(1, 2), 8)), ("RE", FcCPA(values(1, 2), 8))]
    assert afc.assignment == {"B": 2}
    afc = agent(team_of(dict.fromkeys("ABC", (1, 2)), [differ("A", "C")]), "RB")
    assert told(afc, CPA(values(1), 1)) == [("RC", CPA(((1,), ()), 2))], "B has no constraint, and shows no variable"


def test_the_last_robot_concludes_that_a_solution_stands_and_one_with_an_empty_domain_that_there_is_none() -> None:
    afc = agent(square(4), "RE")
    assert told(afc, CPA(values(1, 2, 3, 4), 4)) == []
    assert (afc.verdict, afc.assignment) == (Verdict.SOLUTION, {"E": 3})
    alone = agent(team_of({"A": (1, 2)}, []), "RA")
    assert (alone.verdict, alone.assignment) == (Verdict.SOLUTION, {"A": 1}), "it is the first and the last"
    afc = agent(team_of({"A": (1, 2), "B": (), "C": (1,)}, []), "RB")
    assert afc.verdict is Verdict.NO_SOLUTION
    assert told(afc, CPA(values(1), 1)) == []


# receive_CPA


def test_backtrack_cpa_makes_the_robot_take_its_next_value_at_a_later_step_without_a_check() -> None:
    afc = agent(square(4), "RC", CPA(values(1, 2), 2))
    before = afc.problem.checks
    said = told(afc, BacktrackCPA(values(1, 2, 3), 30))
    assert said == [("RD", CPA(values(1, 2, 4), 31)), ("RE", FcCPA(values(1, 2, 4), 31))]
    assert afc.problem.checks == before
    assert [afc.tried(place) for place in range(4)] == [True, True, True, False]
    assert not agent(square(4), "RC").tried(0)


def test_a_value_once_tried_is_tried_again_only_under_another_cpa() -> None:
    """Also if the last one was never brought back: some robot below sent it back to A, past this robot."""
    afc = agent(square(), "RB", CPA(values(1), 1))
    assert told(afc, BacktrackCPA(values(1, 2), 2))[0] == ("RC", CPA(values(1, 3), 3))
    assert told(afc, BacktrackCPA(values(1, 3), 3)) == [("RA", BacktrackCPA(values(1), 3))]
    assert told(afc, CPA(values(2), 4))[0] == ("RC", CPA(values(2, 1), 5))
    assert told(afc, CPA(values(3), 6))[0] == ("RC", CPA(values(3, 1), 7))


def test_a_robot_that_has_tried_all_its_values_backtracks_to_the_robot_before() -> None:
    afc = agent(team_of({"A": (1,), "B": (1,), "C": (1,), "D": (1,)}, []), "RC", CPA(values(1, 1), 2))
    assert told(afc, BacktrackCPA(values(1, 1, 1), 3)) == [("RB", BacktrackCPA(values(1, 1), 3))]
    assert afc.assignment == {}


def test_a_robot_whose_domain_the_cpa_empties_backtracks_to_the_last_robot_that_did_harm() -> None:
    """A and B alone leave E no value: C and D are jumped over. What arrives late is not answered."""
    afc = agent(square(2), "RE")
    assert told(afc, CPA(values(1, 2, 1, 1), 4)) == [("RB", BacktrackCPA(values(1, 2), 4))]
    assert told(afc, FcCPA(values(1, 2), 2)) == []
    assert told(afc, NotOk(values(2, 2), 1)) == []


def test_the_first_robot_concludes_that_there_is_none_when_its_domain_is_exhausted() -> None:
    afc = agent(square(2), "RA")
    assert told(afc, BacktrackCPA(values(1), 5))[0] == ("RB", CPA(values(2), 6))
    assert told(afc, BacktrackCPA(values(2), 9)) == []
    assert afc.verdict is Verdict.NO_SOLUTION
    assert told(afc, BacktrackCPA(values(2), 9)) == [], "nothing is said after the verdict"


def test_who_gets_a_cpa_that_is_known_to_be_inconsistent_sends_it_back_without_a_check() -> None:
    """A `NotOk` in the packet of the CPA is read first. A CPA that does not go on from it is taken up."""
    afc = agent(square(), "RD", NotOk(values(1, 2), 2))
    assert told(afc, CPA(values(1, 2, 3), 3)) == [("RB", BacktrackCPA(values(1, 2), 3))]
    assert afc.problem.checks == 0
    said = told(agent(square(), "RD"), CPA(values(1, 2, 3), 3), NotOk(values(1), 3))
    assert said == [("RA", BacktrackCPA(values(1), 3))]
    afc = agent(square(4), "RC", NotOk(values(1), 1))
    assert told(afc, CPA(values(2, 1), 3))[0] == ("RD", CPA(values(2, 1, 3), 4))


def test_who_gets_a_cpa_back_that_is_known_to_be_inconsistent_above_sends_it_on() -> None:
    afc = agent(square(4), "RC", CPA(values(1, 2), 2))
    told(afc, NotOk(values(1), 1))
    assert told(afc, BacktrackCPA(values(1, 2, 3), 4)) == [("RA", BacktrackCPA(values(1), 4))]


# forward_check


def test_forward_check_says_nothing_while_a_value_is_left_and_checks_only_what_may_matter() -> None:
    forward_checks: list[tuple[list[list[Message]], int]] = [
        ([[FcCPA(values(1, 2), 2)]], 3 + 2),  # B is asked only about the values that A leaves
        ([[FcCPA(values(1), 1), FcCPA(values(2), 7)]], 3),  # of the copies in a packet only the latest
        ([[NotOk(values(1), 1)], [FcCPA(values(1, 2), 2)]], 0),  # it goes on from an inconsistent one
    ]
    for packets, checks in forward_checks:
        afc = agent(square(), "RE")
        assert [told(afc, *packet) for packet in packets] == [[]] * len(packets)
        assert afc.problem.checks == checks


def test_forward_check_tells_all_robots_without_a_value_in_the_shortest_inconsistent_assignment() -> None:
    said = told(agent(square(2), "RE"), FcCPA(values(1, 2, 1), 3))
    assert said == [("RC", NotOk(values(1, 2), 3)), ("RD", NotOk(values(1, 2), 3))]


def test_forward_check_says_an_inconsistent_assignment_once_and_starts_anew_with_another() -> None:
    afc = agent(square(2), "RE", FcCPA(values(1, 2), 2))
    before = afc.problem.checks
    assert told(afc, FcCPA(values(1, 2, 1), 3)) == []
    assert afc.problem.checks == before
    assert told(afc, FcCPA(values(2), 4)) == []
    assert told(afc, FcCPA(values(2, 1), 5)) == [("RC", NotOk(values(2, 1), 5)), ("RD", NotOk(values(2, 1), 5))]


def test_a_copy_of_an_earlier_step_is_ignored() -> None:
    afc = agent(square(2), "RE", FcCPA(values(2), 5))
    assert told(afc, FcCPA(values(1, 2), 4)) == []
    assert afc.view == values(2)


def test_a_copy_of_a_later_step_takes_the_own_value_and_a_late_copy_does_not() -> None:
    afc = agent(square(4), "RC", CPA(values(1, 2), 2))
    assert told(afc, FcCPA(values(1), 1)) == []
    assert afc.assignment == {"C": 3}
    told(afc, FcCPA(values(2), 9))
    assert afc.assignment == {}


# process_Not_OK


def test_a_not_ok_of_an_earlier_step_is_believed_when_the_view_goes_on_from_it() -> None:
    afc = agent(square(4), "RD", FcCPA(values(1, 2), 8))
    told(afc, NotOk(values(1), 3))
    assert told(afc, CPA(values(1, 2, 3), 9)) == [("RA", BacktrackCPA(values(1), 9))]


def test_a_not_ok_about_another_cpa_is_obsolete_if_earlier_and_ahead_of_its_copy_if_later() -> None:
    afc = agent(square(4), "RE", FcCPA(values(2), 8))
    told(afc, NotOk(values(1), 3))
    assert (afc.view, afc.sc, afc.consistent) == (values(2), 8, True)
    told(afc, NotOk(values(3, 1), 11))
    before = afc.problem.checks
    assert told(afc, FcCPA(values(3), 10), FcCPA(values(3, 1), 11)) == []
    assert (afc.view, afc.sc, afc.consistent) == (values(3, 1), 11, False)
    assert afc.problem.checks == before


def test_of_two_inconsistent_assignments_the_shorter_one_is_kept() -> None:
    afc = agent(square(4), "RD", NotOk(values(1), 2), NotOk(values(1, 2), 5))
    assert (afc.view, afc.sc) == (values(1), 5)
    told(afc, NotOk(values(3, 1), 9), NotOk(values(3), 8))
    assert (afc.view, afc.sc) == (values(3), 9)


# Ends


# What is checked, and what it costs


def test_an_n_ary_constraint_is_checked_once_the_cpa_names_all_its_other_robots() -> None:
    afc = agent(odd_triple(), "RC", FcCPA(values(1), 1))
    assert afc.problem.checks == 0
    assert told(afc, CPA(values(2, 2), 5)) == [("RB", BacktrackCPA(values(2, 2), 5))]


def test_a_longer_cpa_is_checked_only_for_what_is_new_and_a_shorter_one_restores_values_without_a_check() -> None:
    afc = agent(square(4), "RD")
    checks = 0
    for cpa, more in ((FcCPA(values(1), 1), 4), (FcCPA(values(1, 2), 2), 3), (CPA(values(1, 2, 3), 3), 2)):
        told(afc, cpa)
        checks += more
        assert afc.problem.checks == checks
    afc.domain.filter(values(1))
    assert [afc.domain.first(place) for place in range(4)] == [1, 1, 2, 3]
    assert afc.problem.checks == checks


def test_filtering_step_by_step_finds_what_filtering_afresh_finds() -> None:
    for seed in range(20):
        chance = Random(f"filter {seed}")
        team = random_team(chance)
        order = PriorityOrder(team.order)
        part = agent_problems(team)[order.names[-1]]
        above = [LocalProblem(agent_problems(team)[name]).values for name in order.names[:-1]]
        if not all(above):
            continue
        domain = FilteredDomain(LocalProblem(part), order)
        for _ in range(50):
            assignments = tuple(chance.choice(own[:2]) for own in above[: chance.randint(0, len(above))])
            domain.filter(assignments)
            fresh = LocalProblem(part)
            view = dict(zip(order.names, assignments, strict=False))
            conflicts = [fresh.conflict(index, view) for index in range(len(fresh.values))]
            left = [index for index, conflict in enumerate(conflicts) if conflict is None]
            assert [index for index in range(len(conflicts)) if domain.first(index) == index] == left
            depths = [order.depth(conflict) + 1 for conflict in conflicts if conflict is not None]
            assert domain.inconsistent() == (None if left else assignments[: max(depths, default=0)])


def test_whatever_the_delays_it_is_the_first_solution_in_the_order_of_robots_and_values() -> None:
    with cases() as each:
        for seed in range(40):
            team = random_team(Random(f"first {seed}"))
            truth = next(solutions(team), None)
            for schedule in (RandomChannels(seed), *(Concurrent(seed, delay) for delay in (0, 3, 20, 200))):
                with each(f"{seed} {schedule}"):
                    result = Simulation(team, AFC, schedule).run()
                    assert result.verdict is (Verdict.NO_SOLUTION if truth is None else Verdict.SOLUTION)
                    if truth is not None:
                        assert {name: one for own in result.assignments.values() for name, one in own.items()} == truth


def test_forward_checking_saves_steps_of_the_cpa() -> None:
    teams = [random_team(Random(seed)) for seed in range(40)]
    assert spent(teams, "afc").by_type["CPA"] < spent(teams, "sbt").by_type["CPA"]
