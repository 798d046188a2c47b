"""One test per rule of D-Gibbs (Nguyen, Yeoh, Lau, AAMAS 2013), named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.problem import INFINITE
from robochoc.protocols.local_search.d_gibbs import DGibbs, DGibbsSettings, Difference, Finish, Value
from robochoc.protocols.settings import SettingsError, read_settings
from robochoc.run.incumbent import costs_by_cycle
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.agents import after, assert_refused, replies, sent, value
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, cost_of_assignment, domains_of, played
from tests.support.pseudo_trees import priced, unplaced

PRICES = {"AB": [0, 5, 5, 0], "BC": [0, 3, 3, 0]}
"""A and B, and B and C, better have equal values."""


def robot(name: str, *chances: float, cycles: int = 100, temperature: float = 1.0) -> DGibbs:
    """One of A, B and C on a branch, with its first value."""
    made = unplaced(DGibbs, priced("ABC", PRICES), f"R{name}")
    made.parent, made.children = {"A": (None, ("RB",)), "B": ("RA", ("RC",)), "C": ("RB", ())}[name]
    made.settings = DGibbsSettings(cycles=cycles, temperature=temperature)  # type: ignore[misc]
    made.chance = iter([*chances, *[0.0] * 9]).__next__
    made.placed = True
    made.start_in_tree()
    return made


def test_the_first_value_is_drawn_and_told_to_those_above() -> None:
    assert sent(robot("B", 0.9)) == [("RA", Value((2,), True))]
    assert sent(robot("A", 0.9)) == []


def test_a_robot_draws_when_those_above_have_drawn_and_those_below_have_told_their_values() -> None:
    made = robot("A", 0.9)
    assert replies(made, ("RB", Value((1,), True))) == [("RB", Value((1,), True))]
    made = robot("B")
    sent(made)
    assert replies(made, ("RC", Value((1,), True))) == []
    drawn = Value((1,), False)
    assert replies(made, ("RA", Value((1,), False))) == [("RA", drawn), ("RC", drawn)]


def test_a_value_is_drawn_by_what_it_costs_with_the_neighbours_values() -> None:
    """1 costs nothing and 2 costs 5: 1 is drawn with the probability 1 / (1 + e^-5), which is 0.9933.

    Where it is hot, all values are alike.
    """
    for lot, temperature, drawn in ((0.0, 1, 1), (0.992, 1, 1), (0.994, 1, 2), (0.51, 1e9, 2)):
        made = after(robot("A", 0.0, lot, temperature=temperature), ("RB", Value((1,), True)))
        assert value(made) == (drawn,)


def test_what_breaks_a_hard_constraint_is_drawn_seldom() -> None:
    for lot, drawn in ((0.98, 2), (0.983, 1)):
        made = unplaced(DGibbs, priced("AB", {"AB": [0, INFINITE, 0, 0]}), "RA")
        made.children, made.placed = ("RB",), True
        made.chance = iter([0.0, 1 - lot, 0.0]).__next__
        made.start_in_tree()
        replies(made, ("RB", Value((2,), True)))
        assert value(made) == (drawn,)


def test_a_leaf_tells_at_once_by_how_much_the_cost_has_changed_and_others_add_up_what_their_children_tell() -> None:
    made = robot("C", 0.9)
    sent(made)
    assert replies(made, ("RB", Value((1,), False)))[-1] == ("RB", Difference(0, -3))
    made = after(robot("B", 0.9), ("RC", Value((1,), True)), ("RA", Value((1,), False)))
    assert replies(made, ("RC", Value((1,), False)), ("RC", Difference(0, 2))) == [("RA", Difference(0, -6))]


def test_the_root_tells_with_the_next_value_whether_the_sample_was_the_best() -> None:
    """The next sample waits for the values of all below."""
    for change, kept in ((-4, True), (5, False)):
        made = after(robot("A"), ("RB", Value((1,), True)))
        assert replies(made, ("RB", Difference(0, change))) == []
        assert made.cycle == 1
        assert replies(made, ("RB", Value((1,), True))) == [("RB", Value((1,), kept))]


def test_at_the_end_all_take_their_values_of_the_best_sample() -> None:
    for kept, best in ((True, 2), (False, 1)):
        made = after(robot("B", 0.0, 0.999, cycles=1), ("RC", Value((1,), True)), ("RA", Value((2,), True)))
        assert value(made) == (2,)
        replies(made, ("RC", Value((1,), True)), ("RC", Difference(0, 0)))
        assert replies(made, ("RA", Finish(kept))) == [("RC", Finish(kept))]
        assert value(made) == (best,)


def test_what_cannot_be_is_refused() -> None:
    assert_refused(lambda: robot("B"), [("RA", Difference(0, 0))], "RA sent an unexpected or repeated Difference")
    assert_refused(lambda: robot("B"), [("RC", Finish(True))], "RC ended the search, but is not the parent of RB")


@count("teams", 15, 250)
def test_the_values_at_the_end_are_those_of_the_best_sample(teams: int) -> None:
    """So the sums of changes are right, whatever the delays: neighbours never draw together."""
    chance = Random("gibbs")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if not all(domains_of(team).values()):
            continue
        result = played(team, DGibbs, any_schedule(chance), seed, cycles=15)
        trails = {name: found.trail for name, found in result.findings.items() if found.trail}
        assert {trail.cycle for trail in trails.values()} == {16}
        costs = list(costs_by_cycle(CompiledTeam(team), trails))
        last = cost_of_assignment(team, {k: v for own in result.assignments.values() for k, v in own.items()})
        assert costs[-1] == (INFINITE if last[0] else last[1])
        assert costs[-1] == min(costs)


@count("teams", 8, 80)
def test_a_cycle_takes_two_messages_for_each_link_and_one_for_each_child(teams: int) -> None:
    chance = Random("messages")
    for seed in range(teams):
        team = random_cost_team(chance)
        if not all(domains_of(team).values()):
            continue
        events: list[AnyEvent] = []
        parameters = RunParameters(seed, {"cycles": "7"})
        run = Simulation(team, DGibbs, RandomChannels(seed), observer=events.append, parameters=parameters)
        result = run.search()
        kinds = [event.type for event in events if isinstance(event, Sent)]
        children = sum(found.place is not None and found.place.parent is not None for found in result.findings.values())
        links = sum(
            len(found.place.pseudo_parents) + (found.place.parent is not None)
            for found in result.findings.values()
            if found.place
        )
        assert kinds.count("Value") == links * (2 * 7 + 1)
        assert (kinds.count("Difference"), kinds.count("Finish")) == (7 * children, children)


@looped("setting", ["temperature=0", "cooling=0", "cooling=1.1", "hard=-1", "temperature=inf"])
def test_settings_that_cannot_be_are_refused(setting: str) -> None:
    name, number = setting.split("=")
    with pytest.raises(SettingsError, match="it must be"):
        read_settings(DGibbs, {name: number})
