"""Messages that are really lost: every protocol comes to its end, and says nothing that is wrong."""

from __future__ import annotations

import itertools
from math import log10
from random import Random

import pytest

from robochoc.communication.simulator.channel import ChannelModel
from robochoc.communication.simulator.loss_models import Bursts, NamedLink, PathLoss, Point
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.shared.cycles import CycleProtocol
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import ScheduleName, Withdrawal
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from tests.support.brute_force import least_cost
from tests.support.cases import cases, looped
from tests.support.cost_problems import random_cost_team
from tests.support.encrypted_problems import short_settings
from tests.support.examples import are_the_same, count, drawn
from tests.support.loose_problems import minimum_cost
from tests.support.problems import random_team

pytestmark = [pytest.mark.fresh, pytest.mark.usefixtures("quick_encryption")]
OURS = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]
BEARING = [name for name in OURS if protocol_named(name).traits.bears_loss]
SCHEDULES = list(ScheduleName)


def run(name: str, team: Team, number: int, loss: float = 0.1, radio: ChannelModel | None = None) -> Outcome | None:
    """Return the outcome of `team`, compared with brute force; None: the protocol does not accept this team."""
    options = Options(
        protocol=name,
        runtime=Runtime.SIMULATOR,
        seed=number,
        schedule=ScheduleName.CONCURRENT if radio else SCHEDULES[number % len(SCHEDULES)],
        message_loss=loss,
        channel=radio,
    )
    try:
        outcome = solve(team, options)
    except UnsupportedError:
        return None
    assert is_true(team, outcome), (outcome.verdict, outcome.cost, outcome.reason)
    return outcome


def team_for(name: str, chance: Random) -> Team:
    """Return a team of the kind that the protocol accepts; two of three have costs if it minimises them."""
    traits = protocol_named(name).traits
    kind = random_cost_team if traits.costs and chance.random() < 0.7 else random_team
    return kind(chance, n_ary=traits.n_ary)


def is_true(team: Team, outcome: Outcome) -> bool:
    """Return whether the verdict is one that brute force does not contradict, and that loss allows."""
    least = minimum_cost(team)
    sure = not outcome.metrics.lost_messages or protocol_named(outcome.protocol).traits.bears_loss
    match outcome.verdict:
        case Verdict.SOLUTION | Verdict.OPTIMAL if outcome.withdrawn:
            return sure and outcome.verified and least == INFINITE
        case Verdict.SOLUTION:
            return outcome.verified and outcome.cost is not None and least <= outcome.cost < INFINITE
        case Verdict.OPTIMAL:
            return sure and outcome.verified and outcome.cost == least
        case Verdict.NO_SOLUTION:
            return sure and least == INFINITE
        case Verdict.UNKNOWN:
            return outcome.reason is not None


def random_radio(chance: Random, team: Team) -> ChannelModel:
    """A radio that loses messages by distance, in bursts, and all of one link, by chance each."""
    places: dict[str, Point] = {name: (chance.uniform(0, 100), chance.uniform(0, 100)) for name in team.order}
    far = chance.uniform(30, 150)
    path_loss = PathLoss(power_dbm=0, sensitivity_dbm=-40 - 20 * log10(far), shadowing_db=chance.choice((0, 6)))
    table = ((far / 2, 0.0), (far, chance.uniform(0, 1)))
    by_distance = chance.choice(("path_loss", "distance_loss", ""))
    pair = chance.sample(team.order, 2)
    return ChannelModel(
        name="radio",
        latency_ms=1,
        sigma=0.5,
        timeout_ms=10,
        message_loss=chance.choice((0, 0.05)),
        path_loss=path_loss if by_distance == "path_loss" else None,
        distance_loss=table if by_distance == "distance_loss" else (),
        positions=places if by_distance else {},
        bursts=Bursts(begin=0.05, end=0.3, loss=0.9) if chance.random() < 0.5 else None,
        links=(NamedLink(between=(pair[0], pair[1]), loss=1),) if chance.random() < 0.3 else (),
    )


