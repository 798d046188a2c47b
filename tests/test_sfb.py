"""One test per rule of forward bounding by the holder, many partial assignments at a time; named for it."""

from __future__ import annotations

import doctest
import math
from collections.abc import Mapping, Sequence
from random import Random

import pytest
from agents import told, value
from cost_problems import random_cost_team, with_costs
from problems import team_of

import robochoc.protocols.sfb
from robochoc.communication.host import BadSettings, settings_of
from robochoc.communication.schedule import RandomChannels
from robochoc.communication.simulator import Simulation
from robochoc.message import Message
from robochoc.outcome import Verdict
from robochoc.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.findings import NOTHING
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.sfb import SFB, Above, Below, CPAs, Explored, SFBSettings, Solution
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.encoding import TooMuch
from robochoc.solver.part import parts

Costs = Mapping[str, Sequence[float]]


def soft(scope: str, costs: Sequence[float], *domains: Sequence[int]) -> Constraint:
    """What the variables in `scope` pay for each combination of their values, 1 and 2 if not given."""
    rows = [()]
    for domain in domains or [(1, 2)] * len(scope):
        rows = [(*row, one) for row in rows for one in domain]  # type: ignore[misc]
    relation = Relation("R", len(scope), Semantics.SOFT, tuple(rows), tuple(costs), 0)
    return Constraint("C", relation, tuple(scope), tuple(scope))


def team(costs: Costs, domains: Mapping[str, Sequence[int]] | None = None) -> Team:
    """Robots RA, RB, ...: for each scope in `costs` what its combinations of values cost."""
    domains = domains or dict.fromkeys(sorted(set("".join(costs))), (1, 2))
    found = [soft(scope, given, *(domains[name] for name in scope)) for scope, given in costs.items()]
    return with_costs(team_of(domains, found))


CHAIN: Costs = {"AB": (3, 1, 0, 2), "BC": (0, 4, 2, 1), "A": (0, 1)}
"""RA and RB, RB and RC; the cheapest is RA 2, RB 1, RC 1, for 1."""


def agents(problem: Team, settings: SFBSettings | None = None) -> dict[str, SFB]:
    """The protocol objects of all robots, not started."""
    order = PriorityOrder(problem.order)
    found = {name: SFB(LocalProblem(part), order) for name, part in parts(problem, everywhere=True).items()}
    for robot in found.values():
        robot.settings = settings or robot.settings
    return found


def introduced(problem: Team, settings: SFBSettings | None = None) -> tuple[dict[str, SFB], list[CPAs]]:
    """All robots know each other's values; and what the first one says then."""
    robots = agents(problem, settings)
    said: list[CPAs] = []
    todo = []
    for robot in robots.values():
        robot.start()
        todo += [(robot.problem.agent, *one) for one in robot.outbox]
        robot.outbox.clear()
    while todo:
        sender, receiver, message = todo.pop(0)
        if isinstance(message, CPAs):
            said.append(message)
        else:
            todo += [(receiver, *one) for one in told(robots[receiver], (sender, message))]
    return robots, said


def rows(message: Message) -> list[list[int]]:
    """What `message` holds, as numbers of one byte each."""
    assert isinstance(message, CPAs)
    width = len(message.rows) // message.count
    return [list(message.rows[place : place + width]) for place in range(0, len(message.rows), width)]


def cpas(*partial: Sequence[int], least: int = 11, ceiling: int = 11) -> CPAs:
    """A message of CPAs in problems whose costs fit into a byte."""
    return CPAs(len(partial), bytes([number for row in partial for number in row]), least, ceiling)


# Before the search


def test_the_first_robot_tells_its_values_and_each_adds_its_own() -> None:
    robots = agents(team(CHAIN))
    for robot in robots.values():
        robot.start()
    assert robots["RA"].outbox == [("RB", Above([[(1,), (2,)]]))]
    assert robots["RB"].outbox == []
    assert told(robots["RB"], ("RA", Above([[(1,), (2,)]]))) == [("RC", Above([[(1,), (2,)]] * 2))]


def test_the_last_robot_turns_round_with_what_its_values_are_charged() -> None:
    robots = agents(team({**CHAIN, "C": (5, 0)}))
    said = told(robots["RC"], ("RB", Above([[(1,), (2,)]] * 2)))
    assert said == [("RB", Below([[(1,), (2,)]], [[5, 0]], 5))]


def test_on_the_way_up_each_robot_adds_the_most_that_it_can_come_to() -> None:
    """Charges, and constraints of which it is the last but one: each constraint counts once, infinite costs not."""
    robots = agents(team({**CHAIN, "BC": (0, math.inf, 2, 1)}))
    told(robots["RB"], ("RA", Above([[(1,), (2,)]])))
    said = told(robots["RB"], ("RC", Below([[(1,), (2,)]], [[0, 0]], 0)))
    assert said == [("RA", Below([[(1,), (2,)]] * 2, [[0, 0], [0, 0]], 2))]
    assert "RC" not in robots["RA"].problem.neighbours


