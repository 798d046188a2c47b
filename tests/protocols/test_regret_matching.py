"""One test per rule of regret matching (Hart, Mas-Colell 2000; Chapman and others 2011; Tammelin 2014)."""

from __future__ import annotations

import itertools
from collections import Counter
from fractions import Fraction
from random import Random

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics
from robochoc.protocols.local_search.regret_matching import UNIT, RegretMatching
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, assignments_by_cycle, cost_of_assignment, domains_of, played
from tests.support.problems import team_of

B_SAYS = (1, 2, 3)


def robot(costs: tuple[tuple[float, ...], ...], *chances: float, **settings: str) -> RegretMatching:
    """A, whose value i costs `costs[i][j]` where B says its value j; it begins with its first value."""
    values = tuple(range(1, len(costs) + 1))
    pairs = tuple(itertools.product(values, B_SAYS))
    relation = Relation("T", 2, Semantics.SOFT, pairs, tuple(itertools.chain.from_iterable(costs)))
    team = team_of({"A": values, "B": B_SAYS}, [Constraint("C", relation, ("A", "B"), ("A", "B"))])
    it = robot_of(RegretMatching, team, "RA", 0.0, *chances)
    it.settings = read_settings(RegretMatching, settings)  # type: ignore[assignment, misc]
    started(it)
    return it


def hears(it: RegretMatching, said: int) -> tuple[int | None, ...] | None:
    replies(it, ("RB", Value((said,))))
    return value(it)


def recomputed(course: list[tuple[int, list[int]]], weight: Fraction, variant: str) -> list[Fraction]:
    """The regrets by their definition: from the own place and the costs of all own values, cycle by cycle."""
    regrets = [Fraction(0)] * len(course[0][1])
    for place, costs in course:
        saved = [costs[place] - cost for cost in costs]
        if weight:
            regrets = [(1 - weight) * old + weight * new for old, new in zip(regrets, saved, strict=True)]
        else:
            regrets = [old + new for old, new in zip(regrets, saved, strict=True)]
        if variant == "rm+":
            regrets = [max(regret, Fraction(0)) for regret in regrets]
    return regrets


@looped("variant", ["rm", "rm+"])
@looped("weight", ["0", "0.01", "0.1", "0.5", "1"])
@count("games", 2, 20)
def test_regrets_are_what_other_values_would_have_saved(variant: str, weight: str, games: int) -> None:
    """Exactly where all cycles count alike; else rounding is down, by a unit a cycle, which fades as all does."""
    exact = Fraction(round(float(weight) * UNIT), UNIT)
    for seed in range(games):
        chance = Random(f"regrets {seed}")
        costs = tuple(tuple(chance.randrange(10) for _ in B_SAYS) for _ in range(4))
        it = robot(costs, *(chance.random() for _ in range(200)), variant=variant, weight=weight, cycles="100")
        course = []
        for _ in range(40):
            said = chance.choice(B_SAYS)
            course.append((it.present, [row[said - 1] for row in costs]))
            hears(it, said)
            known = recomputed(course, exact, variant)
            fades = 1 / exact + 1 if exact else 0
            assert all(
                0 <= is_ * UNIT - told <= fades if exact else is_ * UNIT == told
                for told, is_ in zip(it.regrets, known, strict=True)
            )


def test_a_value_is_drawn_in_proportion_to_its_positive_regret() -> None:
    costs = ((5, 0, 0), (2, 0, 0), (9, 0, 0), (4, 0, 0))
    drawn = Counter(hears(robot(costs, 0.0, draw / 400, weight="0", inertia="0"), 1) for draw in range(400))
    assert drawn == {(2,): 300, (4,): 100}


def test_who_regrets_nothing_keeps_its_value() -> None:
    it = robot(((1, 0, 0), (1, 0, 0), (9, 0, 0)), inertia="0")
    for _ in range(3):
        assert hears(it, 1) == (1,)
    assert it.regrets[:2] == [0, 0]


def test_inertia_keeps_a_value_whatever_is_regretted() -> None:
    costs = ((9, 0, 0), (0, 0, 0))
    assert hears(robot(costs, 0.29, inertia="0.3"), 1) == (1,)
    assert hears(robot(costs, 0.31, inertia="0.3"), 1) == (2,)


def test_with_weight_one_only_the_last_cycle_counts() -> None:
    it = robot(((9, 1, 0), (0, 7, 0), (5, 3, 0)), 0.9, 0.0, variant="rm", weight="1", inertia="0.5")
    assert hears(it, 1) == (2,)
    assert it.regrets == [0, 9 * UNIT, 4 * UNIT]
    hears(it, 2)
    assert it.regrets == [6 * UNIT, 0, 4 * UNIT]


def test_a_value_that_was_bad_for_long_comes_back_at_once_with_rm_plus() -> None:
    costs = ((0, 9, 0), (9, 0, 0))
    for variant, comes in (("rm", (1,)), ("rm+", (2,))):
        it = robot(costs, *[0.5] * 9, variant=variant, weight="0", inertia="0")
        for _ in range(3):
            assert hears(it, 1) == (1,)
        assert hears(it, 2) == comes


def test_a_broken_constraint_is_regretted_more_than_all_costs() -> None:
    it = robot(((INFINITE, 0, 0), (7, 0, 0), (3, 0, 0)), weight="0", inertia="0")
    hears(it, 1)
    assert it.regrets == [0, 1 * UNIT, 5 * UNIT]


@looped("variant", ["rm", "rm+"])
@count("teams", 10, 300)
def test_who_moves_has_regretted_its_new_value(variant: str, teams: int) -> None:
    """By the definition, from the values of all robots in all cycles, as long as nothing was broken."""
    chance = Random(f"moves {variant}")
    moves = 0
    for seed in range(teams):
        team = random_cost_team(chance)
        result = played(team, RegretMatching, any_schedule(chance), seed, variant=variant, weight=0, cycles=15)
        course = assignments_by_cycle(team, result) if result.verdict is Verdict.SOLUTION else []
        for name, domain in domains_of(team).items():
            seen = []
            for before, after in itertools.pairwise(course):
                row = [cost_of_assignment(team, {**before, name: own}) for own in domain]
                if any(broken for broken, _ in row):
                    break
                seen.append((domain.index(before[name]), [int(cost) for _, cost in row]))
                if before[name] != after[name]:
                    moves += 1
                    assert recomputed(seen, Fraction(0), variant)[domain.index(after[name])] > 0
    assert moves > 5


def test_a_replay_shows_regrets() -> None:
    it = robot(((9, 0, 0), (4, 0, 0)), weight="0.5", inertia="0.5")
    hears(it, 1)
    assert [it.value_notes(index) for index in range(2)] == [{"regret": 0}, {"regret": 2.5}]
