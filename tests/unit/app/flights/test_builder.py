"""What is made of a run, by commands in processes of their own."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
import pytest

from robochoc.app.flights.builder import FLIGHT, BuildStage, FlightBuilder, builder_of, flies
from robochoc.app.flights.flight_result import flight_result_of
from robochoc.app.jobs.job import jobs_alive
from robochoc.app.log import error_text
from robochoc.app.runs.options import JOURNAL, RESULT, RunOptions
from robochoc.app.runs.run import Record, Run
from robochoc.app.sketch.sketch import DecisionKind, Sketch
from tests.support.kept_runs import cube, kept_run
from tests.support.limits import HANG_S, wait_until


def test_only_who_decides_heights_or_places_flies(tmp_path: Path) -> None:
    sketches = cube(), cube(kind=DecisionKind.SLOT), Sketch()
    drawn, slots, foreign = (Run(tmp_path, Record(RunOptions()), sketch) for sketch in sketches)
    assert flies(drawn)
    assert not flies(slots)
    assert flies(foreign)  # a state of earlier does not say
    foreign.record.flies = False
    assert not flies(foreign)


def test_all_pages_share_what_is_made_of_a_run(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    making = builder_of(run)
    assert builder_of(run) is making


async def _made(making: FlightBuilder) -> list[BuildStage]:
    """Make all of it; return the stages, as they were told."""
    stages: list[BuildStage] = []
    over = asyncio.Event()

    def told() -> None:
        stages.append(making.stage)
        if making.stage is BuildStage.DONE:
            over.set()

    making.request(told)
    await over.wait()
    return stages


@pytest.mark.slow
def test_a_run_without_its_teams_files_is_flown_and_a_damaged_journal_told(tmp_path: Path) -> None:
    making = FlightBuilder(kept_run(tmp_path, cube()))
    assert asyncio.run(_made(making)) == [BuildStage.FLIGHT, BuildStage.CONVERSATION, BuildStage.DONE]
    assert making.flight, making.troubles
    assert making.flight.read_bytes().startswith(b"<!doctype html>")
    assert making.run.artefact("flight.json")
    assert JOURNAL in making.troubles[BuildStage.CONVERSATION]
    assert not making.has_conversation
    # What is there is not made again.
    assert asyncio.run(_made(FlightBuilder(making.run)))[0] is BuildStage.CONVERSATION


def test_the_work_ends_when_nobody_wants_it_any_more(tmp_path: Path) -> None:
    making = FlightBuilder(kept_run(tmp_path, cube()))
    one, other = making.request(lambda: None), making.request(lambda: None)
    (job,) = jobs_alive()
    wait_until(lambda: job.pid is not None, "it has no process")
    one()
    assert making.stage == "flight"
    other()
    assert making.stage == "waiting"
    assert job.join(HANG_S)
    assert (making.stage, making.flight, making.troubles) == (BuildStage.WAITING, None, {})


def test_what_failed_can_be_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    making = FlightBuilder(kept_run(tmp_path, cube()))
    monkeypatch.setattr(FlightBuilder, "_build_flight", _failing)
    asyncio.run(_made(making))
    assert making.troubles[BuildStage.FLIGHT] == error_text(ValueError())
    assert not making.has_flight
    making.request(lambda: None)
    assert making.stage is BuildStage.DONE  # not by itself
    monkeypatch.undo()
    monkeypatch.setattr(
        FlightBuilder, "_build_flight", lambda self, _: self.run.folder.joinpath(FLIGHT).write_bytes(b"scene")
    )
    monkeypatch.setattr(FlightBuilder, "_build_conversation", lambda *_: None)
    making.retry()
    wait_until(lambda: making.stage is BuildStage.DONE, "it is not made")
    assert making.flight
    assert making.troubles == {}
    assert making.has_flight


def _failing(*_: object) -> None:
    raise ValueError("unforeseen")


@pytest.mark.slow
def test_a_flight_that_is_refused_tells_why_and_is_made_again(tmp_path: Path) -> None:
    sketch = cube(2)
    sketch = msgspec.structs.replace(
        sketch, decisions=(msgspec.structs.replace(sketch.decisions[0], values=(1, 900_000)),)
    )
    making = FlightBuilder(kept_run(tmp_path, sketch, assignment={"Drone1.level": 1, "Drone2.level": 900_000}))
    asyncio.run(_made(making))
    assert making.flight, making.troubles
    flown = flight_result_of(making.run)
    assert flown is not None
    assert "m: use a larger scale" in flown.refused
    assert "cannot be flown" not in flown.refused
    low = kept_run(tmp_path / "low", cube(2))
    (making.run.folder / RESULT).write_bytes((low.folder / RESULT).read_bytes())
    making.retry()
    wait_until(lambda: making.stage is BuildStage.DONE, "it is not made")
    flown = flight_result_of(making.run)
    assert flown is not None
    assert (flown.refused, flown.as_planned) == ("", True)
