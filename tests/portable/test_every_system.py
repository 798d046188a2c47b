"""Models in the simulator, arrays and the central solver, teams in files, and journals."""

from __future__ import annotations

from pathlib import Path

import pytest

import robochoc


def charging(robots: int = 3) -> robochoc.Model:
    """Return a model in which one robot has its wish, the first slot, and each other one a later slot."""
    model = robochoc.Model("charging")
    slots = [model.robot(f"drone{number}").variable("slot", range(robots)) for number in range(robots)]
    model.add(robochoc.all_different(slots))
    model.minimize(sum(slot * 2 for slot in slots))
    return model


@pytest.mark.parametrize("protocol", ["auto", "dpop", "sfb", "adopt", "central"])
def test_a_model_is_solved_to_the_optimum(protocol: str) -> None:
    outcome = charging().solve(protocol, cache=False)
    assert outcome.verdict == robochoc.Verdict.OPTIMAL
    assert outcome.cost == 6


def test_too_few_values_are_proved_to_have_no_solution() -> None:
    model = robochoc.Model("three in two")
    model.add(robochoc.all_different([model.robot(name).variable("x", range(2)) for name in "abc"]))
    assert model.solve("abt").verdict == robochoc.Verdict.NO_SOLUTION


def test_arrays_find_what_the_simulator_finds() -> None:
    def solved(runtime: str) -> robochoc.Outcome:
        return charging(4).solve("mgm", runtime=runtime, seed=3, settings={"cycles": 20})

    arrays, simulator = solved("arrays"), solved("simulator")
    assert arrays.assignment == simulator.assignment
    assert arrays.metrics.messages == simulator.metrics.messages


def test_a_team_in_files_and_its_journal(tmp_path: Path) -> None:
    charging().save(tmp_path / "team")
    outcome = robochoc.load(tmp_path / "team").solve("dpop", runtime="simulator", journal=tmp_path / "run.journal")
    assert outcome.cost == 6
    assert len([*robochoc.journal.rows(tmp_path / "run.journal")]) > 3
