"""The rules of sequential single-item auctions (Koenig et al., AAAI 2006), and of CBAA's two phases."""

from __future__ import annotations

from robochoc.model.allocation import TaskSpec, Worker, assignment, several_tasks
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.auctions.cbaa import CBAA, WinningBids
from robochoc.protocols.auctions.ssi import SSI, Bid, Won
from tests.support.agents import replies, robot_of, started
from tests.support.cases import looped

ONE, TWO = (0, 1), (0, 2)
"""Tasks as each robot names them, which does one at most."""


def single(*worth: tuple[int, int]) -> Team:
    """A, B, ... do one of the tasks 1 and 2 each, which are worth so much to them."""
    workers = [Worker(name, name, f"V{name}", {1: own[0], 2: own[1]}) for name, own in zip("ABC", worth, strict=False)]
    variables, constraints = assignment(workers)
    return normalized(assemble("t", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True)))


def double(together: int) -> Team:
    """A and B do both tasks if they like: to A they are worth 9 and 6, and `together` besides."""
    pair = {(1, 2): together}
    workers = [Worker("A", "A", "A", {1: 9, 2: 6}, together=pair), Worker("B", "B", "B", {1: 1, 2: 1})]
    variables, constraints = several_tasks(workers, {1: TaskSpec("1"), 2: TaskSpec("2")})
    return normalized(assemble("t", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True)))


def bidder(*worth: tuple[int, int], name: str = "A", protocol: type[SSI | CBAA] = SSI) -> SSI | CBAA:
    """A, which has made its first bid, unless `name` says another robot; to A tasks are worth 5 and 9."""
    robot = robot_of(protocol, single(*(worth or ((5, 9), (1, 1)))), name)
    started(robot)
    return robot


def test_a_robot_bids_for_the_task_that_is_worth_most_to_it() -> None:
    assert started(robot_of(SSI, single((5, 9), (1, 1)), "A")) == [("B", Bid(9))]


def test_who_gains_nothing_says_so() -> None:
    assert started(robot_of(SSI, single((0, -2), (1, 1)), "A")) == [("B", Bid(0))]


def test_nobody_buys_before_all_rivals_have_bid() -> None:
    robot = bidder((5, 9), (1, 1), (1, 1))
    assert replies(robot, ("B", Bid(3))) == []
    assert replies(robot, ("C", Bid(8))) == [("B", Won([TWO], 0)), ("C", Won([TWO], 0))]
    assert robot.assignment == {"VA": 2}


def test_the_highest_bid_wins_and_of_equal_ones_that_of_the_robot_of_higher_priority() -> None:
    for bid, wins in ((8, True), (9, True), (10, False)):
        assert bool(replies(bidder(), ("B", Bid(bid)))) == wins
    assert replies(bidder((1, 1), (5, 9), name="B"), ("A", Bid(9))) == []


def test_who_wanted_a_task_that_is_sold_bids_for_another_one() -> None:
    robot = bidder()
    assert replies(robot, ("B", Won([TWO], 6))) == [("B", Bid(5))]
    assert replies(robot, ("B", Bid(0))) == [("B", Won([ONE], 0))]


def test_several_tasks_are_bought_at_once_where_nobody_can_bid_more() -> None:
    robot = robot_of(SSI, double(0), "A")
    started(robot)
    assert replies(robot, ("B", Bid(1))) == [("B", Won([(0, 1), (1, 1)], 0))]


@looped(("together", "second"), [(5, 9), (-5, 1)])
def test_a_bid_is_never_higher_than_what_was_paid_before(together: int, second: int) -> None:
    """With a synergy of 5 the second task gains 11, more than the first one's 9, and the bid is 9."""
    robot = robot_of(SSI, double(together), "A")
    assert started(robot) == [("B", Bid(9))]
    assert robot.offer is not None
    robot._buy(robot.offer)  # noqa: SLF001 - as if nobody had bid more
    assert robot.offer.amount == second


def test_cbaa_takes_the_best_task_and_tells_it() -> None:
    assert started(robot_of(CBAA, single((5, 9), (1, 1)), "A")) == [("B", WinningBids([(TWO, "A", 9)]))]


def test_cbaa_gives_up_a_task_for_a_higher_bid_and_takes_another_one() -> None:
    robot = bidder(protocol=CBAA)
    assert replies(robot, ("B", WinningBids([(TWO, "B", 10)]))) == [("B", WinningBids([(ONE, "A", 5)]))]
    assert robot.assignment == {"VA": 1}


def test_cbaa_keeps_a_task_against_a_lower_bid_and_tells_nobody_what_is_under_way() -> None:
    robot = bidder(protocol=CBAA)
    assert replies(robot, ("B", WinningBids([(TWO, "B", 9)]))) == []
    assert robot.assignment == {"VA": 2}


def test_cbaa_passes_on_what_others_may_not_know() -> None:
    robot = robot_of(CBAA, single((0, 0), (1, 1), (1, 1)), "A")
    assert started(robot) == []
    assert replies(robot, ("B", WinningBids([(ONE, "B", 4)]))) == [("C", WinningBids([(ONE, "B", 4)]))]