def test_more_than_everything_can_come_to_is_the_ceiling() -> None:
    _, said = introduced(team(CHAIN))
    assert said[0].ceiling == said[0].least == 3 + 4 + 1 + 1


def test_a_robot_without_values_ends_the_search_at_the_start() -> None:
    robots = agents(team_of({"A": (1, 2), "B": (), "C": (1,)}, []))
    robots["RB"].start()
    assert robots["RB"].verdict is Verdict.NO_SOLUTION
    assert told(robots["RB"], ("RA", Above([[(1,), (2,)]]))) == []


def test_a_robot_alone_solves_its_problem_in_silence() -> None:
    robot = agents(team({"A": (3, 1)}))["RA"]
    robot.start()
    assert robot.assignment == {"A": 2}
    assert robot.outbox == []


# The bound


def test_a_cpa_tells_its_bound_its_cost_its_values_and_what_values_below_would_cost() -> None:
    """RA 1 costs RB 3 or 1, and RA 2, for which RA is charged 1, costs it 0 or 2."""
    _, said = introduced(team(CHAIN))
    assert sorted(rows(said[0])) == [[1, 0, 0, 3, 1, 0, 0], [1, 1, 1, 0, 2, 0, 0]]


def test_of_equal_bounds_those_that_leave_others_the_most_go_first() -> None:
    _, said = introduced(team({"AB": (2, 1, 1, 1)}))
    assert [row[2] for row in rows(said[0])] == [1, 0]


def test_lower_bounds_go_first() -> None:
    _, said = introduced(team({"AB": (2, 2, 1, 1)}))
    assert [row[:3] for row in rows(said[0])] == [[1, 0, 1], [2, 0, 0]]


def test_the_bound_adds_the_least_of_each_robot_below() -> None:
    _, said = introduced(team({"AB": (2, 3, 9, 9), "AC": (9, 4, 9, 9), "D": (1, 2)}, dict.fromkeys("ABCD", (1, 2))))
    assert rows(said[0])[0][:3] == [2 + 4 + 1, 0, 0]


def test_what_cannot_become_cheaper_than_the_best_known_is_not_sent() -> None:
    robots, _ = introduced(team(CHAIN))
    said = told(robots["RB"], ("RA", cpas([1, 1, 1, 0, 2, 0, 0], least=3, ceiling=10)))
    assert [row[:4] for row in rows(said[0][1])] == [[1, 1, 1, 0]]  # RB 2 would have paid 2, and RC 1


def test_where_nothing_is_left_to_send_the_robot_goes_back_at_once() -> None:
    robots, _ = introduced(team(CHAIN))
    assert told(robots["RB"], ("RA", cpas([1, 1, 1, 0, 2, 0, 0], least=1, ceiling=10))) == [("RA", Explored())]


def test_a_broken_hard_constraint_reaches_the_ceiling() -> None:
    _, said = introduced(team({"AB": (math.inf, math.inf, 1, math.inf)}))
    assert rows(said[0]) == [[1, 0, 1, 1, 2]]


@pytest.mark.parametrize("dear", [1, 100, 30_000, 1 << 20, 1 << 40])
def test_numbers_are_as_small_as_the_costs_allow_and_exact(dear: int) -> None:
    problem = team({"AB": (dear, dear + 1, dear + 1, dear + 1), "BC": (dear + 2, dear, dear, dear), "C": (1, 0)})
    result = Simulation(problem, SFB, RandomChannels(0)).run(60)
    assert {name: next(iter(own.values())) for name, own in result.assignments.items()} == {"RA": 1, "RB": 1, "RC": 2}
    best = result.findings["RA"].best
    assert best is not None
    assert best.cost == 2 * dear


def test_of_an_n_ary_constraint_the_last_but_one_adds_what_the_last_will_pay() -> None:
    """The first robot of the scope adds nothing."""
    robots, said = introduced(team({"ABC": (1, 2, 3, 4, 5, 6, 7, 8)}))
    assert [row[3:] for row in rows(said[0])] == [[0, 0, 0, 0]] * 2
    said_next = told(robots["RB"], ("RA", cpas([0, 0, 1, 0, 0, 0, 0], ceiling=9)))
    assert rows(said_next[0][1]) == [[5, 0, 1, 0, 5, 6], [7, 0, 1, 1, 7, 8]]


