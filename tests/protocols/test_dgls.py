"""One test per rule of DGLS (Deng, Wang, An 2025), named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team, Value
from robochoc.protocols.local_search.dgls import DGLS, PenalisedValue, Reduction
from robochoc.protocols.local_search.mgm import MGM
from robochoc.protocols.settings import read_settings
from robochoc.run.incumbent import best_known
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.agents import replies, robot_of, started, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import pair, random_cost_team, random_hard_team, weighted_colouring
from tests.support.examples import count, drawn
from tests.support.local_search_runs import any_schedule, domains_of, played
from tests.support.problems import team_of

NONE = Reduction(0, 0)
ROWS = ((1, 1), (1, 2), (2, 1), (2, 2))


def robot(team: Team, chance: float = 0.0, name: str = "RA", **settings: str) -> DGLS:
    """A robot that begins with the value 1; then each number that it draws is `chance`."""
    it = robot_of(DGLS, team, name, 0.0)
    it.settings = read_settings(DGLS, settings)  # type: ignore[assignment, misc]
    started(it)
    it.chance = lambda: chance
    return it


def cycle(it: DGLS, other: int, *, penalised: bool = False, told: Reduction = NONE) -> Reduction:
    """Return the reduction of A in a cycle in which B has the value `other`; B may have penalised the function."""
    ((_, said),) = replies(it, ("RB", PenalisedValue((other,), ((),) if penalised else ())))
    assert isinstance(said, Reduction)
    replies(it, ("RB", told))
    return said


def penalties(it: DGLS, other: int = 1) -> list[int]:
    """Return the penalty of each value of A, in thousandths, if B has the value `other`."""
    (robots,) = it.functions
    return it.penalties(robots, it.functions[robots]._replace(others=((other,),)))


def of(*costs: float, default: float = 0) -> Team:
    return pair(Relation("T", 2, Semantics.SOFT, ROWS[: len(costs)], costs, default))


@looped(("costs", "share"), [((2, 5, 3, 4), 0), ((5, 2, 6, 4), 0.75), ((5, 2, 3, 4), 1), ((INFINITE, 2, 3, 4), 1),
                             ((5, 2, 6, INFINITE), 0.75)])  # fmt: skip
def test_a_function_is_violated_with_the_share_of_its_cost_between_minimum_and_maximum(
    costs: tuple[float, ...], share: float
) -> None:
    for drawn_number, violated in ((share - 0.01, True), (share, False)):
        if 0 <= drawn_number < 1:
            it = robot(of(*costs), drawn_number)
            replies(it, ("RB", PenalisedValue((1,))))
            it.penalise()
            assert bool(it.penalised) is violated


def test_penalties_are_sent_with_the_next_value_and_only_in_a_quasi_local_minimum() -> None:
    it = robot(of(2, 5, 3, 1))
    cycle(it, 1, told=Reduction(0, 1))
    assert it.penalised == []
    replies(it, ("RB", PenalisedValue((1,))))
    assert replies(it, ("RB", NONE)) == [("RB", PenalisedValue((1,), ((),)))]


def test_modifiers_evaporate_in_each_cycle_and_never_exceed_the_limit_of_the_series() -> None:
    it = robot(of(2, 5, 3, 4), gamma="0.5", modifier="A")
    for expected in (1000, 1500, 1750):
        cycle(it, 1, penalised=True)
        assert penalties(it) == [expected] * 2
    cycle(it, 1)
    assert penalties(it) == [875] * 2
    for _ in range(30):
        cycle(it, 1, penalised=True)
    assert max(penalties(it)) <= 2000


def test_a_constraint_that_both_sides_penalise_gets_one_penalty() -> None:
    for scope in "ERCT":
        it = robot(of(2, 5, 3, 1), scope=scope, modifier="A")
        cycle(it, 1)
        assert it.penalised == [("RB",)]
        cycle(it, 1, penalised=True)
        assert penalties(it)[0] == 1000


@looped(("scope", "by_self", "by_other"), [
    ("E", ([1, 0], [0, 0]), ([1, 0], [0, 0])),
    ("R", ([1, 1], [0, 0]), ([1, 0], [1, 0])),
    ("C", ([1, 0], [1, 0]), ([1, 1], [0, 0])),
    ("T", ([1, 1], [1, 1]), ([1, 1], [1, 1])),
])  # fmt: skip
def test_the_scope_says_which_entries_are_penalised(
    scope: str, by_self: tuple[list[int], ...], by_other: tuple[list[int], ...]
) -> None:
    """The rows of one robot are the columns of the other, so both sides have the same modifiers."""
    for expected, own in ((by_self, True), (by_other, False)):
        it = robot(of(2, 5, 3, 1) if own else of(2, 5, 3, 4), scope=scope, modifier="A")
        cycle(it, 1)
        cycle(it, 1, penalised=not own)
        assert [[one // 1000 for one in penalties(it, other)] for other in (1, 2)] == [*expected]


@looped(("modifier", "reduction"), [("A", 1000), ("M", 2000)])
def test_the_effective_cost_is_f_plus_m_or_f_times_one_plus_m(modifier: str, reduction: int) -> None:
    """The value 1 costs 5, and 2 costs 4; the table has one penalty."""
    it = robot(of(5, 9, 4, 9), modifier=modifier)
    assert cycle(it, 1, penalised=True, told=Reduction(0, 10_000)) == Reduction(0, reduction)


def test_it_leaves_a_local_minimum() -> None:
    it = robot(of(5, 9, 6, 2), scope="E", modifier="M", gamma="0.9")
    assert cycle(it, 1) == NONE
    assert cycle(it, 1) == Reduction(0, 4000)
    assert value(it) == (2,)


def test_a_function_that_is_not_shared_is_refused() -> None:
    it = robot(of(2, 5, 3, 4))
    with pytest.raises(ValueError, match="RB has penalised a function that this robot does not share"):
        replies(it, ("RB", PenalisedValue((1,), (("RX",),))))


def test_a_broken_constraint_gets_heavier_by_a_broken_constraint() -> None:
    for modifier in "AM":
        it = robot(of(INFINITE, 1, INFINITE, 1), modifier=modifier, scope="E")
        assert cycle(it, 1) == NONE
        assert cycle(it, 1) == Reduction(1000, 0)


def other_index(value: Value | None) -> int | None:
    """Return the index of a value among 1 and 2."""
    return None if value is None or value[0] is None else value[0] - 1


@count("teams", 6, 60)
def test_both_sides_of_a_constraint_have_the_same_modifiers(teams: int) -> None:
    """In the paper this makes each cycle a potential game. A path of three robots, played by hand."""
    chance = Random("sides")
    for _ in range(teams):
        scope = chance.choice("ERCT")
        costs = tuple(chance.randint(0, 9) for _ in ROWS)
        edges = (("A", "B"), ("B", "C"))
        relation = Relation("T", 2, Semantics.SOFT, ROWS, costs)
        team = team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("C", relation, edge, edge) for edge in edges])
        robots = {name: robot_of(DGLS, team, name, chance.random()) for name in ("RA", "RB", "RC")}
        for it in robots.values():
            it.settings = read_settings(DGLS, {"scope": scope, "cycles": "12"})  # type: ignore[assignment, misc]
            it.chance = chance.random
        queue = [(name, *sent) for name, it in robots.items() for sent in started(it)]
        while queue:
            sender, receiver, message = queue.pop(0)
            queue += [(receiver, *sent) for sent in replies(robots[receiver], (sender, message))]
        one, other = robots["RA"], robots["RB"]
        seen = {
            (own, values[0]): penalty for (own, values), penalty in one.modifiers.get(("RB",), {}).items() if penalty
        }
        mirrored = {
            (other_index(values[0]), None if own is None else (own + 1,)): penalty
            for (own, values), penalty in other.modifiers.get(("RA",), {}).items()
            if penalty
        }
        assert seen == mirrored


@count("teams", 4, 40)
def test_with_additive_tables_it_is_mgm(teams: int) -> None:
    """Costs of 0 or the maximum, so that no random number is drawn for a penalty."""
    chance = drawn("as mgm")
    for seed in range(teams):
        team = weighted_colouring(chance, 10, 4, 3)
        one = played(team, DGLS, any_schedule(chance), seed, modifier="A", scope="T", cycles=15)
        other = played(team, MGM, any_schedule(chance), seed, cycles=15)
        assert one.findings == other.findings


@count("teams", 16, 200)
def test_every_variant_comes_close_to_the_least_cost(teams: int) -> None:
    chance = Random("variants")
    optimal = runs = 0
    for seed in range(teams):
        team = (random_cost_team if seed % 2 else random_hard_team)(chance)
        least = least_cost(team)
        if least == INFINITE or not all(domains_of(team).values()):
            continue
        settings = {"modifier": chance.choice("AM"), "scope": chance.choice("ERCT"), "gamma": chance.choice((0.5, 0.9))}
        found = best_known(CompiledTeam(team), played(team, DGLS, Concurrent(seed), seed, **settings, cycles=30))
        if found is not None:
            assert found.cost >= least
            runs += 1
            optimal += found.cost == least
    assert optimal >= runs // 2


@looped("gamma", ["-0.1", "1", "nan"])
def test_a_gamma_outside_its_range_is_refused(gamma: str) -> None:
    with pytest.raises(ValueError, match="it must be from 0 to below 1"):
        read_settings(DGLS, {"gamma": gamma})
