"""One test per rule of forward bounding by the holder, named for it; the bounds: `test_sfb_bounds`."""

from __future__ import annotations

import math
from collections import Counter
from random import Random
from types import SimpleNamespace
from typing import cast

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import Received, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.disclosure import HasOnly, Pays, Reception
from robochoc.protocols.findings import NO_FINDINGS
from robochoc.protocols.message import Message, encode
from robochoc.protocols.optimization.run_lengths import expanded
from robochoc.protocols.optimization.sfb import LARGEST, SFB, Above, Below, CPAs, Explored, SFBSettings, Solution
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import EXACT
from tests.support.agents import replies, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.problems import team_of
from tests.support.sfb_robots import CHAIN, above, agents, below, cpas, introduced, row, rows, team

BOTH = ((1,), (2,))

# Before the search


def test_the_first_robot_tells_its_values_and_each_adds_its_own() -> None:
    robots = agents(team(CHAIN))
    for robot in robots.values():
        robot.start()
    assert robots["RA"].outbox == [("RB", above([BOTH]))]
    assert robots["RB"].outbox == []
    assert replies(robots["RB"], ("RA", above([BOTH]))) == [("RC", above([BOTH] * 2))]


def test_the_last_robot_turns_round_with_what_its_values_are_charged() -> None:
    robots = agents(team(CHAIN))
    robots["RC"].problem.charges = (5.0, 0.0)
    said = replies(robots["RC"], ("RB", above([BOTH] * 2)))
    assert said == [("RB", below([(BOTH, (5, 0))], 5))]
    assert encode(said[0][1]) == encode(below([(BOTH, (5, 0))], 5)), "integers, which take fewer bytes"


def test_on_the_way_up_each_robot_adds_the_most_that_it_can_come_to() -> None:
    """Charges, and constraints of which it is the last but one: each constraint counts once, infinite costs not."""
    robots = agents(team({**CHAIN, "BC": (0, math.inf, 2, 1)}))
    replies(robots["RB"], ("RA", above([BOTH])))
    said = replies(robots["RB"], ("RC", below([(BOTH, (0, 0))], 0)))
    assert said == [("RA", below([(BOTH, (0, 0))] * 2, 2))]
    assert "RC" not in robots["RA"].problem.neighbours


def test_more_than_everything_can_come_to_is_the_ceiling() -> None:
    _, said = introduced(team(CHAIN))
    assert said[0].ceiling == said[0].least == 3 + 4 + 1 + 1


def test_a_robot_without_values_ends_the_search_at_the_start() -> None:
    robots = agents(team_of({"A": (1, 2), "B": (), "C": (1,)}, []))
    robots["RB"].start()
    assert robots["RB"].verdict is Verdict.NO_SOLUTION
    assert replies(robots["RB"], ("RA", above([BOTH]))) == []


def test_a_robot_alone_solves_its_problem_in_silence() -> None:
    robot = agents(team({"A": (3, 1)}))["RA"]
    robot.start()
    assert robot.assignment == {"A": 2}
    assert robot.outbox == []


def test_robots_that_are_alike_are_told_of_once() -> None:
    domains = [BOTH] * 500 + [((7,),)] + [BOTH] * 499
    said = above(domains)
    assert said == Above([BOTH, ((7,),)], [(0, 500), (1, 1), (0, 499)])
    assert expanded(said.domains, said.runs) == domains
    assert len(encode(said)) < 60


@looped("message", [
    Above([BOTH], []), Above([BOTH], [(0, 2)]), Above([BOTH], [(0, 10**12)]), Above([BOTH], [(1, 1)]),
    Above([BOTH], [(-1, 1)]), Above([BOTH], [(0, 2), (0, -1)]),
])  # fmt: skip
def test_domains_of_more_or_fewer_robots_than_there_are_above_are_refused(message: Above) -> None:
    robot = agents(team(CHAIN))["RB"]
    with pytest.raises(ValueError, match="unexpected "):
        robot.receive("RA", message)