def test_domains_may_be_of_different_sizes() -> None:
    domains = {"A": (1, 2), "B": (1, 2, 3), "C": (1,)}
    _, said = introduced(team({"AB": (5, 4, 3, 9, 9, 9), "AC": (2, 7)}, domains))
    assert rows(said[0])[0] == [3 + 2, 0, 0, 5, 4, 3, 2]


def test_all_constraint_checks_are_done_before_the_search() -> None:
    robots, said = introduced(team(CHAIN))
    checks = [robot.problem.checks for robot in robots.values()]
    assert told(robots["RB"], ("RA", said[0]))
    assert [robot.problem.checks for robot in robots.values()] == checks


# Many at a time


def row(bound: int) -> list[int]:
    """A CPA for RB in CHAIN, with that bound."""
    return [bound, bound, 1, 0, 0, 0, 0]


def test_the_first_cpa_goes_alone_and_each_bundle_is_twice_as_large() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=9))
    said = told(robots["RB"], ("RA", cpas(*[row(0)] * 11, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2, 4, 8, 8]


def test_no_bundle_is_larger_than_the_setting() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=9, batch=2))
    said = told(robots["RB"], ("RA", cpas(*[row(0)] * 6, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2, 4, 4, 2]


def test_no_message_is_much_larger_than_it_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robochoc.protocols.sfb, "MESSAGE_BYTES", 6)
    robots, _ = introduced(team(CHAIN), SFBSettings(window=1))
    said = told(robots["RB"], ("RA", cpas(row(0), ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [1, 1]
    assert told(robots["RB"], ("RC", Explored())) == []
    assert told(robots["RB"], ("RC", Explored())) == [("RA", Explored())]


def test_no_more_messages_are_under_way_than_the_window_allows() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=2))
    said = told(robots["RB"], ("RA", cpas(*[row(0)] * 11, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2, 4]
    said = told(robots["RB"], ("RC", Explored()))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [8]


def test_one_message_is_under_way_unless_more_are_asked_for() -> None:
    robots, _ = introduced(team(CHAIN))
    said = told(robots["RB"], ("RA", cpas(*[row(0)] * 11, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2]


def test_a_bundle_is_explored_when_all_that_came_of_it_is() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=2))
    told(robots["RB"], ("RA", cpas(row(0), row(0), ceiling=10)))
    assert told(robots["RB"], ("RC", Explored())) == []
    assert told(robots["RB"], ("RC", Explored())) == [("RA", Explored())]


def test_bundles_are_explored_in_the_order_in_which_they_came() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=2))
    first, second = cpas(row(0), ceiling=10), cpas(row(9), least=9, ceiling=10)
    assert [type(message) for _, message in told(robots["RB"], ("RA", first), ("RA", second))] == [CPAs]
    assert told(robots["RB"], ("RC", Explored())) == [("RA", Explored())] * 2


@pytest.mark.parametrize("settings", [{"batch": "0"}, {"window": "0"}, {"batch": "many"}])
def test_settings_that_will_not_do_are_refused(settings: dict[str, str]) -> None:
    with pytest.raises(BadSettings):
        settings_of(SFB, settings)


# Solutions


def test_the_last_robot_makes_the_cheapest_of_its_cpas_a_solution() -> None:
    robots, _ = introduced(team(CHAIN))
    said = told(robots["RC"], ("RB", cpas([2, 2, 0, 1, 2, 1], [1, 1, 1, 0, 0, 4], ceiling=10)))
    assert said == [("RB", Solution(1, [1, 0, 0])), ("RB", Explored())]
    assert value(robots["RC"]) == (1,)


def test_one_that_is_no_cheaper_is_none() -> None:
    robots, _ = introduced(team(CHAIN))
    assert told(robots["RC"], ("RB", cpas([1, 1, 1, 0, 0, 4], least=1, ceiling=10))) == [("RB", Explored())]
    assert value(robots["RC"]) is None


def test_a_solution_is_told_up_the_order_and_everybody_holds_its_value() -> None:
    robots, _ = introduced(team(CHAIN))
    told(robots["RB"], ("RA", cpas(row(0), ceiling=10)))
    assert told(robots["RB"], ("RC", Solution(1, [1, 0, 0]))) == [("RA", Solution(1, [1, 0, 0]))]
    assert value(robots["RB"]) == (1,)
    assert told(robots["RA"], ("RB", Solution(1, [1, 0, 0]))) == []
    assert value(robots["RA"]) == (2,)


def test_what_a_solution_costs_prunes_what_is_there_already_and_what_is_sent() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=1))
    told(robots["RB"], ("RA", cpas(row(0), row(3), row(0), ceiling=10)))
    said = told(robots["RB"], ("RC", Solution(2, [1, 0, 0])), ("RC", Explored()))
    (sent,) = [message for _, message in said if isinstance(message, CPAs)]
    assert sent.least == 2
    assert [one[0] for one in rows(sent)] == [0, 1]


