"""The answer of a run is at least as good as every assignment that its observers have seen."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from operator import attrgetter
from random import Random

import pytest

from robochoc.journal.events import AnyEvent, Began, Decided
from robochoc.model.costs import normalized
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.known_costs import DecidedValues
from robochoc.run.options import AnswerRule
from robochoc.run.recording import objective_to_record
from robochoc.run.registry import protocol_named
from robochoc.verification.objective import Objective
from tests.support.allocation_problems import ANY_TEAM
from tests.support.announcements import best_of, check_announcements, observed
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_hard_team, with_costs
from tests.support.encrypted_problems import affordable, short_settings

MINIMISING = tuple(name for name in ANY_TEAM if protocol_named(name).traits.costs)
INCOMPLETE = tuple(name for name in MINIMISING if not protocol_named(name).traits.complete)
COMPLETE = ("adopt", "bnb-adopt", "sfb", "syncbb")
CYCLES = 8


def some_team(chance: Random, number: int) -> Team:
    """Return a team with costs, or with hard constraints only."""
    if number % 3 == 2:
        return with_costs(random_hard_team(chance, n_ary=False))
    return random_cost_team(chance, n_ary=False)


@looped("protocol", INCOMPLETE)
def test_the_answer_is_the_best_that_was_announced(protocol: str) -> None:
    chance, any_announced = Random(f"announced {protocol}"), 0
    for number in range(6):
        team = affordable(protocol, partial(some_team, chance, number))
        schedule = (ScheduleName.CONCURRENT, ScheduleName.CYCLES, ScheduleName.RANDOM)[number % 3]
        options = Options(
            protocol=protocol,
            runtime=Runtime.SIMULATOR,
            seed=number,
            schedule=schedule,
            settings=short_settings(protocol, CYCLES),
        )
        any_announced += check_announcements(team, options)
    assert any_announced


@looped("protocol", (*INCOMPLETE, *COMPLETE))
def test_the_answer_of_a_search_that_was_cut_is_the_best_that_was_announced(protocol: str) -> None:
    chance, any_announced = Random(f"cut {protocol}"), 0
    for number in range(6):
        team = affordable(protocol, partial(some_team, chance, number))
        options = Options(
            protocol=protocol, runtime=Runtime.SIMULATOR, seed=number, messages=chance.choice((20, 60)),
            settings=short_settings(protocol, CYCLES), cache=False,
        )  # fmt: skip
        any_announced += check_announcements(team, options)
    assert any_announced or protocol in {"duct", "maxsum", "bounded-maxsum", "p-dsa", "p-maxsum", "p-mgm"}


@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.ARRAYS])
@pytest.mark.parametrize("protocol", ["dsa", "mgm2", "maxsum"])
def test_that_it_is_so_in_other_runtimes(protocol: str, runtime: Runtime) -> None:
    team = random_cost_team(Random(4), n_ary=False)
    assert check_announcements(
        team, Options(protocol=protocol, runtime=runtime, seed=2, settings=short_settings(protocol, CYCLES))
    )


def test_a_better_assignment_between_two_cycles_is_the_answer() -> None:
    chance, better = Random(11), 0
    for seed in range(30):
        team = random_cost_team(chance, n_ary=False)
        settings = {"cycles": "3", "probability": "0.9"}
        options = Options(protocol="dsa", runtime=Runtime.SIMULATOR, seed=seed, settings=settings, repair=False)
        seen, unseen = observed(team, options)[0], solve(team, options)
        assert (seen.metrics.messages, seen.metrics.ncccs) == (unseen.metrics.messages, unseen.metrics.ncccs)
        assert unseen.cost is None or (seen.cost is not None and best_of(team, [seen.cost, unseen.cost]) == seen.cost)
        better += seen.cost != unseen.cost
    assert better


def test_the_final_values_are_the_answer_on_request() -> None:
    chance, worse = Random(7), 0
    for seed in range(20):
        team = random_cost_team(chance, n_ary=False)
        settings = {"cycles": "5", "probability": "0.9"}
        options = Options(
            protocol="dsa", runtime=Runtime.SIMULATOR, seed=seed, settings=settings, answer=AnswerRule.FINAL
        )
        outcome, events, costs = observed(team, options)
        objective = Objective(normalized(team))
        for event in events:
            if isinstance(event, Decided):
                objective.change({event.robot: event.assignment})
        if objective.cost < float("inf"):
            assert outcome.verdict is Verdict.SOLUTION
            assert outcome.cost == objective.in_user_units(objective.cost)
            worse += best_of(team, costs) != outcome.cost
        else:
            assert outcome.verdict is Verdict.UNKNOWN
        assert solve(team, options).cost == outcome.cost
        arrays = solve(team, replace(options, runtime=Runtime.ARRAYS))
        assert (arrays.cost, arrays.assignment) == (outcome.cost, outcome.assignment)
    assert worse


def test_decisions_in_both_orders_count() -> None:
    """Robots in processes report in batches, so the order of the reports is not that of the times."""
    team = random_cost_team(Random(4), n_ary=False)
    events: list[AnyEvent] = []
    solve(team, Options(protocol="dsa", runtime=Runtime.SIMULATOR, settings={"cycles": "6"}), observer=events.append)
    decided = [event for event in events if isinstance(event, Decided)]
    make = objective_to_record(team, Options())
    assert make is not None

    def cheapest(order: list[Decided]) -> float:
        values = DecidedValues(make())
        values(Began(t=0, protocol="dsa", minimises=True))
        for event in order:
            values(event)
        found = values.cheapest()
        objective = make()
        objective.change(found or {})
        return objective.cost

    reversed_order = sorted(decided, key=attrgetter("robot"))
    assert cheapest(reversed_order) <= cheapest(sorted(decided, key=attrgetter("t")))