@looped(
    "message",
    [
        *(Below([BOTH], [], [(0, 1)], 0), Below([BOTH], [(0,)], [(0, 1)], 0), Below([BOTH], [(0, 0)], [(0, 2)], 0)),
        *(Below([BOTH], [(0, wrong)], [(0, 1)], 0) for wrong in (-3, 0.5, -math.inf, math.nan)),
        Below([BOTH], [(0, 0)], [(0, 1)], -1),
    ],
)
def test_charges_that_do_not_fit_are_refused(message: Below) -> None:
    robot = agents(team(CHAIN))["RB"]
    replies(robot, ("RA", above([BOTH])))
    with pytest.raises(ValueError, match="unexpected "):
        robot.receive("RC", message)


def test_an_observer_expands_no_more_runs_than_there_are_robots() -> None:
    """A journal may contain anything: a list of 10^12 entries would not fit into memory."""
    reception = SimpleNamespace(order=["RA", "RB", "RC"], receiver="RB")
    proofs = Below([BOTH], [(0, 5)], [(0, 10**12)], 5).proves(cast("Reception", reception))
    assert proofs == [HasOnly("RC", BOTH), Pays("RC", (1,), {}, 0, 0), Pays("RC", (2,), {}, 5, 5)]


# Many at a time


def test_the_first_cpa_goes_alone_and_each_bundle_is_twice_as_large() -> None:
    robots, said_first = introduced(team(CHAIN), SFBSettings(window=9), begun=False)
    assert [message.count for message in said_first] == [1, 1]
    said = replies(robots["RB"], ("RA", cpas(*[row(0)] * 11, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [1, 1, 4, 8, 8]


def test_the_others_of_the_first_robot_s_values_wait_for_what_the_first_comes_to() -> None:
    robots, said = introduced(team(CHAIN), begun=False)
    assert [message.count for message in said] == [1]
    assert replies(robots["RA"], ("RB", Solution(1, [1, 0, 0])), ("RB", Explored())) == []
    assert robots["RA"].findings.bound == 1


def test_no_bundle_is_larger_than_the_setting() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=9, batch=2))
    said = replies(robots["RB"], ("RA", cpas(*[row(0)] * 6, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2, 4, 4, 2]


def test_what_does_not_fit_into_a_message_waits_until_that_is_explored() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(memory=3 * 6))  # a CPA for RC has 6 bytes
    said = replies(robots["RB"], ("RA", cpas(row(0), row(0), ceiling=10)))
    for _ in range(4):
        assert [message.count for _, message in said if isinstance(message, CPAs)] == [1]
        said = replies(robots["RB"], ("RC", Explored()))
    assert said == [("RA", Explored())]


def test_what_waits_is_pruned_like_what_is_not_extended() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(memory=1))
    replies(robots["RB"], ("RA", cpas(row(0), ceiling=10)))
    said = replies(robots["RB"], ("RC", Solution(1, [1, 0, 0])), ("RC", Explored()))
    assert said == [("RA", Solution(1, [1, 0, 0])), ("RA", Explored())]


def test_what_waits_counts_for_the_bound() -> None:
    robots, _ = introduced(team({"AB": (2, 5, 4, 9)}), SFBSettings(memory=1))
    replies(robots["RA"], ("RB", Solution(9, [1, 1])), ("RB", Explored()))
    assert robots["RA"].findings.bound == 4


class Watcher:
    """Sees to it that no message of CPAs is larger than `share`, or holds one; and that no more than `window` wait."""

    def __init__(self, share: float, window: int) -> None:
        self.share = share
        self.window = window
        self.under_way: Counter[str] = Counter()

    def __call__(self, event: object) -> None:
        if isinstance(event, Sent) and event.type == "CPAs":
            assert len(event.content["rows"]) <= self.share or event.content["count"] == 1
            self.under_way[event.sender] += 1
            assert self.under_way[event.sender] <= self.window
        elif isinstance(event, Received) and event.type == "Explored":
            self.under_way[event.receiver] -= 1


@pytest.mark.timeout(1200)
@count("problems", 20, 2000)
def test_messages_keep_to_their_share_whatever_the_memory_and_the_answer_is_right(problems: int) -> None:
    for seed in range(problems):
        chance = Random(f"sfb memory {seed}")
        problem = random_cost_team(chance)
        memory, window = chance.choice((1, 7, 50, 300, 2000)), chance.choice((1, 1, 3))
        watcher = Watcher(memory / (len(problem.robots) * window), window)
        settings = {"memory": str(memory), "window": str(window), "batch": str(chance.choice((1, 3, 4096)))}
        parameters = RunParameters(settings=settings)
        end = Simulation(problem, SFB, RandomChannels(seed), observer=watcher, parameters=parameters).run(60)
        least, best = least_cost(problem), end.findings["RX00"].best
        assert (INFINITE if best is None else best.cost) == least, seed
        assert (end.verdict is Verdict.NO_SOLUTION) == (best is None), seed
        assert best is None or end.findings["RX00"].bound == least, seed


def test_with_much_memory_messages_are_no_larger_than_others_can_take() -> None:
    robot = introduced(team(CHAIN), SFBSettings(memory=1 << 40))[0]["RA"]
    assert robot.share == LARGEST


def test_no_more_messages_are_under_way_than_the_window_allows() -> None:
    """One, unless more are asked for."""
    robots, _ = introduced(team(CHAIN))
    said = replies(robots["RB"], ("RA", cpas(*[row(0)] * 11, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2]
    robots, _ = introduced(team(CHAIN), SFBSettings(window=2))
    said = replies(robots["RB"], ("RA", cpas(*[row(0)] * 11, ceiling=10)))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [2, 4]
    said = replies(robots["RB"], ("RC", Explored()))
    assert [message.count for _, message in said if isinstance(message, CPAs)] == [8]


def test_a_bundle_is_explored_when_all_that_came_of_it_is() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=2))
    replies(robots["RB"], ("RA", cpas(row(0), row(0), ceiling=10)))
    assert replies(robots["RB"], ("RC", Explored())) == []
    assert replies(robots["RB"], ("RC", Explored())) == [("RA", Explored())]


def test_bundles_are_explored_in_the_order_in_which_they_came() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=2))
    first, second = cpas(row(0), ceiling=10), cpas(row(9), least=9, ceiling=10)
    assert [type(message) for _, message in replies(robots["RB"], ("RA", first), ("RA", second))] == [CPAs]
    assert replies(robots["RB"], ("RC", Explored())) == [("RA", Explored())] * 2