def test_when_the_first_robot_has_explored_all_there_is_nothing_to_say_and_the_solution_stands() -> None:
    robots, _ = introduced(team(CHAIN))
    assert told(robots["RA"], ("RB", Solution(1, [1, 0, 0])), ("RB", Explored())) == []
    assert robots["RA"].verdict is None
    assert value(robots["RA"]) == (2,)


def test_when_the_first_robot_has_explored_all_without_a_solution_there_is_none() -> None:
    robots, _ = introduced(team(CHAIN))
    told(robots["RA"], ("RB", Explored()))
    assert robots["RA"].verdict is Verdict.NO_SOLUTION


def test_all_robots_hold_an_optimal_solution_in_the_end() -> None:
    chance = Random("sfb held")
    for seed in range(60):
        problem = random_cost_team(chance)
        result = Simulation(problem, SFB, RandomChannels(seed)).run(60)
        bests = [found.best for found in result.findings.values()]
        if result.verdict is Verdict.NO_SOLUTION:
            assert bests[0] is None
            continue
        assert len({(best.cost, *best.values.values()) for best in bests if best is not None}) == 1
        assert None not in bests
        for name, own in result.assignments.items():
            assert bests[0] is not None
            shown = bests[0].values[name]
            assert shown == tuple(own.values()) or not problem[name].interface


# What nobody says


@pytest.mark.parametrize(
    ("sender", "message"),
    [
        ("RA", cpas(row(0))),
        ("RC", cpas(row(0))),
        ("RA", CPAs(0, b"", 9, 10)),
        ("RA", CPAs(-1, cpas(row(0)).rows, 9, 10)),
        ("RA", CPAs(10**12, b"", 9, 10)),
        ("RA", CPAs(1, cpas(row(0)).rows, 9, 2**62)),
        ("RA", CPAs(1, cpas(row(0)).rows, -1, 10)),
        ("RA", cpas([0, 0, 99, 0, 0, 0, 0], ceiling=10)),
        ("RA", Above([[(1,)]])),
        ("RC", Below([[(1,)]], [[0]], 1)),
        ("RC", Explored()),
        ("RC", Solution(3, [0, 0])),
        ("RC", Solution(3, [0, 9, 0])),
        ("RA", Solution(3, [0, 0, 0])),
    ],
)
def test_what_no_robot_says_is_refused(sender: str, message: Message) -> None:
    robots, _ = introduced(team(CHAIN))
    stranger = agents(team(CHAIN))["RB"]
    if message == cpas(row(0)) and sender == "RA":  # in order, but before anybody's values are known
        with pytest.raises(ValueError, match="cannot say"):
            stranger.receive(sender, message)
        return
    with pytest.raises(ValueError, match=r"cannot say|are not|there are not"):
        told(robots["RB"], (sender, message))


def test_costs_that_floats_do_not_hold_exactly_are_refused() -> None:
    huge = 2**53
    with pytest.raises(TooMuch, match="2\\^53"):
        introduced(team({"AB": (huge, huge, huge, huge - 1)}))


# What is known so far


def test_before_anything_is_known_there_is_nothing_to_tell() -> None:
    assert agents(team(CHAIN))["RA"].findings == NOTHING


def test_the_first_robot_tells_the_least_bound_of_what_is_not_explored() -> None:
    robots, _ = introduced(team({"AB": (2, 5, 4, 9)}), SFBSettings(window=1))
    assert robots["RA"].findings.bound == 2
    assert robots["RB"].findings.bound is None


def test_whoever_has_heard_of_a_solution_tells_it() -> None:
    robots, _ = introduced(team(CHAIN))
    told(robots["RB"], ("RA", cpas(row(0), ceiling=10)), ("RC", Solution(7, [0, 1, 0])))
    best = robots["RB"].findings.best
    assert best is not None
    assert best.cost == 7
    assert best.values == {"RA": (1,), "RB": (2,), "RC": (1,)}


def test_the_bound_is_never_more_than_the_least_cost_and_is_it_in_the_end() -> None:
    chance = Random("sfb bounds")
    for seed in range(20):
        problem = random_cost_team(chance)
        end = Simulation(problem, SFB, RandomChannels(seed)).run(60)
        best = end.findings["RX00"].best
        least = INFINITE if best is None else best.cost
        for messages in range(0, 200, 20):
            found = Simulation(problem, SFB, RandomChannels(seed)).search(60, messages).findings["RX00"]
            assert found.bound is None or found.bound <= least
        assert best is None or end.findings["RX00"].bound == least


def test_the_docstring_shows_what_happens() -> None:
    assert doctest.testmod(robochoc.protocols.sfb).failed == 0
