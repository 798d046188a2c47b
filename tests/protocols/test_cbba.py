"""CBBA's Table I, one test for each entry, and its bundles (Choi, Brunet, How, IEEE T-RO 25(4), 2009)."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.allocation import TaskSpec, Worker, assignment, several_tasks
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.auctions.cbba import CBBA, NOBODY, Bundles, Standing
from tests.support.agents import assert_refused, replies, robot_of, started
from tests.support.cases import cases

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


def stamps_of(robots: str, numbers: Mapping[str, int]) -> list[int]:
    """The numbers of `robots`, which stand in priority order; 0: nothing was heard of it."""
    return [numbers.get(name, 0) for name in robots]


OLD, NEW, M_NEWER, N_NEWER = {"M": 1, "N": 1}, {"M": 2, "N": 2}, {"M": 2, "N": 1}, {"M": 1, "N": 2}
NONE: dict[str, int] = {}
I3, I4, M3, M5, M9, N7 = (Standing(*one) for one in (("I", 3), ("I", 4), ("M", 3), ("M", 5), ("M", 9), ("N", 7)))
K3, K4, K5, K6 = (Standing("K", bid) for bid in (3, 4, 5, 6))
TABLE = [
    # K says of the task | I says | how new I's information is | how new K's is | I's afterwards | the table's rule
    (K5, I4, NONE, NONE, K5, "receiver: update for a higher bid"),
    (K3, I4, NONE, NONE, I4, "receiver: update for a higher bid"),
    (K4, I4, NONE, NONE, I4, "receiver: leave an equal bid of lower priority"),
    (K3, K5, NONE, NONE, K3, "sender: update"),
    (K5, M9, OLD, NEW, K5, "another: update for newer information"),
    (K6, M5, NEW, OLD, K6, "another: update for a higher bid"),
    (K5, M9, NEW, OLD, M9, "another: leave otherwise"),
    (K3, NOBODY, NONE, NONE, K3, "nobody: update"),
    (I3, I4, NONE, NONE, I4, "receiver: leave"),
    (I4, K5, NONE, NONE, NOBODY, "sender: reset"),
    (I4, M5, OLD, NEW, NOBODY, "another: reset for newer information"),
    (I4, M5, NEW, NEW, M5, "another: leave otherwise"),
    (I4, NOBODY, NONE, NONE, NOBODY, "nobody: leave"),
    (M5, I4, OLD, NEW, M5, "receiver: update for newer information with a higher bid"),
    (M5, I4, NEW, NEW, I4, "receiver: leave without newer information"),
    (M3, I4, OLD, NEW, I4, "receiver: leave without a higher bid"),
    (M9, K5, OLD, NEW, M9, "sender: update for newer information"),
    (M9, K5, NEW, NEW, NOBODY, "sender: reset otherwise"),
    (M9, M5, OLD, NEW, M9, "the same: update for newer information"),
    (M5, M9, OLD, NEW, M5, "the same: update for newer information"),
    (M9, M5, NEW, NEW, M5, "the same: leave otherwise"),
    (M5, N7, OLD, NEW, M5, "yet another: update for newer information of both"),
    (M9, N7, N_NEWER, M_NEWER, M9, "yet another: update for newer information with a higher bid"),
    (M5, N7, N_NEWER, M_NEWER, N7, "yet another: leave without a higher bid"),
    (M9, N7, M_NEWER, N_NEWER, NOBODY, "yet another: reset where each knows the other better"),
    (M9, N7, OLD, N_NEWER, N7, "yet another: leave otherwise"),
    (M9, N7, NEW, OLD, N7, "yet another: leave otherwise"),
    (M5, NOBODY, OLD, NEW, M5, "nobody: update for newer information"),
    (M5, NOBODY, NEW, NEW, NOBODY, "nobody: leave otherwise"),
    (NOBODY, I4, NONE, NONE, I4, "receiver: leave"),
    (NOBODY, K5, NONE, NONE, NOBODY, "sender: update"),
    (NOBODY, M5, OLD, NEW, NOBODY, "another: update for newer information"),
    (NOBODY, M5, NEW, NEW, M5, "another: leave otherwise"),
    (NOBODY, NOBODY, NONE, NONE, NOBODY, "nobody: leave"),
    *(
        (same, same, *stamps, same, "both say the same")
        for same in (I4, K5, M9, NOBODY)
        for stamps in ((OLD, NEW), (NEW, OLD), (NEW, NEW))
    ),
]


def test_each_row_of_table_1() -> None:
    """Of what I knows of the task after K's message, without bidding anew."""
    with cases() as each:
        for number, (said, known, mine, theirs, expected, rule) in enumerate(TABLE):
            with each(f"{number}: K says {said.winner or 'nobody'}, I {known.winner or 'nobody'}, {rule}"):
                robot = robot_of(CBBA, team_of_four(), "I")
                robot.set_standing(0, known)
                robot.s.update(mine)
                robot.receive("K", Bundles([(TASK, *said)], stamps_of("IKMN", {"K": 5, **theirs})))
                assert robot.standings[0] == expected


