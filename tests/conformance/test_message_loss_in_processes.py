"""Messages that robots in processes drop, with all kinds of options: no verdict is wrong."""

from __future__ import annotations

import pytest

from robochoc.model.orders import Order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import Withdrawal
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.encoding import UnsupportedError
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count, drawn
from tests.support.problems import random_team

pytestmark = [pytest.mark.fresh, pytest.mark.more, pytest.mark.usefixtures("quick_encryption")]
OURS = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]


def problem(number: int) -> tuple[Team, Options]:
    """A random protocol, a team of the kind that it takes, and options that go together more often than not."""
    chance = drawn(f"loss in processes {number}")
    name = OURS[number % len(OURS)]
    traits = protocol_named(name).traits
    team = (random_cost_team if traits.costs else random_team)(chance, n_ary=traits.n_ary)
    cycles = {"cycles": "10"} if hasattr(protocol_named(name).settings, "cycles") else {}
    return team, Options(
        protocol=name,
        runtime=Runtime.PROCESSES,
        seed=number,
        settings=cycles,
        message_loss=chance.choice((0.02, 0.1, 0.4)),
        order=chance.choice((None, None, Order.RANDOM, Order.DOM_DEG, Order.LEXICOGRAPHIC)),
        withdraw=chance.choice((None, None, None, *Withdrawal)),
        deadline=chance.choice((None, None, 2.0)),
    )


def is_true(team: Team, options: Options, outcome: Outcome) -> bool:
    """Return whether the verdict is one that brute force does not contradict, and that loss allows."""
    least = least_cost(team)
    sure = not outcome.metrics.lost_messages or protocol_named(outcome.protocol).traits.bears_loss
    whole = not outcome.withdrawn
    match outcome.verdict:
        case Verdict.SOLUTION if whole:
            return outcome.verified and outcome.cost is not None and least <= outcome.cost < INFINITE
        case Verdict.OPTIMAL if whole:
            return sure and outcome.verified and outcome.cost == least
        case Verdict.SOLUTION | Verdict.OPTIMAL:
            return sure and options.withdraw is not None and outcome.verified and least == INFINITE
        case Verdict.NO_SOLUTION:
            return sure and least == INFINITE
        case Verdict.UNKNOWN:
            return outcome.reason is not None


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
        if not is_true(team, options, outcome):
            wrong.append((number, options.protocol, outcome.verdict, outcome.reason))
    assert wrong == []
    assert lost > 0
