"""One test per rule of AFB with backjumping (Gershman, Meisels, Zivan, JAIR 34, 2009), named for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.findings import Findings, Incumbent
from robochoc.protocols.message import Value
from robochoc.protocols.optimization.afb import AFB, CPA, FBCPA, FBEstimate, NewSolution, Terminate
from robochoc.protocols.optimization.afb_bounds import Cost
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.problems import team_of


def priced(scope: str, costs: Mapping[tuple[int, ...], float], default: float = 0) -> Constraint:
    """What is not listed costs `default`."""
    relation = Relation("R", len(scope), Semantics.SOFT, tuple(costs), tuple(costs.values()), default)
    return Constraint("C", relation, tuple(scope), tuple(scope))


def same(scope: str, cost: float) -> Constraint:
    """It costs that two robots take the same of two values."""
    return priced(scope, {(1, 1): cost, (2, 2): cost})


def chain() -> Team:
    """Four robots of two values: A with C and D, B with C, C with D; A pays 1 for its second value."""
    constraints = [same("AC", 4), same("AD", 3), same("BC", 2), same("CD", 5), priced("A", {(2,): 1})]
    return team_of(dict.fromkeys("ABCD", (1, 2)), constraints)


agent = partial(started_robot, AFB)


Assigned = tuple[int, int]


def assigned(*assignments: Assigned) -> list[tuple[Value, int]]:
    """Assignments of robots with one variable each: their values and counters."""
    return [((own,), counter) for own, counter in assignments]


def cpa(*assignments: Assigned, least: list[Cost], bound: Cost = math.inf) -> CPA:
    return CPA(assigned(*assignments), bound, least)


def back(*assignments: Assigned, bound: Cost = math.inf) -> CPA:
    return CPA(assigned(*assignments), bound, [])


def asks(*assignments: Assigned) -> FBCPA:
    return FBCPA(assigned(*assignments))


def solution(cost: Cost, *values: int) -> NewSolution:
    return NewSolution([(own,) for own in values], cost)


# The CPA goes on


def test_the_first_robot_generates_the_cpa_and_asks_all_others_for_estimates() -> None:
    asked = [("RC", asks((1, 1))), ("RD", asks((1, 1)))]
    assert started(robot_of(AFB, chain(), "RA")) == [("RB", cpa((1, 1), least=[0, 0])), *asked]
    assert agent(chain(), "RB").value is None


def test_the_next_robot_adds_a_value_and_answers_and_each_assignment_raises_the_own_counter() -> None:
    robot = agent(chain(), "RB")
    assert replies(robot, ("RA", cpa((1, 1), least=[0, 0]))) == [
        ("RC", cpa((1, 1), (1, 1), least=[0, 0, 0])),
        ("RD", asks((1, 1), (1, 1))),
        ("RA", FBEstimate([1], [0])),
    ]
    said = replies(robot, ("RC", back((1, 1), (1, 1))))
    assert said[0] == ("RC", cpa((1, 1), (2, 2), least=[0, 0, 0]))


def test_values_are_tried_the_cheapest_first_and_none_with_which_the_cpa_costs_as_much_as_b() -> None:
    robot = agent(chain(), "RC")
    said = replies(robot, ("RB", cpa((1, 1), (2, 1), least=[0, 0, 0])))
    assert value(robot) == (2,)  # 2, and not 4
    assert said[0] == ("RD", cpa((1, 1), (2, 1), (2, 1), least=[0, 0, 2, 2]))
    given_back = [("RB", back((1, 1), (2, 1), bound=2))]
    assert replies(robot, ("RD", solution(2, 1, 2, 2, 1))) == given_back, "b falls"
    robot = agent(chain(), "RC")
    assert replies(robot, ("RB", cpa((1, 1), (2, 1), least=[0, 0, 0], bound=2))) == given_back
    assert value(robot) is None


def test_a_cpa_that_costs_as_much_as_b_goes_back_without_a_look_at_any_value() -> None:
    robot = agent(chain(), "RD", ("RC", solution(3, 1, 1, 1, 1)))
    before = robot.problem.checks
    assert replies(robot, ("RC", cpa((1, 1), (2, 1), (2, 1), least=[0, 0, 2, 3]))) == [
        ("RC", back((1, 1), (2, 1), (2, 1), bound=3))
    ]
    assert robot.problem.checks == before


# Estimates


def test_an_estimate_is_what_the_cheapest_value_costs_with_each_beginning_of_the_cpa() -> None:
    """The part that a CPA has in common with the last one is not priced again."""
    robot = agent(chain(), "RC", ("RA", asks((1, 1))))
    before = robot.problem.checks
    assert replies(robot, ("RB", asks((1, 1), (2, 1)))) == [("RB", FBEstimate([1, 1], [0, 0, 2]))]
    assert value(robot) is None
    assert robot.problem.checks == before + 2
    replies(robot, ("RB", asks((1, 1), (2, 1))), ("RB", cpa((1, 1), (2, 1), least=[0, 0, 0])))
    assert robot.problem.checks == before + 2


def test_what_lower_robots_cost_at_least_is_in_the_estimate_unless_they_may_step_aside() -> None:
    """B pays 3 to C at least for its first value, 1 for its second, whatever C takes."""
    constraints = [priced("BC", {(1, 1): 4, (1, 2): 3, (2, 1): 1, (2, 2): 2}), priced("AB", {(1, 2): 7})]
    team = team_of(dict.fromkeys("ABC", (1, 2)), constraints)
    assert replies(agent(team, "RB"), ("RA", cpa((1, 1), least=[0, 0]))) == [
        ("RC", cpa((1, 1), (1, 1), least=[1, 3, 0])),
        ("RA", FBEstimate([1], [1, 3])),
    ]
    assert agent(team, "RC").costs.estimates == [0]
    team = team_of(dict.fromkeys("AB", (1, 2)), [priced("AB", {}, 5)])
    assert agent(team, "RA", parameters=RunParameters(withdrawal_cost=9)).costs.estimates == [0]


def test_an_n_ary_constraint_is_in_one_estimate_only() -> None:
    """The highest robot of the scope looks ahead, the lowest pays."""
    team = team_of(dict.fromkeys("ABC", (1, 2)), [priced("ABC", {}, 5)])
    assert [agent(team, name).costs.estimates for name in ("RA", "RB", "RC")] == [[5], [0], [0]]
    assert replies(agent(team, "RB"), ("RA", cpa((1, 1), least=[5, 0])))[0] == (
        "RC",
        cpa((1, 1), (1, 1), least=[5, 0, 0]),
    )
    assert replies(agent(team, "RC"), ("RB", asks((1, 1), (1, 1)))) == [("RB", FBEstimate([1, 1], [0, 0, 5]))]


def test_who_has_nothing_new_to_say_is_silent() -> None:
    robot = agent(chain(), "RD")
    assert replies(robot, ("RB", asks((1, 1), (1, 1)))) == [("RB", FBEstimate([1, 1], [0, 0]))]
    assert replies(robot, ("RB", asks((2, 2), (1, 2)))) == []


def test_a_robot_is_asked_only_when_its_estimate_may_have_changed() -> None:
    """D has no constraint with B, and has told so by the length of its answer."""
    robot = agent(chain(), "RB", ("RA", cpa((1, 1), least=[0, 0])))
    replies(robot, ("RD", FBEstimate([1, 1], [0, 0])))
    assert [receiver for receiver, _ in replies(robot, ("RC", back((1, 1), (1, 1))))] == ["RC"]
    assert [receiver for receiver, _ in replies(robot, ("RA", cpa((2, 2), least=[0, 1])))] == ["RC", "RD"]


def test_the_cpa_and_estimates_that_cost_as_much_as_b_make_the_next_value_be_taken_wherever_the_cpa_is() -> None:
    """An estimate for another CPA counts so far as the CPA is still the same; the own value is another one."""
    packet = [("RD", solution(6, 2, 2, 1, 2)), ("RA", cpa((1, 1), least=[0, 0]))]
    robot = agent(chain(), "RB", *packet)
    assert replies(robot, ("RC", FBEstimate([1, 1], [0, 0, 3]))) == []
    said = replies(robot, ("RD", FBEstimate([1, 1], [0, 3])))
    assert said[0] == ("RC", cpa((1, 1), (2, 2), least=[0, 0, 0], bound=6))
    robot = agent(chain(), "RB", *packet)
    replies(robot, ("RC", back((1, 1), (1, 1))))
    assert replies(robot, ("RC", FBEstimate([1, 1], [0, 0, 9]))) == []
    assert replies(robot, ("RD", FBEstimate([1, 1], [0, 6]))) == [("RA", back((1, 1), bound=6))]


# Back


def test_without_a_value_left_the_cpa_goes_back_to_the_robot_before() -> None:
    robot = agent(chain(), "RB", ("RA", cpa((1, 1), least=[0, 0])))
    replies(robot, ("RC", back((1, 1), (1, 1))))
    assert replies(robot, ("RD", back((1, 1), (1, 1)))) == [], "another value has been taken since"
    assert value(robot) == (2,)
    assert replies(robot, ("RC", back((1, 1), (2, 2)))) == [("RA", back((1, 1)))]


def test_the_cpa_jumps_back_to_the_last_robot_of_the_shortest_beginning_that_costs_too_much() -> None:
    """Each value of C costs 4 with A = 1 already; so B is passed over."""
    constraints = [priced("AC", {(1, 1): 4, (1, 2): 4}), same("BC", 1)]
    robot = agent(team_of(dict.fromkeys("ABC", (1, 2)), constraints), "RC", ("RA", solution(4, 2, 1, 1)))
    assert replies(robot, ("RB", cpa((1, 1), (2, 1), least=[0, 0, 0]))) == [("RA", back((1, 1), bound=4))]


def test_what_robots_in_between_and_below_cost_counts_for_the_jump_as_well() -> None:
    """With A = 1, robots between cost 2 at least, C costs 1 and D 3: that is B."""
    robot = agent(team_of(dict.fromkeys("ABCD", (1, 2)), [priced("AC", {}, 1), same("BC", 1), same("AD", 1)]), "RC")
    replies(robot, ("RB", cpa((1, 1), (2, 1), least=[0, 2, 2])), ("RD", solution(6, 2, 1, 1, 2)))
    assert replies(robot, ("RD", FBEstimate([1, 1, 1], [0, 3]))) == [("RA", back((1, 1), bound=6))]


# Time-stamps


def test_an_obsolete_cpa_is_ignored_and_an_obsolete_question_not_answered() -> None:
    for name, old in (("RC", cpa((1, 1), (1, 7), least=[0, 0, 0])), ("RD", asks((1, 1), (1, 7)))):
        robot = agent(chain(), name, ("RA", asks((2, 2))))
        assert replies(robot, ("RB", old)) == []


def test_a_late_question_for_the_present_cpa_is_answered_and_a_stronger_cpa_makes_the_own_value_void() -> None:
    robot = agent(chain(), "RC", ("RB", cpa((1, 1), (2, 1), least=[0, 0, 0])))
    assert replies(robot, ("RA", asks((1, 1)))) == [("RA", FBEstimate([1], [0, 0]))]
    assert value(robot) == (2,)
    replies(robot, ("RA", asks((2, 2))))
    assert robot.value is None
    assert replies(robot, ("RD", back((1, 1), (2, 1), (2, 1)))) == []


# The end


def test_a_complete_cpa_is_a_new_solution_and_all_are_told() -> None:
    robot = agent(chain(), "RD")
    said = replies(robot, ("RC", cpa((1, 1), (2, 1), (2, 1), least=[0, 0, 0, 2])))
    found = solution(5, 1, 2, 2, 1)
    assert said == [*((name, found) for name in ("RA", "RB", "RC")), ("RC", back((1, 1), (2, 1), (2, 1), bound=5))]


def test_every_cpa_tells_b() -> None:
    """The first robot does not take it that there is no solution while the news of one is under way."""
    team = team_of(dict.fromkeys("AB", (1,)), [priced("AB", {(1, 1): 3})])
    robot = agent(team, "RA")
    assert replies(robot, ("RB", back((1, 1), bound=3))) == [("RB", Terminate(3))]
    assert robot.verdict is None
    replies(robot, ("RB", solution(3, 1, 1)))
    assert value(robot) == (1,)


def test_the_first_robot_ends_the_search_when_it_has_no_value_left_without_solution_if_nobody_has_told_b() -> None:
    robot = agent(chain(), "RA", ("RD", solution(5, 1, 2, 2, 1)), ("RB", back((1, 1), bound=5)))
    said = replies(robot, ("RB", back((2, 2), bound=5)))
    assert said == [(name, Terminate(5)) for name in ("RB", "RC", "RD")]
    assert value(robot) == (1,)
    robot = agent(team_of(dict.fromkeys("AB", (1,)), [priced("AB", {(1, 1): INFINITE})]), "RA")
    assert replies(robot, ("RB", back((1, 1)))) == []
    assert robot.verdict is Verdict.NO_SOLUTION


def test_whoever_knows_that_nothing_is_better_with_any_beginning_ends_the_search() -> None:
    robot = agent(chain(), "RC", ("RD", solution(1, 1, 2, 2, 1)))
    said = replies(robot, ("RB", cpa((1, 1), (2, 1), least=[1, 1, 1])))
    assert said == [(name, Terminate(1)) for name in ("RA", "RB", "RD")]


def test_who_is_told_the_end_takes_its_value_in_the_best_solution_and_is_silent() -> None:
    """The news of the solution may come after the end."""
    robot = agent(chain(), "RB", ("RA", cpa((1, 1), least=[0, 0])), ("RD", solution(5, 1, 2, 2, 1)))
    assert replies(robot, ("RA", Terminate(5)), ("RA", cpa((2, 2), least=[0, 0])), ("RC", back((1, 1), (1, 1)))) == []
    assert value(robot) == (2,)
    robot = agent(chain(), "RB")
    assert replies(robot, ("RA", Terminate(5))) == []
    assert robot.value is None
    assert replies(robot, ("RD", solution(5, 1, 2, 2, 1))) == []
    assert value(robot) == (2,)


def test_the_bound_of_all_solutions_is_right_even_if_the_best_solution_arrives_after_the_end() -> None:
    robot = agent(chain(), "RA", ("RD", solution(5, 1, 2, 2, 1)), ("RC", Terminate(1)))
    assert robot.findings.bound == 1
    replies(robot, ("RD", solution(1, 1, 2, 1, 2)))
    assert robot.findings == Findings(best=Incumbent(1, {"RA": (1,), "RB": (2,), "RC": (1,), "RD": (2,)}), bound=1)


def test_a_robot_alone_solves_its_problem_in_silence_and_one_with_an_empty_domain_says_so_at_once() -> None:
    robot = robot_of(AFB, team_of({"A": (1, 2)}, [priced("A", {(1,): 3, (2,): 1})]), "RA")
    assert (started(robot), robot.assignment, robot.verdict) == ([], {"A": 2}, None)
    assert agent(team_of({"A": (1, 2), "B": ()}, []), "RB").verdict is Verdict.NO_SOLUTION


def test_the_best_solution_and_a_bound_are_found_before_the_end() -> None:
    """The bound counts the expected cost of the present value until its CPA is back."""
    team = team_of(dict.fromkeys("AB", (1, 2)), [priced("A", {(1,): 2, (2,): 3}), priced("AB", {(1, 1): 4, (1, 2): 6})])
    robot = agent(team, "RA")
    assert robot.findings == Findings(bound=3)
    replies(robot, ("RB", FBEstimate([1], [0, 0])), ("RB", solution(9, 1, 2)))
    assert robot.findings == Findings(best=Incumbent(9, {"RA": (1,), "RB": (2,)}), bound=3)
    assert agent(team, "RB").findings == Findings()
    team = team_of(dict.fromkeys("AB", (1, 2)), [priced("A", {(1,): 2, (2,): 5}), priced("AB", {(1, 1): 1})])
    robot = agent(team, "RA", ("RB", FBEstimate([1], [0, 2])))
    assert robot.findings == Findings(bound=4)
    robot.receive("RB", cpa((1, 1), least=[]))
    assert robot.findings == Findings(bound=5)
