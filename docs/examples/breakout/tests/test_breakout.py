"""One test per rule of distributed breakout (Yokoo and Hirayama, ICMAS 1996), named for it."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

import pytest
from graphs import colouring, soluble
from planted_bug import Forgetful
from robochoc_breakout import Breakout, Improve, Ok

from robochoc import Verdict, testing
from robochoc.model.problem import Team
from robochoc.protocols import Message
from robochoc.testing import Concurrent, RandomChannels, Schedule, Simulation, deliver, protocol_objects, violations


def agents(team: Team) -> dict[str, Breakout]:
    return protocol_objects(team, Breakout)


def answers(agent: Breakout, *received: tuple[str, Message]) -> list[tuple[str, Message]]:
    """Return the answers of `agent` to the messages."""
    agent.outbox.clear()
    for sender, message in received:
        agent.receive(sender, message)
    return agent.outbox


def started(team: Team, name: str) -> Breakout:
    agent = agents(team)[name]
    agent.start()
    return agent


PAIR = colouring(2, [(0, 1)], 2)
PATH = colouring(3, [(0, 1), (1, 2)], 2)
TRIANGLE = colouring(3, [(0, 1), (0, 2), (1, 2)])


def test_two_robots_joined_by_hand() -> None:
    team = agents(PAIR)
    for agent in team.values():
        agent.start()
    assert deliver(team) == [("R0", "R1", Ok((1,))), ("R1", "R0", Ok((1,)))]
    assert deliver(team) == [("R0", "R1", Improve(1, 1, 0)), ("R1", "R0", Improve(1, 1, 0))]
    assert deliver(team) == [("R0", "R1", Ok((2,))), ("R1", "R0", Ok((1,)))]
    assert deliver(team) == [("R0", "R1", Improve(0, 0, 0)), ("R1", "R0", Improve(0, 0, 0))]
    assert deliver(team) == []
    assert [agent.assignment for agent in team.values()] == [{"V0": 2}, {"V1": 1}]


def test_the_first_value_is_told_to_all_neighbours() -> None:
    assert started(PATH, "R1").outbox == [("R0", Ok((1,))), ("R2", Ok((1,)))]


def test_who_improves_most_moves_and_the_others_stay() -> None:
    others = [Ok((1,)), Improve(1, 1, 0)]
    agent = started(PATH, "R1")
    assert answers(agent, *[(name, message) for message in others for name in ("R0", "R2")])[-1] == ("R2", Ok((2,)))
    agent = started(PATH, "R0")
    assert answers(agent, ("R1", Ok((1,))), ("R1", Improve(2, 2, 0)))[-1] == ("R1", Ok((1,)))


def test_of_equals_the_first_in_the_order_moves() -> None:
    alike = [Ok((1,)), Improve(1, 1, 0)]
    assert answers(started(PAIR, "R0"), *[("R1", message) for message in alike])[-1] == ("R1", Ok((2,)))
    assert answers(started(PAIR, "R1"), *[("R0", message) for message in alike])[-1] == ("R0", Ok((1,)))


def test_in_a_quasi_local_minimum_violations_weigh_more() -> None:
    agent = started(colouring(2, [(0, 1)], 1), "R0")
    wave = [("R1", Ok((1,))), ("R1", Improve(0, 1, 0))]
    assert answers(agent, *wave)[0] == ("R1", Improve(0, 1, 0))
    assert answers(agent, *wave)[0] == ("R1", Improve(0, 2, 0))
    assert answers(agent, *wave)[0] == ("R1", Improve(0, 3, 0))


def test_where_a_neighbour_can_improve_nothing_weighs_more() -> None:
    agent = started(colouring(2, [(0, 1)], 1), "R0")
    answers(agent, ("R1", Ok((1,))), ("R1", Improve(1, 1, 0)))
    assert agent.weights == {}


def test_a_neighbour_may_be_ahead_by_one_message() -> None:
    agent = started(TRIANGLE, "R0")
    assert answers(agent, ("R1", Ok((2,))), ("R1", Improve(0, 0, 0))) == []
    assert answers(agent, ("R2", Ok((1,)))) == [("R1", Improve(1, 1, 0)), ("R2", Improve(1, 1, 0))]
    assert answers(agent, ("R1", Ok((3,)))) == []
    assert agent.agent_view == {"R1": (2,), "R2": (1,)}
    assert answers(agent, ("R2", Improve(1, 1, 0))) == [("R1", Ok((3,))), ("R2", Ok((3,)))]


def test_the_counter_is_one_more_than_the_least_around() -> None:
    agent = started(colouring(5, [(0, 1), (1, 2), (2, 3), (3, 4)]), "R1")
    first = answers(agent, *_satisfied(0, 0), *_satisfied(0, 0))
    assert ("R0", Improve(0, 0, 0)) in first
    assert ("R0", Improve(0, 0, 1)) in answers(agent, *_satisfied(0, 1))
    assert ("R0", Improve(0, 0, 1)) in answers(agent, *_satisfied(7, 7))


def test_the_counter_begins_again_beside_a_violation() -> None:
    agent = started(colouring(5, [(0, 1), (1, 2), (2, 3), (3, 4)]), "R1")
    answers(agent, *_satisfied(0, 0))
    assert agent.my_termination_counter == 1
    answers(agent, ("R0", Ok((2,))), ("R2", Ok((2,))), ("R0", Improve(0, 0, 3)), ("R2", Improve(0, 1, 0)))
    assert agent.my_termination_counter == 0


def test_the_counter_begins_again_with_an_own_violation() -> None:
    agent = started(colouring(5, [(0, 1), (1, 2), (2, 3), (3, 4)]), "R1")
    answers(agent, *_satisfied(0, 0))
    assert answers(agent, ("R0", Ok((1,))), ("R2", Ok((2,)))) == [("R0", Improve(1, 1, 0)), ("R2", Improve(1, 1, 0))]


def test_a_robot_without_neighbours_says_nothing() -> None:
    agent = started(colouring(3, [(0, 2)]), "R1")
    assert agent.outbox == []
    assert agent.assignment == {"V1": 1}


def test_a_robot_without_values_gives_up() -> None:
    agent = started(colouring(2, [(0, 1)], 0), "R0")
    assert agent.verdict is Verdict.UNKNOWN
    assert answers(agent, ("R1", Ok((1,)))) == []


@pytest.mark.parametrize("nodes", [2, 3, 6, 10])
@pytest.mark.parametrize("seed", range(4))
def test_all_robots_fall_silent_in_the_same_wave(nodes: int, seed: int) -> None:
    """After as many quiet waves as there are robots, less one."""
    edges = [(node - 1, node) for node in range(1, nodes)]
    result = Simulation(colouring(nodes, edges, 2), Breakout, _schedule(seed)).search(messages=50_000)
    assert result.verdict is Verdict.SOLUTION
    per_wave = 2 * len(edges)
    waves, rest = divmod(result.metrics.messages["Ok"], per_wave)
    assert rest == 0
    assert waves >= nodes - 1
    assert result.metrics.messages["Improve"] == waves * per_wave


@pytest.mark.parametrize("seed", range(30))
def test_random_graphs_are_coloured(seed: int) -> None:
    team = soluble(10, 20, Random(seed))
    result = Simulation(team, Breakout, _schedule(seed)).search(messages=50_000)
    assert result.verdict is Verdict.SOLUTION
    assert not list(violations(team, {name: v for own in result.assignments.values() for name, v in own.items()}))


def test_delays_change_nothing() -> None:
    team = soluble(10, 20, Random(0))
    runs = [Simulation(team, Breakout, _schedule(seed)).search(messages=50_000) for seed in range(10)]
    first, *others = [(run.verdict, run.assignments, run.metrics.messages, run.metrics.checks) for run in runs]
    assert all(other == first for other in others)


@pytest.mark.parametrize("seed", range(10))
def test_what_has_no_solution_goes_on_until_the_limit(seed: int) -> None:
    """Beside the triangle, which two colours are too few for, the other part of the team comes to rest."""
    team = colouring(6, [(0, 1), (0, 2), (1, 2), (3, 4)], 2)
    result = Simulation(team, Breakout, _schedule(seed)).search(messages=2000)
    assert result.verdict is Verdict.UNKNOWN
    assert sum(result.metrics.messages.values()) >= 2000


def _satisfied(left: int, right: int) -> Sequence[tuple[str, Message]]:
    """A wave in which both neighbours of `R1`, which holds 1, are satisfied, with these counters."""
    return [("R0", Ok((2,))), ("R2", Ok((2,))), ("R0", Improve(0, 0, left)), ("R2", Improve(0, 0, right))]


def _schedule(seed: int) -> Schedule:
    return RandomChannels(seed) if seed % 2 else Concurrent(seed, 10 * seed)


def test_no_order_of_messages_leads_to_a_fault() -> None:
    testing.check_protocol(Breakout, states=3000)


@pytest.mark.parametrize("seed", range(10))
def test_without_delays_the_planted_bug_is_not_found(seed: int) -> None:
    result = Simulation(soluble(10, 20, Random(seed)), Forgetful, Concurrent(seed)).search(messages=50_000)
    assert result.verdict is Verdict.SOLUTION


def test_the_planted_bug_is_found_in_a_rare_order() -> None:
    with pytest.raises(AssertionError, match=r"Forgetful on .*, after 10 steps: the checker refutes the answer"):
        testing.check_protocol(Forgetful, states=3000)
