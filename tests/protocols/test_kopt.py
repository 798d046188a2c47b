"""One test per rule of k-opt (Katagishi, Pearce, DCR 2007), named for it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from itertools import pairwise
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.problem import Assignment, Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search import kopt
from robochoc.protocols.local_search.kopt import (
    CostList,
    KOpt,
    KOptSettings,
    MoveTogether,
    Neighbourhood,
    Offer,
    Offers,
    ProblemPart,
    Region,
    Values,
)
from robochoc.protocols.shared.cycles import Domain
from robochoc.solver.errors import TooLargeError
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import (
    any_schedule,
    assignments_by_cycle,
    cost_of_assignment,
    domains_of,
    never_rises,
    played,
)
from tests.support.problems import team_of

INF = float("inf")
BOTH = Relation("B", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (5, 9, 9, 0))
"""From (1, 1) nobody gains by moving alone."""
COSTS: list[int | float] = [5, 9, 9, 0]
TWO = Domain([(1,), (2,)])
FREE: list[int | float] = [0, 0]
RANK = {f"R{letter}": place for place, letter in enumerate("ABCDE")}


def chain(names: str = "ABC") -> Team:
    return team_of(dict.fromkeys(names, (1, 2)), [Constraint("C", BOTH, pair, pair) for pair in pairwise(names)])


def parts(names: str = "ABCDE") -> dict[str, ProblemPart]:
    """Return the part of each robot of `chain`, as its message has it."""
    tables = {left: [CostList([f"R{left}", f"R{right}"], COSTS)] for left, right in pairwise(names)}
    return {f"R{name}": ProblemPart(FREE, tables.get(name, [])) for name in names}


def pair(*, k: int = 2) -> KOpt:
    """A of two robots, which has the value 1, and has told its part of the problem."""
    robot = robot_of(KOpt, chain("AB"), "RA", 0.0)
    robot.settings = KOptSettings(k=k)  # type: ignore[misc]
    assert started(robot) == [("RB", TWO)]
    assert replies(robot, ("RB", TWO)) == [("RB", Region({"RA": ProblemPart(FREE, [CostList(["RA", "RB"], COSTS)])}))]
    return robot


def offering(*, told: bool = False) -> KOpt:
    """The same, when all values are known: 1 and 1; with `told` its offer has been told."""
    robot = pair()
    replies(robot, ("RB", Region({"RB": ProblemPart(FREE, [])})))
    assert replies(robot, ("RB", Region({}))) == [("RB", Values({"RA": 0}))]
    assert replies(robot, ("RB", Values({"RB": 0}))) == [("RB", Values({"RB": 0}))]
    if told:
        replies(robot, ("RB", Values({})))
    return robot


def test_what_is_new_is_told_a_link_further() -> None:
    robot = pair()
    assert replies(robot, ("RB", Region({"RB": ProblemPart(FREE, [])}))) == [
        ("RB", Region({"RB": ProblemPart(FREE, [])}))
    ]


def test_a_centre_offers_the_best_move_of_a_group() -> None:
    offered = Offers({"RA": Offer(0, 5, {"RA": 1, "RB": 1})})
    assert replies(offering(), ("RB", Values({}))) == [("RB", offered)]


@looped(("rival", "moves"), [(4, True), (5, True), (6, False)])
def test_of_moves_that_touch_each_other_the_best_is_made_and_of_equal_ones_the_first(
    rival: int,
    moves: bool,  # noqa: FBT001
) -> None:
    robot = offering(told=True)
    replies(robot, ("RB", Offers({"RB": Offer(0, rival, {"RB": 1})})))
    replies(robot, ("RB", Offers({})))
    assert replies(robot, ("RB", Offers({}))) == [("RB", MoveTogether({"RA": 1, "RB": 1} if moves else {}))]


def test_who_is_told_to_move_takes_its_new_value_and_tells_it() -> None:
    """Who has not moved tells no value."""
    robot = offering(told=True)
    for _ in range(3):
        replies(robot, ("RB", Offers({"RB": Offer(0, 9, {"RA": 1, "RB": 1})})))
    assert replies(robot, ("RB", MoveTogether({"RA": 1, "RB": 1}))) == [("RB", Values({"RA": 1}))]
    assert value(robot) == (2,)
    robot = offering(told=True)
    for _ in range(3):
        replies(robot, ("RB", Offers({"RB": Offer(0, 9, {"RB": 1})})))
    assert replies(robot, ("RB", MoveTogether({"RB": 1}))) == [("RB", Values({}))]


@looped(("centre", "k", "groups"), [
    ("RC", 1, {"C"}), ("RC", 2, {"BC", "CD"}), ("RA", 2, {"AB"}), ("RC", 3, {"BCD"}),
    ("RC", 4, {"ABCD", "BCDE"}), ("RC", 5, {"ABCDE"}), ("RA", 8, {"ABCDE"}),
])  # fmt: skip
def test_groups_are_connected_and_reach_half_of_k_from_the_centre(centre: str, k: int, groups: set[str]) -> None:
    known = Neighbourhood(centre, parts(), RANK, k, k // 2)
    assert {"".join(name[1:] for name in group) for group in known.groups} == groups


def test_a_broken_constraint_weighs_more_than_any_cost() -> None:
    told = {"RA": ProblemPart([0, 99], []), "RB": ProblemPart([0, 0], [])}
    told["RA"] = ProblemPart([0, 99], [CostList(["RA", "RB"], [INF, INF, 0, 0])])
    move = Neighbourhood("RA", told, RANK, 1, 0).best({"RA": 0, "RB": 0})
    assert move == ((1, -99), {"RA": 1})


def test_of_equally_good_moves_one_of_the_fewest_robots_is_offered() -> None:
    told = {"RA": ProblemPart([3, 0], [CostList(["RA", "RB"], [0, 0, 0, 0])]), "RB": ProblemPart([0, 0], [])}
    assert Neighbourhood("RA", told, RANK, 2, 1).best({"RA": 0, "RB": 1}).moves.keys() == {"RA"}


@looped("table", [
    CostList(["RA", "RB"], [0, 0, 0]), CostList(["RB", "RA"], COSTS), CostList(["RA", "RA"], COSTS),
    CostList(["RA", "RB"], [0, -1, 0, 0]), CostList(["RA", "RB"], [0, float("nan"), 0, 0]),
])  # fmt: skip
def test_invalid_tables_are_refused(table: CostList) -> None:
    with pytest.raises(ValueError, match=r"invalid costs of|must begin with RA"):
        Neighbourhood("RA", {"RA": ProblemPart(FREE, [table]), "RB": ProblemPart(FREE, [])}, RANK, 2, 1)


def test_invalid_places_are_refused() -> None:
    robot = pair()
    replies(robot, ("RB", Region({"RB": ProblemPart(FREE, [])})), ("RB", Region({})), ("RB", Values({"RB": 2})))
    with pytest.raises(ValueError, match="RB has no value number 3"):
        replies(robot, ("RB", Values({})))


def test_a_message_of_another_phase_is_refused() -> None:
    with pytest.raises(ValueError, match="RB sent an unexpected message"):
        replies(pair(), ("RB", Values({})))


def test_groups_that_are_too_large_end_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kopt, "MOST_COMBINATIONS", 7)
    with pytest.raises(TooLargeError, match="3 robots around RC have more than 7 combinations"):
        Neighbourhood("RC", parts(), RANK, 3, 1)
    monkeypatch.setattr(kopt, "MOST_GROUPS", 1)
    with pytest.raises(TooLargeError, match="RC is in more than 1 groups of 4 robots"):
        Neighbourhood("RC", parts(), RANK, 4, 2)


def k_optimal(team: Team, assignment: Assignment, k: int) -> bool:
    """By brute force: no `k` connected robots can do better by moving at once."""
    now = cost_of_assignment(team, assignment)
    return all(cost_of_assignment(team, other) >= now for other in moves_of(team, assignment, k))


def moves_of(team: Team, assignment: Assignment, k: int) -> Iterator[Assignment]:
    domains = domains_of(team)
    scopes = [{*constraint.variables} for constraint in team.constraints()]
    for size in range(1, k + 1):
        for names in itertools.combinations(domains, size):
            if connected(names, scopes):
                for values in itertools.product(*(domains[name] for name in names)):
                    yield {**assignment, **dict(zip(names, values, strict=True))}


def connected(names: tuple[str, ...], scopes: list[set[str]]) -> bool:
    reached = {names[0]}
    for _ in names:
        reached |= {name for scope in scopes if scope & reached for name in scope & {*names}}
    return len(reached) == len(names)


@looped("k", [1, 2, 3, 4])
@count("teams", 4, 60)
def test_the_cost_never_rises_and_the_end_is_a_k_optimum(teams: int, k: int) -> None:
    chance = Random(f"kopt {k}")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            course = assignments_by_cycle(team, played(team, KOpt, any_schedule(chance), seed, cycles=15, k=k))
            assert never_rises([cost_of_assignment(team, values) for values in course])
            assert k_optimal(team, course[-1], k)


def test_three_that_are_stuck_in_pairs_move_together() -> None:
    together = Relation("T", 3, Semantics.SOFT, ((1, 1, 1), (2, 2, 2)), (5, 0), 9)
    scope = ("A", "B", "C")
    team = team_of(dict.fromkeys(scope, (1, 2)), [Constraint("T", together, scope, scope)])
    ends = {
        k: {
            cost_of_assignment(
                team,
                assignments_by_cycle(team, played(team, KOpt, Concurrent(0), seed, cycles=5, k=k))[-1],
            )
            for seed in range(12)
        }
        for k in (2, 3)
    }
    assert (0, 5) in ends[2]
    assert ends[3] == {(0, 0)}
