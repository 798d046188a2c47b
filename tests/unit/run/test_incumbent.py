"""What is known of a search that minimises: the objective, the best that robots tell of, bounds, and trees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.cli.reports.pseudo_tree import tree_text
from robochoc.communication.search_result import SearchResult
from robochoc.journal.events import AnyEvent, Decided, Heard, Improved
from robochoc.journal.journal import improvements
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Metrics, Outcome, PseudoTreeNode, Verdict
from robochoc.model.problem import INFINITE, Constraint, Predicate, Relation, Semantics, Team
from robochoc.protocols.findings import Findings, Incumbent, Trail
from robochoc.run.incumbent import best_known, costs_by_cycle, lower_bound, pseudo_tree
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.objective import Objective, withdrawal_cost
from tests.support.cost_problems import cost_of, random_complex_cost_team, random_cost_team, with_costs
from tests.support.outcomes import outcome_of
from tests.support.problems import team_of

PRICES = Relation("price", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1)), (4, 3, INFINITE), 7)
PAIR = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", PRICES, ("A", "B"), ("A", "B"))]))
"""(1, 1) costs 4, (1, 2) costs 3, (2, 1) is forbidden, (2, 2) costs 7."""


def own(team: Team, assignment: Mapping[str, int]) -> dict[str, dict[str, int]]:
    """`assignment`, by robot."""
    return {robot.name: {v.name: assignment[v.name] for v in robot.variables} for robot in team.robots}


def result(assignments: Mapping[str, dict[str, int]], findings: Mapping[str, Findings] | None = None) -> SearchResult:
    return SearchResult(Verdict.UNKNOWN, None, dict(assignments), Metrics(), findings=dict(findings or {}))


# The objective


def test_the_objective_follows_changes_and_equals_the_sum_of_all_prices() -> None:
    for seed in range(40):
        chance = Random(seed)
        team = random_complex_cost_team(chance) if seed % 3 == 0 else random_cost_team(chance)
        objective = Objective(team)
        assignment = {name: chance.choice(list(variable.domain)) for name, variable in team.variables.items()}
        objective.change(own(team, assignment))
        for _ in range(20):
            robot = chance.choice(team.robots)
            values = {variable.name: chance.choice(list(variable.domain)) for variable in robot.variables}
            assignment.update(values)
            objective.change({robot.name: values})
            assert objective.cost == cost_of(assignment, list(team.constraints()))


def test_without_leave_to_step_aside_a_robot_without_values_has_no_cost() -> None:
    objective = Objective(PAIR)
    objective.change({"RA": {"A": 1}})
    assert objective.cost == INFINITE
    objective.change({"RB": {"B": 2}})
    assert objective.cost == 3
    objective.change({"RB": {}})
    assert objective.cost == INFINITE


def test_who_steps_aside_costs_its_weight_and_frees_its_constraints() -> None:
    team = replace(PAIR, robots=(PAIR.robots[0], replace(PAIR.robots[1], weight=3)))
    objective = Objective(team, 10)
    assert objective.cost == 40
    objective.change({"RA": {"A": 2}, "RB": {"B": 1}})
    assert objective.cost == INFINITE
    objective.change({"RB": {}})
    assert objective.cost == 30
    objective.change({"RA": {}, "RB": {"B": 2}})
    assert objective.cost == 10


def test_stepping_aside_costs_more_than_all_that_can_be_paid_without() -> None:
    predicate = Predicate("p", ("X",), parse("eq(X, 2)", ("X",), Type.BOOLEAN))
    soft = Constraint("S", predicate, ("A",), ("A",), cost=5)
    hard = Constraint("H", predicate, ("B",), ("B",))
    team = with_costs(team_of({"A": (1,), "B": (1,)}, [soft, hard, *PAIR.constraints()]))
    assert withdrawal_cost(team) == 1 + 5 + 7
    assert withdrawal_cost(team_of({"B": (1,)}, [hard])) == 1


# The best that robots tell of


def test_the_values_at_the_end_are_an_answer() -> None:
    found = best_known(CompiledTeam(PAIR), result(own(PAIR, {"A": 2, "B": 2})))
    assert found == ({"A": 2, "B": 2}, 7)


def test_what_breaks_something_hard_is_none() -> None:
    assert best_known(CompiledTeam(PAIR), result(own(PAIR, {"A": 2, "B": 1}))) is None
    assert best_known(CompiledTeam(PAIR), result({"RA": {"A": 1}, "RB": {}})) is None


def test_the_cheapest_that_a_robot_has_heard_of_is_better_than_the_values_at_the_end() -> None:
    findings = {
        "RA": Findings(best=Incumbent(4, {"RA": (1,), "RB": (1,)})),
        "RB": Findings(best=Incumbent(3, {"RA": (1,), "RB": (2,)})),
    }
    found = best_known(CompiledTeam(PAIR), result(own(PAIR, {"A": 2, "B": 2}), findings))
    assert found == ({"A": 1, "B": 2}, 3)


def test_who_steps_aside_in_the_best_has_no_values_in_it() -> None:
    findings = {"RA": Findings(best=Incumbent(11, {"RA": (2,), "RB": (None,)}))}
    found = best_known(CompiledTeam(PAIR), result({"RA": {}, "RB": {}}, findings), 11)
    assert found == ({"A": 2}, 11)


def test_who_has_nothing_to_show_and_no_value_steps_aside_in_the_best() -> None:
    """Its value is (), as that of one without neighbours that stays is."""
    forbids = Relation("R", 1, Semantics.CONFLICTS, ((1,),))
    team = team_of({"A": (1,), "B": (1,)}, [Constraint("C", forbids, ("A",), ("A",))])
    findings = {"RB": Findings(best=Incumbent(1, {"RA": (), "RB": ()}))}
    assert best_known(CompiledTeam(team), result({"RA": {}, "RB": {}}, findings), 1) == ({"B": 1}, 1)


def test_the_best_cycle_is_found_and_unfinished_cycles_do_not_count() -> None:
    findings = {
        "RA": Findings(trail=Trail([(0, 1), (1, 0), (3, 1)], 4)),  # 2, then 1 in cycles 1 and 2, then 2
        "RB": Findings(trail=Trail([(0, 1), (1, 0), (2, 1)], 2)),  # 2, 1, 2
    }
    trails = {name: found.trail for name, found in findings.items() if found.trail}
    assert list(costs_by_cycle(CompiledTeam(PAIR), trails)) == [7, 4, 3]
    found = best_known(CompiledTeam(PAIR), result(own(PAIR, {"A": 2, "B": 2}), findings))
    assert found == ({"A": 1, "B": 2}, 3)


def test_a_robot_without_a_trail_leaves_the_cycles_out() -> None:
    findings = {"RA": Findings(trail=Trail([(0, 0)], 1)), "RB": Findings()}
    assert best_known(CompiledTeam(PAIR), result(own(PAIR, {"A": 2, "B": 2}), findings)) == ({"A": 2, "B": 2}, 7)


def test_bounds_of_several_roots_are_summed_and_an_infinite_one_is_none() -> None:
    assert lower_bound({"A": Findings(bound=3), "B": Findings(), "C": Findings(bound=4.0)}) == 7
    assert lower_bound({"A": Findings()}) is None
    assert lower_bound({"A": Findings(bound=INFINITE)}) is None


# Improvements in journals


def test_improvements_stand_right_behind_the_decision_that_made_them() -> None:
    decisions = [("RA", {"A": 2}), ("RB", {"B": 2}), ("RA", {"A": 1}), ("RB", {"B": 1}), ("RB", {"B": 2})]
    events: list[AnyEvent] = [
        Decided(t=number, robot=name, assignment=values, clock=0) for number, (name, values) in enumerate(decisions)
    ]
    told = [event for event in improvements(events, Objective(PAIR)) if isinstance(event, Improved)]
    assert [(event.t, event.cost, event.assignment) for event in told] == [
        (1, 7, {"A": 2, "B": 2}),
        (2, 3, {"A": 1, "B": 2}),
    ]


def test_what_a_robot_has_heard_of_is_an_improvement_too() -> None:
    events: list[AnyEvent] = [
        Heard(t=1, robot="RB", cost=4, values={"RA": (1,), "RB": (1,)}),
        Heard(t=2, robot="RA", cost=4, values={"RA": (1,), "RB": (1,)}),
        Heard(t=3, robot="RB", cost=3, values={"RA": (1,), "RB": (2,)}),
        Heard(t=4, robot="RB", cost=2, values={"RA": (1,), "RB": (None,)}),
    ]
    told = [event for event in improvements(events, Objective(PAIR, 2)) if isinstance(event, Improved)]
    assert [(event.t, event.cost) for event in told] == [(1, 4), (3, 3), (4, 2)]
    assert [event.assignment for event in told] == [{"A": 1, "B": 1}, {"A": 1, "B": 2}, {"A": 1}]


# In words


def aside(verdict: Verdict, *weights: int, **known: Any) -> str:  # noqa: ANN401 - fields of an outcome
    """What is told when RB of a hard team has stepped aside."""
    hard = team_of({"A": (1,), "B": (1,)}, [])
    robots = tuple(replace(robot, weight=weight) for robot, weight in zip(hard.robots, weights, strict=True))
    outcome = outcome_of({"A": 1}, verdict, protocol="sfb", cost=0, withdrawn=("RB",), verified=True, **known)
    return outcome_report(replace(hard, robots=robots), outcome)


def test_weights_are_told_where_they_are_not_all_one() -> None:
    assert "1 of 2 fly (proven maximum); no solution for the whole team" in aside(Verdict.OPTIMAL, 1, 1)
    assert "weight" not in aside(Verdict.OPTIMAL, 1, 1)
    told = aside(Verdict.OPTIMAL, 5, 2)
    assert "1 of 2 fly (proven maximum by weight); no solution" in told
    assert "1 withdrawn (weight 2):" in told


def test_a_limit_is_told_with_the_best_so_far_and_the_bound() -> None:
    told = aside(Verdict.UNKNOWN, 1, 3, reason="the time was over", bound=2)
    assert "unknown: the time was over; in the best answer so far 1 withdraws (weight 3) (lower bound 2)" in told
    outcome = outcome_of({"A": 1, "B": 2}, Verdict.UNKNOWN, protocol="afb", cost=2**60 + 1, reason="so", bound=3)
    assert f"so; the best so far costs {2**60 + 1:,}, and lower bound 3" in outcome_report(PAIR, outcome)


def test_who_placed_the_robots_is_told_where_that_was_not_asked_for() -> None:
    assert "\n  sfb, simulator, seed 0: " in aside(Verdict.OPTIMAL, 1, 1)
    assert "\n  sfb, then first-fit, simulator, seed 0: " in aside(Verdict.SOLUTION, 1, 1, placed_by="first-fit")


def test_what_is_not_proven_says_so() -> None:
    outcome = outcome_of({"A": 1, "B": 2}, protocol="dsa", cost=3, verified=True)
    assert "solution for all 2 robots, cost 3 (not proven to be the minimum), checked" in outcome_report(PAIR, outcome)


def test_where_the_sum_is_maximised_the_best_is_a_maximum_and_bounds_are_upper_ones() -> None:
    robots = tuple(replace(robot, costs=CostUnits(maximize=True)) for robot in PAIR.robots)
    team = replace(PAIR, robots=robots)
    found = outcome_of({"A": 1, "B": 2}, protocol="dsa", cost=3, verified=True, bound=9)
    assert "cost 3 (not proven to be the maximum; upper bound 9), checked" in outcome_report(team, found)
    timely = replace(found, deadline=2)
    assert "by the deadline of 2 s (not proven to be the maximum; upper bound 9), checked" in outcome_report(
        team, timely
    )
    stopped = replace(found, verdict=Verdict.UNKNOWN, reason="so")
    assert "so; the best so far is worth 3, and upper bound 9" in outcome_report(team, stopped)


# Trees, explained


def test_a_tree_is_drawn_with_its_depth_and_width() -> None:
    places = {
        "R1": PseudoTreeNode(None),
        "R2": PseudoTreeNode("R1"),
        "R3": PseudoTreeNode("R2", ("R1",)),
        "R10": PseudoTreeNode("R2"),
        "S": PseudoTreeNode(None),
    }
    assert pseudo_tree({name: Findings(place=place) for name, place in places.items()} | {"T": Findings()}) == places
    outcome = Outcome(Verdict.OPTIMAL, team="team", protocol="dpop", runtime="simulator", seed=0, tree=places)
    assert tree_text(outcome).splitlines() == [
        "  pseudo-tree, built by the robots: depth 2, induced width 2, 2 roots ([neighbours further up])",
        "    R1",
        "    └── R2",
        "        ├── R3 [R1]",
        "        └── R10",
        "    S",
    ]


@pytest.mark.parametrize("places", [{}, {"R2": PseudoTreeNode("R1"), "R3": PseudoTreeNode("R2")}])
def test_a_tree_that_is_not_finished_is_not_drawn(places: dict[str, PseudoTreeNode]) -> None:
    outcome = Outcome(Verdict.UNKNOWN, team="team", protocol="dpop", runtime="simulator", seed=0, tree=places)
    assert tree_text(outcome) == "  the run ended before the robots had built a pseudo-tree"


def test_a_protocol_without_a_tree_says_where_to_look() -> None:
    def text(name: str, verdict: Verdict) -> str:
        return tree_text(Outcome(verdict, team="team", protocol=name, runtime="simulator", seed=0))

    for verdict in (Verdict.SOLUTION, Verdict.UNKNOWN):
        assert text("abt", verdict).startswith(
            "  abt builds no pseudo-tree; to see its messages and decisions, add --sniff"
        )
    assert text("central", Verdict.UNKNOWN) == "  the central solver builds no pseudo-tree"