# Solutions


def test_the_last_robot_makes_the_cheapest_of_its_cpas_a_solution() -> None:
    robots, _ = introduced(team(CHAIN))
    said = replies(robots["RC"], ("RB", cpas([2, 2, 0, 1, 2, 1], [1, 1, 1, 0, 0, 4], ceiling=10)))
    assert said == [("RB", Solution(1, [1, 0, 0])), ("RB", Explored())]
    assert value(robots["RC"]) == (1,)


def test_one_that_is_no_cheaper_or_costs_more_than_the_robot_before_said_is_none() -> None:
    for bundle in (cpas([1, 1, 1, 0, 0, 4], least=1, ceiling=10), cpas([1, 3, 1, 0, 2, 4], least=5, ceiling=10)):
        robots, _ = introduced(team(CHAIN))
        assert replies(robots["RC"], ("RB", bundle)) == [("RB", Explored())]
        assert value(robots["RC"]) is None


def test_a_solution_is_told_up_the_order_and_everybody_holds_its_value() -> None:
    robots, _ = introduced(team(CHAIN))
    replies(robots["RB"], ("RA", cpas(row(0), ceiling=10)))
    assert replies(robots["RB"], ("RC", Solution(1, [1, 0, 0]))) == [("RA", Solution(1, [1, 0, 0]))]
    assert value(robots["RB"]) == (1,)
    assert replies(robots["RA"], ("RB", Solution(1, [1, 0, 0]))) == []
    assert value(robots["RA"]) == (2,)


def test_what_a_solution_costs_prunes_what_is_there_already_and_what_is_sent() -> None:
    robots, _ = introduced(team(CHAIN), SFBSettings(window=1))
    replies(robots["RB"], ("RA", cpas(row(0), row(3), row(0), ceiling=10)))
    said = replies(robots["RB"], ("RC", Solution(2, [1, 0, 0])), ("RC", Explored()))
    (sent,) = [message for _, message in said if isinstance(message, CPAs)]
    assert sent.least == 2
    assert [one[0] for one in rows(sent)] == [0, 1]


