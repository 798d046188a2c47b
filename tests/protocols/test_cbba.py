"""CBBA's Table I, one test for each entry, and its bundles (Choi, Brunet, How, IEEE T-RO 25(4), 2009)."""

from __future__ import annotations

import pytest

from robochoc.model.allocation import Job, Worker, assignment, several
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.auctions.cbba import CBBA, NOBODY, Standing
from robochoc.protocols.auctions.messages.cbba import Bundles
from tests.support.agents import replies, robot_of, started

TASK = (0, 1)
"""The only task, as each robot names it."""


def team_of_four(**worth: int) -> Team:
    """I, K, M and N, in this order; task 1 is worth so much to each, 1 if nothing is said."""
    workers = [Worker(name, name, f"V{name}", {1: worth.get(name, 1)}) for name in "IKMN"]
    return allocation(assignment(workers))


def allocation(parts: object) -> Team:
    variables, constraints = parts  # type: ignore[misc]
    team = assemble("t", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True))  # type: ignore[has-type]
    return normalized(team)


def after(
    known: Standing, told: Standing, mine: dict[str, int] | None = None, theirs: dict[str, int] | None = None
) -> Standing:
    """What I knows of the task after K's message, without bidding anew: K says `told`, and I knew `known`.

    `mine` and `theirs` say how new each robot's information was (s_i and s_k).
    """
    robot = robot_of(CBBA, team_of_four(), "I")
    robot.know(0, known)
    robot.s.update(mine or {})
    robot.receive("K", Bundles([(TASK, *told)], stamps_of("IKMN", {"K": 5, **(theirs or {})})))
    return robot.standings[0]


def stamps_of(robots: str, numbers: dict[str, int]) -> list[int]:
    """The numbers of `robots`, which stand in priority order; 0: nothing was heard of it."""
    return [numbers.get(name, 0) for name in robots]


OLD, NEW = {"M": 1, "N": 1}, {"M": 2, "N": 2}
I4, K3, K5, M5, M9, N7 = (
    Standing(who, bid) for who, bid in (("I", 4), ("K", 3), ("K", 5), ("M", 5), ("M", 9), ("N", 7))
)


def test_sender_sender_receiver_receiver_updates_for_a_higher_bid() -> None:
    assert after(I4, K5) == K5
    assert after(I4, K3) == I4


def test_sender_sender_receiver_receiver_leaves_an_equal_bid_of_lower_priority() -> None:
    assert after(I4, Standing("K", 4)) == I4


def test_sender_sender_receiver_sender_updates() -> None:
    assert after(K5, K3) == K3


def test_sender_sender_receiver_another_updates_for_newer_information_or_a_higher_bid() -> None:
    assert after(M9, K5, OLD, NEW) == K5
    assert after(M5, Standing("K", 6), NEW, OLD) == Standing("K", 6)
    assert after(M9, K5, NEW, OLD) == M9


def test_sender_sender_receiver_nobody_updates() -> None:
    assert after(NOBODY, K3) == K3


def test_sender_receiver_receiver_receiver_leaves() -> None:
    assert after(I4, Standing("I", 3)) == I4


def test_sender_receiver_receiver_sender_resets() -> None:
    assert after(K5, I4) == NOBODY


def test_sender_receiver_receiver_another_resets_for_newer_information() -> None:
    assert after(M5, I4, OLD, NEW) == NOBODY
    assert after(M5, I4, NEW, NEW) == M5


def test_sender_receiver_receiver_nobody_leaves() -> None:
    assert after(NOBODY, I4) == NOBODY


def test_sender_another_receiver_receiver_updates_for_newer_information_with_a_higher_bid() -> None:
    assert after(I4, M5, OLD, NEW) == M5
    assert after(I4, M5, NEW, NEW) == I4
    assert after(I4, Standing("M", 3), OLD, NEW) == I4


def test_sender_another_receiver_sender_updates_for_newer_information_and_resets_otherwise() -> None:
    assert after(K5, M9, OLD, NEW) == M9
    assert after(K5, M9, NEW, NEW) == NOBODY


def test_sender_another_receiver_the_same_updates_for_newer_information() -> None:
    assert after(M5, M9, OLD, NEW) == M9
    assert after(M9, M5, OLD, NEW) == M5
    assert after(M5, M9, NEW, NEW) == M5


def test_sender_another_receiver_yet_another_updates_for_newer_information_of_both() -> None:
    assert after(N7, M5, OLD, NEW) == M5


def test_sender_another_receiver_yet_another_updates_for_newer_information_with_a_higher_bid() -> None:
    assert after(N7, M9, {"M": 1, "N": 2}, {"M": 2, "N": 1}) == M9
    assert after(N7, M5, {"M": 1, "N": 2}, {"M": 2, "N": 1}) == N7


def test_sender_another_receiver_yet_another_resets_where_each_knows_the_other_better() -> None:
    assert after(N7, M9, {"M": 2, "N": 1}, {"M": 1, "N": 2}) == NOBODY
    assert after(N7, M9, {"M": 1, "N": 1}, {"M": 1, "N": 2}) == N7
    assert after(N7, M9, NEW, OLD) == N7


def test_sender_another_receiver_nobody_updates_for_newer_information() -> None:
    assert after(NOBODY, M5, OLD, NEW) == M5
    assert after(NOBODY, M5, NEW, NEW) == NOBODY


def test_sender_nobody_receiver_receiver_leaves() -> None:
    assert after(I4, NOBODY) == I4


def test_sender_nobody_receiver_sender_updates() -> None:
    assert after(K5, NOBODY) == NOBODY


