"""`robochoc solve --improve`: better decisions are published, shown and told while the team searches on."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.solve_ros import HANGAR, MET, OPENINGS, PATROL, published, ran

ANYTIME = ("--runtime", "simulator", "--protocol", "dsa", "--set", "cycles=100000", "--seed", 1)


@pytest.mark.usefixtures("a_second_a_look")
def test_better_decisions_are_published_while_the_team_searches_on(tmp_path: Path) -> None:
    """Each drone gets a waypoint when it is to go elsewhere, and only then; all products show the run."""
    place, journal, page = (tmp_path / name for name in ("run.mcap", "run.journal", "run.html"))
    products = ("--ros", f"mcap:{place}", "--journal", journal, "--html", page)
    told = ran("solve", PATROL, *ANYTIME, "--deadline", 4, "--improve", 300, "--json", *products)
    last = json.loads(told.stdout)
    costs = [one["cost"] for one in last["improvements"]]
    assert told.exit_code == 0
    assert costs == sorted(set(costs), reverse=True)
    assert len(costs) > 1
    assert (last["cost"], last["verdict"], last["verified"], last["deadline"]) == (costs[-1], "solution", True, 4)
    sent = [published(place, f"/{name}/waypoint") for name in ("lead", "north", "south", "west")]
    assert all(one[1] != other[1] for each in sent for one, other in pairwise(each))
    assert sum(map(len, sent)) < 4 * len(costs)
    replayed = ran("replay", journal)
    assert replayed.exit_code == 0, replayed.output
    assert page.read_text().count("a better decision") == len(costs) - 1


@pytest.mark.usefixtures("a_second_a_look")
def test_without_a_sink_better_answers_are_told(tmp_path: Path) -> None:
    told = ran("solve", PATROL, *ANYTIME, "--deadline", 4, "--improve", 300)
    lines = [line for line in told.stderr.splitlines() if "a solution of cost" in line]
    assert len(lines) > 1
    assert lines[0].startswith("patrol: a solution of cost ")
    assert "by the deadline of 4 s, improved after" in told.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("a_second_a_look")
def test_each_event_of_a_flight_has_a_deadline_and_improvements(tmp_path: Path) -> None:
    """Decisions while the team searches on are published; the last one of each epoch is flown.

    From the last decision, few drones move, and the mission would be over before the last event.
    """
    place = tmp_path / "run.mcap"
    words = ("--deadline", 2, "--improve", 200, "--cold", "--ros", f"mcap:{place}", *MET)
    told = ran("solve", HANGAR, *ANYTIME, *words, "--json")
    last = json.loads(told.stdout)
    assert [epoch["opened_by"] for epoch in last["epochs"]] == OPENINGS
    assert [epoch["verdict"] for epoch in last["epochs"]] == ["solution"] * 3
    assert told.exit_code == 0