def test_when_the_first_robot_has_explored_all_the_solution_stands_or_there_is_none() -> None:
    robots, _ = introduced(team(CHAIN))
    assert replies(robots["RA"], ("RB", Solution(1, [1, 0, 0])), ("RB", Explored())) == []
    assert robots["RA"].verdict is None
    assert value(robots["RA"]) == (2,)
    robots, _ = introduced(team(CHAIN))
    replies(robots["RA"], ("RB", Explored()))
    assert robots["RA"].verdict is Verdict.NO_SOLUTION


@count("teams", 25, 100)
def test_all_robots_hold_an_optimal_solution_in_the_end(teams: int) -> None:
    chance = Random("sfb held")
    for seed in range(teams):
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


@looped(("sender", "message"), [
    ("RA", cpas(row(0))), ("RC", cpas(row(0))), ("RA", CPAs(0, b"", 9, 10)),
    ("RA", CPAs(-1, cpas(row(0)).rows, 9, 10)), ("RA", CPAs(10**12, b"", 9, 10)),
    ("RA", CPAs(1, cpas(row(0)).rows, 9, 2**62)), ("RA", CPAs(1, cpas(row(0)).rows, -1, 10)),
    ("RA", cpas([0, 0, 99, 0, 0, 0, 0], ceiling=10)), ("RA", above([((1,),)])),
    ("RC", below([(((1,),), (0,))], 1)), ("RC", Explored()), ("RC", Solution(3, [0, 0])),
    ("RC", Solution(3, [0, 9, 0])), ("RA", Solution(3, [0, 0, 0])),
])  # fmt: skip
def test_what_no_robot_says_is_refused(sender: str, message: Message) -> None:
    robots, _ = introduced(team(CHAIN))
    stranger = agents(team(CHAIN))["RB"]
    if message == cpas(row(0)) and sender == "RA":  # in order, but before anybody's values are known
        with pytest.raises(ValueError, match="unexpected "):
            stranger.receive(sender, message)
        return
    with pytest.raises(ValueError, match=r"unexpected |cannot contain|do not exist"):
        replies(robots["RB"], (sender, message))


def test_costs_that_floats_do_not_hold_exactly_are_refused() -> None:
    huge = EXACT
    with pytest.raises(TooLargeError, match="2\\^53"):
        introduced(team({"AB": (huge, huge, huge, huge - 1)}))


# What is known so far


def test_before_anything_is_known_there_is_nothing_to_tell() -> None:
    assert agents(team(CHAIN))["RA"].findings == NO_FINDINGS


def test_the_first_robot_tells_the_least_bound_of_what_is_not_explored() -> None:
    robots, _ = introduced(team({"AB": (2, 5, 4, 9)}), SFBSettings(window=1))
    assert robots["RA"].findings.bound == 2
    assert robots["RB"].findings.bound is None


def test_whoever_has_heard_of_a_solution_tells_it() -> None:
    robots, _ = introduced(team(CHAIN))
    replies(robots["RB"], ("RA", cpas(row(0), ceiling=10)), ("RC", Solution(7, [0, 1, 0])))
    best = robots["RB"].findings.best
    assert best is not None
    assert best.cost == 7
    assert best.values == {"RA": (1,), "RB": (2,), "RC": (1,)}


@count("teams", 10, 50)
def test_the_bound_is_never_more_than_the_least_cost_and_is_it_in_the_end(teams: int) -> None:
    chance = Random("sfb bounds")
    for seed in range(teams):
        problem = random_cost_team(chance)
        end = Simulation(problem, SFB, RandomChannels(seed)).run(60)
        best = end.findings["RX00"].best
        least = INFINITE if best is None else best.cost
        for messages in range(0, 200, 20):
            found = Simulation(problem, SFB, RandomChannels(seed)).search(60, messages).findings["RX00"]
            assert found.bound is None or found.bound <= least
        assert best is None or end.findings["RX00"].bound == least