def test_sender_nobody_receiver_another_updates_for_newer_information() -> None:
    assert after(M5, NOBODY, OLD, NEW) == NOBODY
    assert after(M5, NOBODY, NEW, NEW) == M5


def test_sender_nobody_receiver_nobody_leaves() -> None:
    assert after(NOBODY, NOBODY) == NOBODY


def test_information_is_as_new_as_the_newest_that_was_heard() -> None:
    robot = robot_of(CBBA, team_of_four(), "I")
    robot.s.update({"M": 4, "N": 1})
    robot.receive("K", Bundles([(TASK, *NOBODY)], [9, 1, 3, 2]))
    assert robot.s == {"I": 0, "K": 1, "M": 4, "N": 2}


def test_what_is_not_said_again_is_as_the_sender_said_it_before() -> None:
    """K has said that M has the task. It does so still when it has newer information of M."""
    robot = robot_of(CBBA, team_of_four(), "I")
    robot.know(0, M9)
    robot.s.update(NEW)
    robot.receive("K", Bundles([(TASK, *M5)], [0, 1, 2, 2]))
    assert robot.standings[0] == M9
    robot.receive("K", Bundles([], [0, 2, 3, 2]))
    assert robot.standings[0] == M5


def test_what_both_ends_say_is_changed_by_no_row_of_the_table() -> None:
    for same in (I4, K5, M9, NOBODY):
        for mine, theirs in ((OLD, NEW), (NEW, OLD), (NEW, NEW)):
            assert after(same, same, mine, theirs) == same


@pytest.mark.parametrize("stamps", [[], [0, 1, 0], [0, 1, 0, 0, 0]])
def test_a_message_that_does_not_number_all_robots_is_refused(stamps: list[int]) -> None:
    robot = robot_of(CBBA, team_of_four(), "I")
    with pytest.raises(ValueError, match="K does not say how new its information of each robot is"):
        robot.receive("K", Bundles([(TASK, *K3)], stamps))


# Bundles


def two_robots(**worth: tuple[int, ...]) -> Team:
    """I and K, which can do the tasks 1, 2 and 3."""
    workers = [Worker(name, name, name, dict(enumerate(worth[name], 1))) for name in "IK"]
    return allocation(several(workers, {task: Job(str(task)) for task in (1, 2, 3)}))


def bundles(*standings: tuple[str, int] | None, **stamps: int) -> Bundles:
    """Return what is said of the first, second and third task; None: nothing is."""
    said = [((place, 1), *one) for place, one in enumerate(standings) if one is not None]
    return Bundles(said, stamps_of("IK", stamps))


def test_a_bundle_is_built_from_the_best_task_on() -> None:
    robot = robot_of(CBBA, two_robots(I=(3, 9, 5), K=(1, 1, 1)), "I")
    assert started(robot) == [("K", bundles(("I", 3), ("I", 9), ("I", 5), I=1))]
    assert robot.bundle == [1, 2, 0]


def test_what_was_added_after_a_task_that_is_lost_is_released_and_may_be_added_again() -> None:
    robot = robot_of(CBBA, two_robots(I=(3, 9, 5), K=(1, 1, 1)), "I")
    started(robot)
    assert replies(robot, ("K", bundles(("", 0), ("K", 10), ("", 0), K=1))) == [
        ("K", bundles(None, ("K", 10), None, K=1, I=2))
    ]
    assert robot.bundle == [2, 0]


def test_a_task_where_the_bid_would_not_be_the_highest_is_left_out() -> None:
    robot = robot_of(CBBA, two_robots(I=(3, 9, 5), K=(1, 1, 1)), "I")
    robot.receive("K", bundles(("", 0), ("K", 10), ("K", 6), K=1))
    assert replies(robot) == [("K", bundles(("I", 3), ("K", 10), ("K", 6), K=1, I=1))]


def test_who_says_something_wrong_of_this_robot_is_told_again() -> None:
    """K has reset the task that I has: nothing is new to I, and K must know."""
    robot = robot_of(CBBA, team_of_four(I=4), "I")
    (first, *_) = started(robot)
    assert first == ("K", Bundles([(TASK, "I", 4)], [1, 0, 0, 0]))
    assert replies(robot, ("K", Bundles([(TASK, *NOBODY)], [1, 1, 0, 0]))) == [
        ("K", Bundles([(TASK, "I", 4)], [2, 1, 0, 0]))
    ]


def test_nobody_is_told_twice_what_is_under_way() -> None:
    """K had not heard of I's message when it sent its own."""
    robot = robot_of(CBBA, team_of_four(I=4), "I")
    started(robot)
    assert replies(robot, ("K", Bundles([(TASK, "K", 1)], [0, 1, 0, 0]))) == []


def test_a_task_that_is_worth_nothing_is_not_bid_for() -> None:
    for worth in (0, -3):
        robot = robot_of(CBBA, team_of_four(I=worth), "I")
        assert started(robot) == []
        assert robot.value is not None
        assert robot.problem.solution(robot.value) == {"VI": 0}


@pytest.mark.parametrize("together", [5, -5])
def test_a_bid_is_never_higher_than_the_last_one_of_the_bundle(together: int) -> None:
    """With a synergy of 5 the second task gains 11, more than the first one's 9, and the bid is 9."""
    workers = [Worker(name, name, name, {1: 9, 2: 6}, together={(1, 2): together}) for name in "IK"]
    team = allocation(several(workers, {1: Job("1"), 2: Job("2")}))
    second = 9 if together > 0 else 1
    assert started(robot_of(CBBA, team, "I")) == [("K", bundles(("I", 9), ("I", second), I=1))]
