"""One test per rule of DPOP (Petcu and Faltings, IJCAI 2005, Algorithm 1), named for it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Predicate, Relation, Semantics
from robochoc.protocols.inference.dpop import DPOP, UTIL, VALUE, Dimensions, Need, Proceed
from robochoc.protocols.message import Message
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies, value
from tests.support.cost_problems import with_costs
from tests.support.dpop_robots import begun, dimensions, domain, leaf, products
from tests.support.problems import team_of
from tests.support.pseudo_trees import placed


def kinds(said: Sequence[tuple[str, Message]]) -> list[tuple[str, str]]:
    return [(receiver, type(message).__name__) for receiver, message in said]


def test_those_below_are_told_the_own_values() -> None:
    robot = placed(DPOP, products("ABC", "AB BC AC"), "RA", children=["RB"], pseudo_children=["RC"])
    assert robot.outbox == [("RB", domain()), ("RC", domain())]


def test_a_leaf_tells_its_separator_once_all_above_have_told_their_values() -> None:
    robot = begun(products("ABC", "AB BC AC"), "RC", "BA")
    assert replies(robot, ("RB", domain())) == []
    ((receiver, said),) = replies(robot, ("RA", domain()))
    assert receiver == "RB"
    assert isinstance(said, Dimensions)
    assert (said.separator, said.dearest, said.induced_width, said.most.robot) == ({"RA": 3, "RB": 3}, 18, 2, "RC")


def test_a_separator_is_the_children_s_and_the_own_robots_above_without_the_robot_itself() -> None:
    robot = begun(products("ABCD", "AB BC CD AD"), "RC", "B", "D")
    ((_, said),) = replies(robot, ("RB", domain()), ("RD", dimensions({"RC": 3, "RA": 3}, 5, 2, Need(1 << 40, "RD"))))
    assert said == Dimensions({"RB": 3, "RA": 3}, 14, 2, Need(1 << 40, "RD"))


def test_a_neighbour_above_without_a_constraint_takes_no_axis() -> None:
    """RC's constraint with RA and RB is checked below: by RD, which is in it too."""
    quarrel = Relation("R", 4, Semantics.SOFT, ((1, 1, 1, 1),), (5,), 0)
    scope = ("A", "B", "C", "D")
    team = with_costs(team_of(dict.fromkeys("ABCD", (1, 2)), [Constraint("C", quarrel, scope, scope)]))
    robot = begun(team, "RC", "BA", "D")
    ((_, said),) = replies(
        robot, ("RB", domain((1, 2))), ("RA", domain((1, 2))), ("RD", dimensions({"RC": 2, "RA": 2}))
    )
    assert isinstance(said, Dimensions)
    assert said.separator == {"RA": 2}


def test_a_robot_with_one_value_takes_no_axis() -> None:
    team = with_costs(
        team_of({"A": (1, 2), "B": (3,), "C": (2, 3)}, [*products("ABC", "AC BC").constraints()]),
    )
    robot = begun(team, "RC", "BA")
    replies(robot, ("RB", domain((3,))), ("RA", domain((1, 2))))
    assert [said.costs for _, said in replies(robot, ("RB", Proceed(["RA"]))) if isinstance(said, UTIL)] == [
        bytes([8, 10])
    ]
    replies(robot, ("RB", VALUE([1])))
    assert value(robot) == (2,)


def test_a_pseudo_tree_may_be_wider_than_arrays_can_be_if_robots_have_one_value() -> None:
    names = [f"X{number:02}" for number in range(80)]
    free = Predicate("free", ("X", "Y"), parse("ne(X, Y)", ("X", "Y"), Type.BOOLEAN))
    pairs = itertools.combinations(names, 2)
    constraints = [Constraint("C", free, pair, pair, cost=1) for pair in pairs]
    team = with_costs(team_of({name: (1,) if name < "X77" else (1, 2, 3) for name in names}, constraints))
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert outcome.verdict is Verdict.OPTIMAL
    assert outcome.cost == 77 * 76 // 2 + 1


def test_the_root_lets_all_proceed_once_all_fits() -> None:
    robot = begun(products("ABC", "AB BC AC"), "RA", below="B", further="C")
    said = replies(robot, ("RB", dimensions({"RA": 3})))
    assert said[-1] == ("RB", Proceed(["RA"]))


def test_axes_are_told_down_the_nearest_robot_first() -> None:
    team = products("ABCD", "AB BC CD AD BD")
    robot = begun(team, "RC", "B", "D")
    replies(robot, ("RB", domain()), ("RD", dimensions({"RA": 3, "RB": 3, "RC": 3})))
    assert replies(robot, ("RB", Proceed(["RB", "RA"]))) == [("RD", Proceed(["RC", "RB", "RA"]))]


