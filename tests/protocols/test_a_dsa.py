"""One test per rule of A-DSA (Fitzpatrick, Meertens 2003; pyDCOP's `adsa`), named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.a_dsa import ADSA, ADSASettings, Tick
from robochoc.run.incumbent import best_known, costs_by_cycle
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.agents import replies, robot_of, started, value
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, domains_of, played
from tests.support.problems import team_of

EQUAL_COSTS = Relation("E", 2, Semantics.SOFT, ((1, 1), (2, 2), (3, 3)), (1, 1, 1), 0)
MOVES, STAYS = 0.0, 0.99


def star() -> Team:
    """B in the middle pays 1 for each neighbour with its own value."""
    pairs = (("A", "B"), ("B", "C"))
    return team_of(dict.fromkeys("ABC", (1, 2, 3)), [Constraint("C", EQUAL_COSTS, pair, pair) for pair in pairs])


def middle(*chances: float, cycles: int = 100) -> ADSA:
    """B, which begins with the value 1."""
    robot = robot_of(ADSA, star(), "RB", 0.0, *chances)
    robot.settings = ADSASettings(cycles=cycles)  # type: ignore[misc]
    assert started(robot) == both(Tick((1,), False))
    return robot


def both(tick: Tick) -> list[tuple[str, Tick]]:
    return [("RA", tick), ("RC", tick)]


def now(number: int) -> Tick:
    return Tick((number,), False)


def last(number: int) -> Tick:
    return Tick((number,), True)


def test_there_is_no_tick_before_a_value_of_each_neighbour_is_known_and_a_packet_is_one_by_the_last_values() -> None:
    robot = middle(MOVES)
    assert replies(robot, ("RA", now(1))) == []
    assert replies(robot, ("RC", now(2)), ("RA", now(3)), ("RA", now(2)), ("RA", now(1))) == both(now(3))
    assert (robot.cycle, value(robot)) == (1, (3,))
    assert replies(robot) == [], "there is no news"
    assert robot.cycle == 1


def test_a_tick_waits_for_no_neighbour_and_tells_the_value_also_if_it_is_the_old_one() -> None:
    robot = middle(STAYS, MOVES)
    assert replies(robot, ("RA", now(1)), ("RC", now(2))) == both(now(1))
    assert replies(robot, ("RA", now(1))) == both(now(3))
    assert robot.cycle == 2


def test_the_last_tick_is_told_and_then_a_robot_is_silent() -> None:
    robot = middle(STAYS, cycles=1)
    assert replies(robot, ("RA", now(1)), ("RC", now(2))) == both(last(1))
    assert replies(robot, ("RA", now(1))) == []
    assert robot.cycle == 1


def test_who_has_stopped_is_told_nothing_more_and_may_tell_nothing() -> None:
    robot = middle(STAYS)
    assert replies(robot, ("RA", last(1)), ("RC", now(2))) == [("RC", now(1))]
    for sender in ("RA", "RZ"):
        with pytest.raises(ValueError, match="is not a neighbour of RB, or has ended already"):
            replies(robot, (sender, now(1)))


def test_when_all_around_have_stopped_the_remaining_ticks_are_made_at_once() -> None:
    robot = middle(STAYS, STAYS, MOVES, cycles=5)
    assert replies(robot, ("RA", last(1)), ("RC", last(2))) == []
    assert (robot.cycle, value(robot)) == (5, (3,))


@count("teams", 40, 600)
def test_whatever_the_delays_it_ends_when_all_have_made_all_their_ticks(teams: int) -> None:
    chance = Random("a-dsa")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if not all(domains_of(team).values()):
            continue
        ticks = chance.randint(1, 25)
        result = played(team, ADSA, any_schedule(chance), seed, cycles=ticks)
        trails = {name: found.trail for name, found in result.findings.items() if found.trail}
        assert [trail.cycle for trail in trails.values()] == [ticks] * len(team.robots)
        best = best_known(CompiledTeam(team), result)
        least = min(costs_by_cycle(CompiledTeam(team), trails))
        assert least == (best.cost if best else float("inf"))
