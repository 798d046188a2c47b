"""One test per rule of DSA-SDP (Zivan, Okamoto, Peled, AIJ 212, 2014, Section 5), named for it."""

from __future__ import annotations

from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics
from robochoc.protocols.local_search.dsa_sdp import DSASDP
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped
from tests.support.problems import team_of


def robot(now: float, other: float, *chances: float, **settings: str) -> DSASDP:
    """A, which pays `now` for its value 1, and `other` for 2."""
    relation = Relation("T", 2, Semantics.SOFT, ((1, 1), (2, 1)), (now, other))
    team = team_of({"A": (1, 2), "B": (1,)}, [Constraint("C", relation, ("A", "B"), ("A", "B"))])
    it = robot_of(DSASDP, team, "RA", 0.0, *chances)
    it.settings = read_settings(DSASDP, settings)  # type: ignore[assignment, misc]
    started(it)
    return it


def moves(now: float, other: float, chance: float, **settings: str) -> bool:
    it = robot(now, other, chance, **settings)
    replies(it, ("RB", Value((1,))))
    return value(it) == (2,)


@looped(("now", "other", "probability"), [
    (100, 95, 0.65), (100, 85, 0.75), (100, 0, 0.75), (INFINITE, 5, 0.75), (1, 0, 0.75),
])  # fmt: skip
def test_an_improvement_is_the_likelier_the_more_it_saves(now: float, other: float, probability: float) -> None:
    assert moves(now, other, probability - 0.01)
    assert not moves(now, other, probability + 0.01)


@looped(("now", "other", "probability"), [(100, 100, 0.8), (100, 110, 0.7), (100, 150, 0.4), (100, 200, 0.4)])
def test_exploration_is_the_likelier_the_less_it_costs(now: float, other: float, probability: float) -> None:
    assert moves(now, other, probability - 0.01, period="1")
    assert not moves(now, other, probability + 0.01, period="1")


@looped(("now", "other"), [(100, 201), (0, 1), (0, 0), (5, INFINITE)])
def test_what_costs_more_than_twice_as_much_is_not_explored(now: float, other: float) -> None:
    assert not moves(now, other, 0.0, period="1")


def test_it_explores_every_so_many_cycles() -> None:
    it = robot(100, 100, *[0.0] * 9, period="3")
    values = []
    for _ in range(9):
        replies(it, ("RB", Value((1,))))
        values.append(value(it))
    assert values == [(1,), (1,), (2,), (2,), (2,), (1,), (1,), (1,), (2,)]


def test_who_has_no_other_value_stays() -> None:
    relation = Relation("T", 2, Semantics.SOFT, ((1, 1),), (3,))
    team = team_of({"A": (1,), "B": (1,)}, [Constraint("C", relation, ("A", "B"), ("A", "B"))])
    it = robot_of(DSASDP, team, "RA")
    started(it)
    assert replies(it, ("RB", Value((1,)))) == [("RB", Value((1,)))]
