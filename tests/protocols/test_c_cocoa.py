"""One test per rule of C-CoCoA (after Sarker, Choudhury, Khan 2021), named for it."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from robochoc.model.costs import normalized
from robochoc.model.problem import Team, Value
from robochoc.model.team_edits import on_intervals
from robochoc.protocols.local_search.c_cocoa import CCoCoA
from robochoc.protocols.local_search.cocoa import CostsAt, Inquiry, SetValue
from robochoc.protocols.settings import read_settings
from tests.support.agents import replies, robot_of, sent
from tests.support.real_teams import real_constraint, real_team


def chosen(team: Team, costs: Sequence[tuple[int, int]], responses: Sequence[int], **settings: str) -> int:
    """Return the value of RA, in steps, after an answer of RB for its points, of which the last are 50 and 100."""
    it = robot_of(CCoCoA, on_intervals(normalized(team)), "RA")
    it.settings = read_settings(CCoCoA, settings)  # type: ignore[assignment, misc]
    it.start()
    points: list[Value] = [(0,), (50,), (100,)]
    assert sent(it) == [("RB", Inquiry(points[-len(costs) :], {}))]
    ((_, said),) = replies(it, ("RB", CostsAt([*costs], [(one,) for one in responses])))
    assert isinstance(said, SetValue)
    assert it.assignment == {"x": said.value[0]}
    return it.assignment["x"]


def test_answers_contain_the_least_costs_and_the_points_that_have_them() -> None:
    team = real_team(real_constraint("p", "abs(X - Y + 1)", ("x", "xb")))
    it = robot_of(CCoCoA, on_intervals(normalized(team)), "RB")
    it.start()
    answer = replies(it, ("RA", Inquiry([(0,), (37,), (100,)], {})))
    assert [one for _, one in answer if isinstance(one, CostsAt)] == [
        CostsAt([(0, 1_000_000), (0, 300_000), (0, 1_000_000)], [(0,), (50,), (100,)])
    ]


def test_the_gradient_is_followed_from_the_best_point() -> None:
    team = real_team(real_constraint("s", "sqr(X - 3.7)", ("x",)), real_constraint("p", "abs(X - Y)", ("x", "xb")))
    assert chosen(team, [(0, 0)] * 3, [0, 50, 100]) == pytest.approx(37 + 5, abs=1)  # 2 (x - 3.7) = 1, towards y = 5
    assert chosen(team, [(0, 0)] * 3, [0, 50, 100], moves="0") == 50


def test_moves_never_break_a_hard_constraint() -> None:
    hard = real_constraint("h", "ge(X, 4.5)", ("x",), hard=True)
    team = real_team(real_constraint("s", "sqr(X)", ("x",)), hard, real_constraint("p", "abs(X - Y)", ("x", "xb")))
    assert chosen(team, [(0, 0)] * 2, [50, 100]) == 45
