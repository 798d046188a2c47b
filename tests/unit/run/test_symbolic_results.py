"""Symbols from the team to the result: codes travel, names are told."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.formats.result import read_result, result_json
from robochoc.journal.team_events import TeamReader, TeamWriter
from robochoc.model.assembly import assemble
from robochoc.model.costs import normalized
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.problem import (
    AddValue,
    Constraint,
    CostUnits,
    Domain,
    Function,
    ProblemKind,
    Relation,
    RemoveValue,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS

TABLE = ("red", "green", "dark-blue", "pink")


def team(kind: ProblemKind = ProblemKind.DISCSP) -> Team:
    """Three robots; green goes with 2 only. With costs, red is worth something."""
    colours = Domain("D", (range(3),), TABLE)
    number = Variable("N", Domain("I", (range(1, 3),)))
    own = {
        "RA": [Variable("A", colours)],
        "RB": [number],
        "RC": [Variable("C", replace(colours, ranges=(range(1, 2),)))],
    }
    goes = Relation("r", 2, Semantics.SUPPORTS, ((0, 1), (1, 2), (2, 1)))
    differ = Relation("d", 2, Semantics.CONFLICTS, tuple((code, code) for code in range(4)))
    worth = Function("w", ("X",), Apply("if", (Apply("eq", (Name("X"), Constant(0))), Constant(3), Constant(0))))
    constraints = [
        Constraint("R", goes, ("A", "N"), ("A", "N")),
        Constraint("D", differ, ("A", "C"), ("A", "C")),
        *([Constraint("W", worth, ("A",), ("A",))] if kind is ProblemKind.DISWCSP else []),
    ]
    costs = CostUnits(maximize=True, places=1) if kind is ProblemKind.DISWCSP else CostUnits()
    return assemble("colours", own, constraints, kind=kind, costs=costs)


@pytest.mark.parametrize("runtime", [Runtime.SIMULATOR, Runtime.PROCESSES])
def test_a_result_names_symbols(runtime: Runtime) -> None:
    outcome = solve(team(ProblemKind.DISWCSP), Options(protocol="dpop", runtime=runtime))
    assert outcome.assignment == {"A": 0, "N": 1, "C": 1}
    told = json.loads(result_json(outcome))
    assert told["assignment"] == {"A": "red", "N": 1, "C": "green"}
    assert told["cost"] == 3
    back = read_result(result_json(outcome))
    assert back.labelled(back.assignment) == told["assignment"]
    assert result_json(back) == result_json(outcome)
    assert "RA: A = red" in outcome_report(team(ProblemKind.DISWCSP), outcome)


def test_epochs_name_symbols() -> None:
    events = (ScenarioEvent((RemoveValue("A", 0), RemoveValue("A", 2), AddValue("A", 3))),)
    changing = replace(team(), scenario=events)
    outcome = solve(changing, Options(protocol="central"))
    first, second = json.loads(result_json(outcome))["epochs"]
    assert first["assignment"]["A"] in {"red", "dark-blue"}
    assert second["opened_by"] == "A without red, A without dark-blue, A with pink"
    assert second["verdict"] == "no-solution"


@pytest.mark.parametrize("kind", ProblemKind)
def test_what_robots_are_given_comes_back(kind: ProblemKind) -> None:
    given = normalized(team(kind))
    again = TeamReader("colours").team(TeamWriter().given(given, DEFAULT_PARAMETERS))
    for robot, back in zip(given.robots, again.robots, strict=True):
        assert back.symbol_table == TABLE
        assert [one.definition for one in back.shared] == [one.definition for one in robot.shared]
        assert [one.definition for one in back.private] == [one.definition for one in robot.private]
    empty = replace(
        given, robots=(replace(given.robots[0], variables=(Variable("A", Domain("D", (), TABLE)),)), *given.robots[1:])
    )
    assert TeamReader("colours").team(TeamWriter().given(empty, DEFAULT_PARAMETERS)).variables["A"].domain == Domain(
        "D", (), TABLE
    )
