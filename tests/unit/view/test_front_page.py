"""The page on which a point of a Pareto front is chosen."""

from __future__ import annotations

import re

import pytest

from robochoc.generators.heights import heights
from robochoc.model.outcome import FrontPoint, Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.view.front_page import MOST_SHOWN, front_choice, front_page


def page_of(team: Team, outcome: Outcome) -> str:
    page = front_page(outcome, team)
    assert "<script" not in page
    return page


def test_each_point_is_a_link_to_its_costs_and_values() -> None:
    team = heights(agents=3)
    outcome = solve(team, Options(runtime=Runtime.SIMULATOR))
    page = page_of(team, outcome)
    assert page.count("<svg") == 1
    for number, point in enumerate(outcome.front, 1):
        assert f'<a href="#p{number}" class="c{number}">' in page
        section = page[page.index(f'<section class="point v{number}">') :]
        section = section[: section.index("</section>")]
        assert [int(cost) for cost in re.findall(r"<li>\w+: (\d+)</li>", section)] == [*point.objectives.values()]
        found = dict(re.findall(r"<td>(V\d)</td><td>(\d)</td>", section))
        assert found == {name: str(value) for name, value in point.assignment.items()}


@pytest.mark.parametrize(("names", "charts"), [(("a", "b"), 1), (("a", "b", "c"), 3)])
def test_there_is_a_chart_for_each_pair_of_objectives(names: tuple[str, ...], charts: int) -> None:
    team = heights(agents=1, degree=0)
    points = tuple([FrontPoint(dict.fromkeys(names, 10**30 + number), {"V1": 1}) for number in range(2)])
    outcome = Outcome(Verdict.OPTIMAL, team="<&>", protocol="mo-dpop", runtime="simulator", seed=0, front=points)
    page = page_of(team, outcome)
    assert page.count("<svg") == charts
    assert "<&>" not in page


def test_the_chosen_point_is_marked_in_a_choice() -> None:
    points = [FrontPoint({"<a>": number, "b": -number}, {}) for number in range(2 * MOST_SHOWN)]
    page = front_choice(points, 2)  # every other point is shown, and the chosen one
    assert page.count("<circle") == MOST_SHOWN + 1
    assert page.count('aria-current="true"') == 1
    assert '<tr class=chosen><th scope="row"><a href="#p2" aria-current="true">2</a></th><td>1</td>' in page
    assert "<a>" not in page


def test_long_fronts_are_thinned() -> None:
    team = heights(agents=1, degree=0)
    points = tuple([FrontPoint({"a": number, "b": -number}, {"V1": 1}) for number in range(3 * MOST_SHOWN)])
    outcome = Outcome(Verdict.OPTIMAL, team="t", protocol="mo-dpop", runtime="simulator", seed=0, front=points)
    page = page_of(team, outcome)
    assert page.count("<circle") == MOST_SHOWN
    assert f"{MOST_SHOWN} of them are shown" in page