def test_information_is_as_new_as_the_newest_that_was_heard_of_each_robot() -> None:
    robot = robot_of(CBBA, team_of_four(), "I")
    robot.s.update({"M": 4, "N": 1})
    robot.receive("K", Bundles([(TASK, *NOBODY)], [9, 1, 3, 2]))
    assert robot.s == {"I": 0, "K": 1, "M": 4, "N": 2}
    wrong = [("K", Bundles([(TASK, *K3)], stamps)) for stamps in ([], [0, 1, 0], [0, 1, 0, 0, 0])]
    assert_refused(lambda: robot, wrong, "K sent .* stamps, not one for each rival")


def test_what_is_not_said_again_is_as_the_sender_said_it_before() -> None:
    """K has said that M has the task. It does so still when it has newer information of M."""
    robot = robot_of(CBBA, team_of_four(), "I")
    robot.set_standing(0, M9)
    robot.s.update(NEW)
    robot.receive("K", Bundles([(TASK, *M5)], [0, 1, 2, 2]))
    assert robot.standings[0] == M9
    robot.receive("K", Bundles([], [0, 2, 3, 2]))
    assert robot.standings[0] == M5


# Bundles


def two_robots(**worth: tuple[int, ...]) -> Team:
    """I and K, which can do the tasks 1, 2 and 3."""
    workers = [Worker(name, name, name, dict(enumerate(worth[name], 1))) for name in "IK"]
    return allocation(several_tasks(workers, {task: TaskSpec(str(task)) for task in (1, 2, 3)}))


def bundles(*standings: tuple[str, int] | None, **stamps: int) -> Bundles:
    """Return what is said of the first, second and third task; None: nothing is."""
    said = [((place, 1), *one) for place, one in enumerate(standings) if one is not None]
    return Bundles(said, stamps_of("IK", stamps))


def test_a_bundle_is_built_from_the_best_task_on_and_what_follows_a_lost_task_may_be_added_again() -> None:
    robot = robot_of(CBBA, two_robots(I=(3, 9, 5), K=(1, 1, 1)), "I")
    assert started(robot) == [("K", bundles(("I", 3), ("I", 9), ("I", 5), I=1))]
    assert robot.bundle == [1, 2, 0]
    lost = bundles(None, ("K", 10), None, K=1, I=2)
    assert replies(robot, ("K", bundles(("", 0), ("K", 10), ("", 0), K=1))) == [("K", lost)]
    assert robot.bundle == [2, 0]


def test_a_task_where_the_bid_would_not_be_the_highest_is_left_out() -> None:
    robot = robot_of(CBBA, two_robots(I=(3, 9, 5), K=(1, 1, 1)), "I")
    robot.receive("K", bundles(("", 0), ("K", 10), ("K", 6), K=1))
    assert replies(robot) == [("K", bundles(("I", 3), ("K", 10), ("K", 6), K=1, I=1))]


def test_who_says_something_wrong_of_this_robot_is_told_again_unless_that_is_under_way() -> None:
    """K has reset the task that I has: nothing is new to I, and K must know."""
    robot = robot_of(CBBA, team_of_four(I=4), "I")
    (first, *_) = started(robot)
    assert first == ("K", Bundles([(TASK, "I", 4)], [1, 0, 0, 0]))
    assert replies(robot, ("K", Bundles([(TASK, "K", 1)], [0, 1, 0, 0]))) == [], "K had not heard of I's message yet"
    told = Bundles([(TASK, "I", 4)], [2, 2, 0, 0])
    assert replies(robot, ("K", Bundles([(TASK, *NOBODY)], [1, 2, 0, 0]))) == [("K", told)]


def test_a_task_that_is_worth_nothing_is_not_bid_for() -> None:
    for worth in (0, -3):
        robot = robot_of(CBBA, team_of_four(I=worth), "I")
        assert started(robot) == []
        assert robot.value is not None
        assert robot.problem.solution(robot.value) == {"VI": 0}


def test_a_bid_is_never_higher_than_the_last_one_of_the_bundle() -> None:
    """With a synergy of 5 the second task gains 11, more than the first one's 9, and the bid is 9."""
    for together, second in ((5, 9), (-5, 1)):
        workers = [Worker(name, name, name, {1: 9, 2: 6}, together={(1, 2): together}) for name in "IK"]
        team = allocation(several_tasks(workers, {1: TaskSpec("1"), 2: TaskSpec("2")}))
        assert started(robot_of(CBBA, team, "I")) == [("K", bundles(("I", 9), ("I", second), I=1))]
