"""One test per rule of MixedDSA, named for it."""

from __future__ import annotations

from random import Random

from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.local_search.mixed_dsa import MixedDSA
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, domains_of, played
from tests.support.problems import team_of


def moves(now: float, other: float, chance: float, variant: str) -> bool:
    """Whether A moves, which pays `now` for its value 1, and `other` for 2."""
    relation = Relation("T", 2, Semantics.SOFT, ((1, 1), (2, 1)), (now, other))
    team = team_of({"A": (1, 2), "B": (1,)}, [Constraint("C", relation, ("A", "B"), ("A", "B"))])
    it = robot_of(MixedDSA, team, "RA", 0.0, chance)
    it.settings = read_settings(MixedDSA, {"variant": variant, "hard": "0.6", "soft": "0.3"})  # type: ignore[assignment, misc]
    started(it)
    replies(it, ("RB", Value((1,))))
    return value(it) == (2,)


@looped(("now", "other", "probabilities"), [
    (INFINITE, 9, {"A": 0.6, "B": 0.6, "C": 0.6}), (9, 8, {"A": 0.3, "B": 0.3, "C": 0.3}),
    (INFINITE, INFINITE, {"A": 0, "B": 0.6, "C": 0.6}), (9, 9, {"A": 0, "B": 0.3, "C": 0.3}),
    (0, 0, {"A": 0, "B": 0, "C": 0.3}), (8, 9, {"A": 0, "B": 0, "C": 0}),
    (9, INFINITE, {"A": 0, "B": 0, "C": 0}),
])  # fmt: skip
def test_the_probability_of_a_move(now: float, other: float, probabilities: dict[str, float]) -> None:
    for variant, probability in probabilities.items():
        if probability:
            assert moves(now, other, probability - 0.01, variant), variant
        assert not moves(now, other, probability, variant), variant


@count("teams", 8, 100)
def test_with_one_probability_for_both_it_is_dsa(teams: int) -> None:
    chance = Random("mixed")
    for seed in range(teams):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            one = played(team, MixedDSA, any_schedule(chance), seed, hard=0.4, soft=0.4, variant="ABC"[seed % 3])
            other = played(team, DSA, any_schedule(chance), seed, probability=0.4, variant="ABC"[seed % 3])
            assert one.findings == other.findings