@looped("kind", ["a tenth of all messages", "a radio"])
@count("runs", 60, 1000)
def test_whatever_is_lost_no_protocol_is_wrong(kind: str, runs: int) -> None:
    lost = 0
    with cases() as each:
        for number in range(runs):
            name = OURS[number % len(OURS)]
            with each(f"{name} {number}"):
                chance = drawn(f"lost by {kind} {number}")
                team = team_for(name, chance)
                if kind == "a radio":
                    outcome = run(name, team, number, 0, random_radio(chance, team))
                else:
                    outcome = run(name, team, number)
                lost += outcome.metrics.lost_messages if outcome else 0
    assert lost > runs


@count("runs", 2, 80)
def test_what_bears_loss_ends_with_an_answer_wherever_there_is_one(runs: int) -> None:
    """Of the teams that have a solution nearly all get one; none of them is taken from those that have none."""
    solvable = solved = 0
    with cases() as each:
        for name, number in itertools.product(BEARING, range(runs)):
            with each(f"{name} {number}"):
                team = team_for(name, drawn(f"bears loss {name} {number}"))
                outcome = run(name, team, number)
                assert outcome is not None
                solvable += least_cost(team) < INFINITE
                solved += outcome.verdict in {Verdict.SOLUTION, Verdict.OPTIMAL}
    assert solved <= solvable
    assert solved >= 0.8 * solvable or not are_the_same()


@count("runs", 24, 1000)
def test_with_asymmetric_costs_no_verdict_is_wrong_either(runs: int) -> None:
    names = [name for name in BEARING if protocol_named(name).traits.asymmetric]
    assert {"acls", "mcs-mgm", "gca-mgm"} <= set(names)
    lost = 0
    with cases() as each:
        for number in range(runs):
            with each(number):
                seed = drawn(f"asymmetric {number}").getrandbits(30)
                team = random_csp(4, 3, 0.7, 0.2, seed, max_cost=9, asymmetric=True)
                outcome = run(names[number % len(names)], team, number)
                assert outcome is not None
                assert outcome.verdict in {Verdict.SOLUTION, Verdict.UNKNOWN}
                lost += outcome.metrics.lost_messages
    assert lost > runs


def test_even_nine_of_ten_lost_is_no_reason_to_wait_for_ever() -> None:
    with cases() as each:
        for name in BEARING:
            with each(name):
                outcome = run(name, team_for(name, Random(3)), 1, loss=0.9)
                assert outcome is not None
                assert outcome.metrics.lost_messages > 0


def problem(number: int) -> tuple[Team, Options]:
    """A random protocol, a team of the kind that it takes, and options that go together more often than not."""
    chance = drawn(f"loss in processes {number}")
    name = OURS[number % len(OURS)]
    traits = protocol_named(name).traits
    team = (random_cost_team if traits.costs else random_team)(chance, n_ary=traits.n_ary)
    return team, Options(
        protocol=name,
        runtime=Runtime.PROCESSES,
        seed=number,
        settings=short_settings(name, 10),
        message_loss=chance.choice((0.02, 0.1, 0.4)),
        order=chance.choice((None, None, Order.RANDOM, Order.DOM_DEG, Order.LEXICOGRAPHIC)),
        withdraw=chance.choice((None, None, None, *Withdrawal)),
        deadline=chance.choice((None, None, 2.0)),
    )


@pytest.mark.more
@count("runs", 60, 300)
def test_with_any_protocol_and_options_no_verdict_is_wrong(runs: int) -> None:
    lost, wrong = 0, []
    for number in range(runs):
        team, options = problem(number)
        try:
            outcome = solve(team, options)
        except UnsupportedError:
            continue
        lost += outcome.metrics.lost_messages
        if not is_true(team, outcome):
            wrong.append((number, options.protocol, outcome.verdict, outcome.reason))
    assert wrong == []
    assert lost > 0


def test_all_of_the_three_families_bear_loss() -> None:
    """`kopt` and `lamdls-2` do not: their robots receive some messages only once, and wait for them."""
    assert {"dsa", "mgm", "maxsum", "a-dsa", "async-maxsum", "gdba"} <= set(BEARING)
    assert not any(protocol_named(name).traits.complete for name in BEARING)
    in_cycles = {name for name in OURS if issubclass(protocol_named(name), CycleProtocol)}
    assert in_cycles - {"kopt", "lamdls-2"} == in_cycles & set(BEARING)