def test_no_constraint_is_checked_before_all_may_proceed() -> None:
    robot = leaf(products("ABC", "AB BC AC"))
    assert robot.problem.checks == 0
    replies(robot, ("RB", Proceed(["RB", "RA"])))
    assert robot.problem.checks == 2 * 3 * 3


def test_a_leaf_computes_and_sends_its_table() -> None:
    """For each combination of values above, what the cheapest own value costs."""
    robot = leaf(products("ABC", "AB BC AC"))
    assert replies(robot, ("RB", Proceed(["RB", "RA"]))) == [("RB", UTIL(1, bytes([2, 3, 4, 3, 4, 5, 4, 5, 6])))]


def test_a_table_waits_for_all_children_and_adds_up_what_they_say() -> None:
    robot = begun(products("ABCD", "AB BC BD"), "RB", "A", "CD")
    replies(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})), ("RD", dimensions({"RB": 3})))
    replies(robot, ("RA", Proceed(["RA"])))
    assert replies(robot, ("RC", UTIL(1, bytes([9, 5, 1])))) == []
    # A's value times 1, 2, 3, and what C and D say of these.
    assert replies(robot, ("RD", UTIL(1, bytes([9, 0, 1])))) == [("RA", UTIL(1, bytes([5, 8, 11])))]


def test_a_table_may_come_in_pieces() -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    replies(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})))
    replies(robot, ("RA", Proceed(["RA"])), ("RC", UTIL(1, bytes([9, 5]))))
    assert kinds(replies(robot, ("RC", UTIL(1, bytes([1]))))) == [("RA", "UTIL")]


def test_the_root_chooses_what_is_cheapest_and_knows_the_bound() -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    replies(robot, ("RB", dimensions({"RA": 3})))
    assert robot.findings.bound is None
    assert replies(robot, ("RB", UTIL(1, bytes([7, 4, 4])))) == [("RB", VALUE([1]))]
    assert value(robot) == (2,)
    assert robot.findings.bound == 4


def test_a_value_message_lets_a_robot_choose_and_tell_its_children() -> None:
    robot = begun(products("ABCD", "AB BC CD AD"), "RC", "B", "D")
    replies(robot, ("RB", domain()), ("RD", dimensions({"RC": 3, "RA": 3})))
    replies(robot, ("RB", Proceed(["RB", "RA"])), ("RD", UTIL(1, bytes([9, 9, 9, 9, 9, 0, 9, 9, 9]))))
    assert value(robot) is None
    assert replies(robot, ("RB", VALUE([0, 2]))) == [("RD", VALUE([1, 2]))]
    assert value(robot) == (2,)


def test_of_equal_values_the_first_is_taken() -> None:
    assert solve(products("AB", ""), Options(protocol="dpop", runtime=Runtime.SIMULATOR)).assignment == {"A": 1, "B": 1}


def test_a_table_of_broken_constraints_ends_the_search() -> None:
    never = Relation("R", 2, Semantics.SUPPORTS, ())
    team = with_costs(team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", never, ("A", "B"), ("A", "B"))]))
    robot = begun(team, "RB", "A")
    replies(robot, ("RA", domain((1, 2))))
    assert replies(robot, ("RA", Proceed(["RA"]))) == []
    assert robot.verdict is Verdict.NO_SOLUTION
    assert replies(robot, ("RA", VALUE([0]))) == []


def test_a_robot_alone_takes_its_cheapest_value() -> None:
    charge = Relation("R", 1, Semantics.SOFT, ((1,), (2,), (3,)), (3, 1, INFINITE), 0)
    team = with_costs(team_of({"A": (1, 2, 3)}, [Constraint("C", charge, ("A",), ("A",))]))
    result = Simulation(team, DPOP, RandomChannels(0)).run()
    assert result.assignments == {"RA": {"A": 2}}
    assert result.findings["RA"].bound == 1
    assert result.metrics.messages == {}


def test_trees_have_nothing_to_do_with_each_other() -> None:
    result = Simulation(products("ABCDE", "AB CD DE", (2, 3)), DPOP, RandomChannels(1)).run()
    assert sum(found.bound or 0 for found in result.findings.values()) == 3 * 4


def test_messages_are_as_many_as_the_tree_says() -> None:
    team = products("ABCDEF", "AB AC BD BE CF AD")
    sent = Simulation(team, DPOP, RandomChannels(2)).run().metrics.messages
    wanted = {"Domain": 6, "Dimensions": 5, "Proceed": 5, "UTIL": 5, "VALUE": 5}
    assert {name: sent[name] for name in wanted} == wanted
