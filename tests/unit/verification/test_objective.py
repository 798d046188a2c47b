"""The objective of a team that changes: constraints without variables, and what neighbours see."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.verification.objective import Objective, withdrawal_cost
from tests.support.examples import examples
from tests.support.problems import team_of

PRICE = Relation("P", 2, Semantics.SOFT, ((1, 1),), (4,), 1)


def pair() -> Team:
    """Two robots; a constraint between them, and one of the first over constants only."""
    constants = Constraint("K", PRICE, (1, 1), (1, 1))
    both = Constraint("C", PRICE, ("A", "B"), ("A", "B"))
    team = team_of(dict.fromkeys("AB", (1, 2)), [both])
    first, second = team.robots
    return replace(team, robots=(replace(first, private=(constants,)), second))


def test_a_constraint_without_variables_costs_what_it_costs_from_the_start() -> None:
    objective = Objective(pair(), 10)
    assert objective.cost == 4 + 20
    objective.change({"RA": {"A": 1}, "RB": {"B": 2}})
    assert objective.cost == 4 + 1


def test_what_was_decided_is_taken_back() -> None:
    objective = Objective(pair(), 10)
    before = objective.cost
    objective.change({"RA": {"A": 1}, "RB": {"B": 2}})
    objective.clear()
    assert objective.cost == before
    objective.change({"RB": {"B": 2}})
    assert objective.cost == 4 + 10


def test_values_of_another_length_than_the_interface_are_not_of_these_robots() -> None:
    objective = Objective(pair(), 10)
    assert objective.shown({"RA": (1,), "RB": (None,)}) == {"RA": {"A": 1}, "RB": {}}
    assert objective.shown({"RA": (1, 2)}) is None
    assert objective.shown({"RZ": (1,)}) is None


def test_no_robot_withdraws_to_save_costs() -> None:
    assert withdrawal_cost(pair()) == 1 + 4 + 4


@given(st.lists(st.tuples(st.sampled_from(["RA", "RB", "RC"]), st.integers(0, 3)), max_size=20), st.booleans())
@examples(60)
def test_a_cost_that_is_kept_is_the_cost_that_is_summed(changes: list[tuple[str, int]], aside: bool) -> None:  # noqa: FBT001 - hypothesis draws it
    hard = replace(PRICE, name="H", tuples=((1, 2), (3, 3)), costs=(INFINITE, INFINITE), default_cost=2)
    scopes = (("A", "B", PRICE), ("B", "C", hard), ("A", "C", hard))
    team = team_of(
        dict.fromkeys("ABC", (1, 2, 3)),
        [Constraint(one + other, by, (one, other), (one, other)) for one, other, by in scopes],
    )
    kept, now = Objective(team, 10 if aside else None), dict[str, dict[str, int]]()
    for robot, value in changes:
        now[robot] = {robot[1]: value} if value else {}
        kept.change({robot: now[robot]})
        fresh = Objective(team, 10 if aside else None)
        fresh.change(now)
        values = {name: one for own in now.values() for name, one in own.items()}
        paid = [c.price(values) for c in team.constraints() if values.keys() >= set(c.variables)]
        absent = 3 - len(values)
        wanted = INFINITE if absent and not aside else sum(paid) + 10 * absent
        assert kept.cost == fresh.cost == wanted
