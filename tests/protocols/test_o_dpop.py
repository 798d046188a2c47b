"""One test per rule of O-DPOP (Petcu and Faltings, AAAI 2006), named for it, and its promises on random problems."""

from __future__ import annotations

from collections import defaultdict
from random import Random

import pytest

from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics
from robochoc.protocols.inference.dpop import VALUE, Proceed
from robochoc.protocols.inference.o_dpop import ODPOP, Ask, Done, Good
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import with_costs
from tests.support.dpop_robots import dimensions, domain, products
from tests.support.examples import count
from tests.support.loose_problems import loosened
from tests.support.problems import team_of
from tests.support.pseudo_trees import placed
from tests.support.random_options import random_options
from tests.support.wide_problems import wide_team


def leaf() -> ODPOP:
    """B, which is below A, and may begin."""
    robot = placed(ODPOP, products("AB", "AB"), "RB", "RA")
    replies(robot, ("RA", domain()), ("RA", Proceed(["RA"])))
    return robot


def root(children: str = "B", values: tuple[int, ...] = (1, 2, 3)) -> ODPOP:
    """A, which has asked its children, in this order."""
    team = products(f"A{children}", " ".join(f"A{name}" for name in children), values)
    robot = placed(ODPOP, team, "RA", children=[f"R{name}" for name in children])
    replies(robot, *((f"R{name}", dimensions({"RA": len(values)})) for name in children))
    return robot


def test_nothing_is_sent_before_it_is_asked_for() -> None:
    assert leaf().outbox == []


def test_goods_come_best_first_and_then_no_more() -> None:
    robot = leaf()
    said = [replies(robot, ("RA", Ask())) for _ in range(4)]
    assert said == [[("RA", one)] for one in (Good([0], 1), Good([1], 2), Good([2], 3), Done())]


def test_a_good_is_sufficient_once_all_children_have_sent_theirs_for_it() -> None:
    robot = root("BC")
    assert replies(robot, ("RB", Good([0], 1))) == []
    assert replies(robot, ("RC", Good([1], 1))) == [("RC", Ask())]
    assert robot.findings.bound == 2
    assert replies(robot, ("RC", Good([0], 1))) == [("RB", VALUE([0])), ("RC", VALUE([0]))]
    assert value(robot) == (1,)


def test_who_lacks_a_good_costs_at_least_what_the_last_one_did() -> None:
    robot = root("BC")
    replies(robot, ("RB", Good([0], 5)), ("RC", Good([2], 7)))
    assert robot.findings.bound == 12


def test_who_has_no_more_goods_rules_all_others_out() -> None:
    robot = root("BC")
    replies(robot, ("RB", Good([0], 1)), ("RC", Good([1], 1)))
    assert replies(robot, ("RC", Done())) == [("RB", Ask())]
    assert replies(robot, ("RB", Good([1], 4))) == [("RB", VALUE([1])), ("RC", VALUE([1]))]


def test_without_any_good_there_is_no_solution() -> None:
    never = Relation("R", 2, Semantics.SUPPORTS, ())
    team = with_costs(team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", never, ("A", "B"), ("A", "B"))]))
    robot = placed(ODPOP, team, "RB", "RA")
    replies(robot, ("RA", domain((1, 2))), ("RA", Proceed(["RA"])), ("RA", Ask()))
    assert robot.verdict is Verdict.NO_SOLUTION


def test_value_goes_down_as_in_dpop() -> None:
    robot = leaf()
    replies(robot, ("RA", Ask()), ("RA", VALUE([0])))
    assert value(robot) == (1,)


def test_what_is_said_in_words() -> None:
    words = Wording("RA", "RB")
    assert Ask().in_words(words) == "what is the next best for your subtree?"
    assert Good([], 7).in_words(words) == "the next best for my subtree costs 7"
    assert Good([0, 2], 7).in_words(words) == (
        "the next best for my subtree costs 7, with the values 1 and 3 (by number) in my separator"
    )
    assert Done().in_words(words) == "nothing else is possible in my subtree"


# What is no message of a well-behaved robot


@looped("assignment", [[], [3], [-1], [0, 0]])
def test_goods_with_values_that_are_none_are_refused(assignment: list[int]) -> None:
    with pytest.raises(ValueError, match="are not values of RB's separator"):
        replies(root(), ("RB", Good(assignment, 1)))


def test_goods_out_of_order_are_refused() -> None:
    robot = root("BC")
    replies(robot, ("RB", Good([1], 5)), ("RC", Good([2], 5)))
    with pytest.raises(ValueError, match="costs less than its previous good"):
        replies(robot, ("RB", Good([0], 4)))


def test_goods_that_nobody_asked_for_are_refused() -> None:
    robot = root("BC")
    replies(robot, ("RB", Good([0], 1)))
    with pytest.raises(ValueError, match="without a request"):
        replies(robot, ("RB", Good([1], 1)))


def test_who_is_asked_twice_refuses() -> None:
    team = products("ABC", "AB BC")
    robot = placed(ODPOP, team, "RB", "RA", children=["RC"])
    replies(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})), ("RA", Proceed(["RA"])), ("RA", Ask()))
    with pytest.raises(ValueError, match="unexpected or repeated Ask"):
        replies(robot, ("RA", Ask()))


def test_values_without_a_good_are_refused() -> None:
    robot = leaf()
    replies(robot, ("RA", Ask()))
    with pytest.raises(ValueError, match="has sent no good"):
        replies(robot, ("RA", VALUE([2])))


# Its promises


@count("problems", 10, 2000)
def test_the_least_cost_is_found_and_goods_never_become_cheaper(problems: int) -> None:
    chance = Random("o-dpop")
    for _ in range(problems):
        team = wide_team(chance)
        team = loosened(team, chance) if chance.random() < 0.3 else team
        events: list[AnyEvent] = []
        options = random_options(team, "o-dpop", chance)
        outcome = solve(team, options, observer=events.append)
        least = least_cost(team)
        assert outcome.verdict is (Verdict.NO_SOLUTION if least == INFINITE else Verdict.OPTIMAL), (team, options)
        assert outcome.cost == (None if least == INFINITE else least), (team, options)
        costs = defaultdict[str, list[int]](list)
        for event in events:
            if isinstance(event, Sent) and event.type == "Good":
                costs[event.sender].append(event.content["cost"])
        assert all(one == sorted(one) for one in costs.values())


def test_it_sends_fewer_bytes_than_dpop_where_few_combinations_are_good() -> None:
    """Ten values each, in a ring, and equal ones cost nothing: the first goods are the best."""
    size = 10
    rows = tuple((one, other) for one in range(size) for other in range(size))
    costs = tuple(1000 * abs(one - other) for one, other in rows)
    near = Relation("Near", 2, Semantics.SOFT, rows, costs)
    pairs = ("AB", "BC", "CD", "AD")
    constraints = [Constraint("C", near, tuple(pair), tuple(pair)) for pair in pairs]
    team = with_costs(team_of(dict.fromkeys("ABCD", range(size)), constraints))
    sent = [solve(team, Options(protocol=name, runtime=Runtime.SIMULATOR)).metrics.bytes for name in ("o-dpop", "dpop")]
    assert sent[0] < sent[1]
