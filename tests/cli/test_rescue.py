"""The example of the documentation whose problem changes: the same verdicts, whoever solves it, and what is shown."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from robochoc.formats import read_robot, read_team
from robochoc.model.change import team_after_events
from robochoc.model.outcome import Metrics
from robochoc.model.problem import AddAgent, AddConstraint, RemoveAgent, RemoveConstraint, RemoveValue
from tests.support.journal_entries import entries_of
from tests.support.program import ROOT, robochoc_within

RESCUE = ROOT / "docs" / "examples" / "rescue"
VERDICTS = ["solution", "solution", "solution", "no-solution", "solution"]
EPOCH_KEYS = {
    "verdict", "opened_by", "robots", "assignment", "cost", "withdrawn", "verified", "messages_by_type",
    *(one.name for one in fields(Metrics)),
}  # fmt: skip
EPOCH_EXTRAS = {"solved_by", "witness", "dropped_constraints"}
"""Keys of an epoch that are missing where they are empty."""
METRICS = ("messages", "bytes", "ncccs", "checks")


def test_the_story() -> None:
    team = read_team(RESCUE)
    kinds = [[type(change) for change in event.changes] for event in team.scenario]
    assert kinds == [[RemoveAgent], [AddAgent], [RemoveValue, RemoveValue], [RemoveConstraint, AddConstraint]]
    assert "East" in team
    assert "Spare" not in team
    last = team_after_events(team, len(team.scenario))
    assert last.order == ("Lead", "North", "South", "West", "Medic", "Relay", "Spare")
    assert last["Spare"] == read_robot(RESCUE / "late" / "Spare.xml")


def test_validate_finds_nothing_wrong() -> None:
    done = robochoc_within("validate", RESCUE, RESCUE / "late" / "Spare.xml")
    assert done.returncode == 0
    assert done.stdout.count(": ok") == 2


def result_of(*words: str) -> dict[str, Any]:
    """Return the result of the example, once it is checked."""
    done = robochoc_within("solve", RESCUE, "--json", "--protocol", *words)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    epochs = result["epochs"]
    assert [epoch["verdict"] for epoch in epochs] == VERDICTS
    assert (result["verdict"], result["verified"]) == ("solution", True)
    assert result["assignment"] == epochs[-1]["assignment"]
    for epoch in epochs:
        assert epoch.keys() - EPOCH_EXTRAS == EPOCH_KEYS
        solved = epoch["verdict"] == "solution"
        assert epoch["verified"] is solved
        assert epoch["assignment"].keys() == {name.lower() for name in epoch["robots"] if solved}
    for key in METRICS:
        assert result["metrics"][key] == sum(epoch[key] for epoch in epochs)
    return result


@pytest.mark.parametrize("protocol", ["dynabt", "central"])
def test_processes_and_the_central_solver_come_to_the_verdicts(protocol: str) -> None:
    result_of(protocol)


def test_going_on_costs_less_than_to_begin_anew() -> None:
    results = [result_of(protocol, "--runtime", "simulator") for protocol in ("dynabt", "abt")]
    went_on, anew = ([epoch["messages"] for epoch in result["epochs"]] for result in results)
    assert went_on[0] == anew[0]
    assert sum(went_on) < sum(anew)


def test_the_report_of_the_tutorial_is_what_is_printed() -> None:
    done = robochoc_within("solve", RESCUE, "--protocol", "dynabt", "--runtime", "simulator")
    *told, cost = done.stdout.splitlines()
    tutorial = (ROOT / "docs" / "tutorials" / "change.md").read_text()
    assert "\n".join(told) in tutorial
    assert cost.rpartition(",")[0] in tutorial, "all but the time"


def test_the_scene_shows_the_robots_of_the_last_epoch(tmp_path: Path) -> None:
    html, journal, result = (tmp_path / name for name in ("page.html", "run.jsonl", "result.json"))
    words = ("solve", RESCUE, "--protocol", "dynabt", "--runtime", "simulator", "--json")
    result.write_text(robochoc_within(*words, "--html", html, "--journal", journal).stdout)
    for saved in (journal, result):
        page = tmp_path / f"{saved.name}.html"
        assert robochoc_within("animate", saved, "--team", RESCUE, "-o", page).returncode == 0
        assert page.read_bytes() == html.read_bytes()
    began = [event for event in entries_of(journal) if event["event"] == "Began"]
    assert [event.get("epoch", 0) for event in began] == [0, 1, 2, 3, 4]


def test_changes_have_no_place_in_xcsp3(tmp_path: Path) -> None:
    done = robochoc_within("export", RESCUE, "--format", "xcsp3", folder=tmp_path)
    assert done.returncode == 2
    assert "cannot contain changes" in done.stderr
