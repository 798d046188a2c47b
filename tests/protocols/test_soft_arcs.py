"""Soft arc consistency in one robot: what moves, what stays, and that no assignment gets another cost."""

from __future__ import annotations

from random import Random

from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.bnb_adopt_fdac import SoftArc, move_costs
from robochoc.protocols.optimization.bounding_messages import Number
from tests.support.cases import looped

HARD = 0.2
"""How often a cost is infinite."""


def drawn(chance: Random) -> Number:
    """A cost, now and then none or infinite."""
    if chance.random() < HARD:
        return INFINITE
    return chance.randint(0, 9)


def problem(chance: Random) -> tuple[list[Number], list[SoftArc], list[list[list[Number]]]]:
    """Unary costs, arcs, and copies of their tables."""
    size = chance.randint(1, 4)
    tables = [
        [[drawn(chance) for _ in range(size)] for _ in range(chance.randint(1, 4))] for _ in range(chance.randint(0, 3))
    ]
    own = [drawn(chance) for _ in range(size)]
    return own, [SoftArc([[*row] for row in table], size) for table in tables], tables


def test_projection_moves_what_a_row_costs_at_least() -> None:
    own: list[Number] = [1, 1]
    arc = SoftArc([[3, 5], [0, 2]], 2)
    assert arc.project_up(own, extending=False)
    assert (arc.up, arc.costs, own) == ([3, 0], [[0, 2], [0, 2]], [1, 1])
    assert not arc.project_up(own, extending=False)


def test_projection_the_other_way_moves_what_a_column_costs_at_least() -> None:
    own: list[Number] = [1, 1]
    arc = SoftArc([[0, 2], [0, 5]], 2)
    assert arc.project_down(own)
    assert (arc.costs, own, arc.put_in) == ([[0, 0], [0, 3]], [1, 3], [0, -2])


def test_unary_costs_are_put_in_as_far_as_more_can_be_projected_then() -> None:
    own: list[Number] = [4, 1]
    arc = SoftArc([[0, 2], [1, 9]], 2)
    arc.project_up(own, extending=True)
    assert arc.up == [3, 5]  # the least of 4 + 0 and 1 + 2, and of 4 + 1 and 1 + 9
    assert (own, arc.put_in) == ([0, 0], [4, 1])
    assert arc.costs == [[1, 0], [0, 5]]


def test_unary_costs_that_are_not_needed_stay() -> None:
    own: list[Number] = [9, 0]
    arc = SoftArc([[0, 2]], 2)
    arc.project_up(own, extending=True)
    assert (arc.up, own, arc.put_in, arc.costs) == ([2], [7, 0], [2, 0], [[0, 0]])


def test_a_value_above_with_which_nothing_goes_costs_infinity_and_counts_no_more() -> None:
    own: list[Number] = [0, 0]
    arc = SoftArc([[INFINITE, INFINITE], [2, 3]], 2)
    move_costs(own, [arc], extending=False)
    assert arc.up == [INFINITE, 2]
    assert (own, arc.put_in) == ([0, 1], [0, -1])


def test_an_own_value_that_goes_with_nothing_above_costs_infinity_and_counts_no_more() -> None:
    own: list[Number] = [0, 1]
    arcs = [SoftArc([[0, 4], [0, 6]], 2), SoftArc([[INFINITE, 1]], 2)]
    move_costs(own, arcs, extending=True)
    assert own == [INFINITE, 0]
    assert [arc.up for arc in arcs] == [[4, 6], [2]]


@looped("extending", [False, True])
def test_the_parent_gets_what_every_value_costs_at_least(extending: bool) -> None:  # noqa: FBT001
    own: list[Number] = [5, 3]
    arcs = [SoftArc([[0, 0], [0, 0]], 2), SoftArc([[0, 0]], 2)]
    move_costs(own, arcs, extending=extending)
    assert [arc.up for arc in arcs] == [[3, 3], [0]]
    assert own == [2, 0]


@looped("extending", [False, True])
def test_every_assignment_keeps_its_cost_and_nothing_becomes_negative(extending: bool) -> None:  # noqa: FBT001
    chance = Random(f"arcs {extending}")
    for _ in range(400):
        own, arcs, tables = problem(chance)
        given = [*own]
        move_costs(own, arcs, extending=extending)
        for index, charged in enumerate(given):
            rows = [chance.randrange(len(arc.up)) for arc in arcs]
            above = sum(arc.up[row] for arc, row in zip(arcs, rows, strict=True))
            before = charged + sum(table[row][index] for table, row in zip(tables, rows, strict=True))
            if INFINITE in (own[index], above):
                assert before == INFINITE
                continue
            here = sum(arc.costs[row][index] for arc, row in zip(arcs, rows, strict=True))
            assert above + own[index] + here == before
            put_in = sum(arc.put_in[index] for arc in arcs)
            assert own[index] == charged - put_in
            assert min(own[index], here) >= 0


@looped("extending", [False, True])
def test_nothing_more_can_be_moved_afterwards(extending: bool) -> None:  # noqa: FBT001
    chance = Random(f"fixpoint {extending}")
    for _ in range(200):
        own, arcs, _ = problem(chance)
        move_costs(own, arcs, extending=extending)
        assert not any(arc.project_up(own, extending=extending) for arc in arcs[: len(arcs) if extending else 0])
        live = [index for index, cost in enumerate(own) if cost < INFINITE]
        for arc in arcs:
            rows = [row for row, up in zip(arc.costs, arc.up, strict=True) if up < INFINITE]
            unary = own if extending else [0] * len(own)
            assert all(min(unary[index] + row[index] for index in live) == 0 for row in rows)
            assert all(min(row[index] for row in rows) == 0 for index in live)
