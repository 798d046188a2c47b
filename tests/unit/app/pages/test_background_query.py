"""A fault in what a page looks up, or in how a team decides again, is told: nothing looks for ever."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

pytest.importorskip("nicegui")

from robochoc.app.jobs.job import end_all
from robochoc.app.pages.background_query import ErrorText, run_query
from robochoc.app.pages.whatif import story as stories
from robochoc.app.pages.whatif.story import Story
from robochoc.app.projects import Projects
from robochoc.app.runs.run import RunState
from robochoc.app.sketch.team_changes import RobotFails
from robochoc.app.store import TeamStore
from robochoc.modelling.errors import ModelError
from tests.support.limits import HANG_S
from tests.support.slot_sketches import slots


@pytest.fixture(autouse=True)
def pool(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The threads in which pages look, which end with the test."""
    with ThreadPoolExecutor() as own:
        monkeypatch.setattr("nicegui.run.thread_pool", own)
        yield


FAULT = "That did not work. The team is unchanged."


def _fails(*_: object) -> None:
    raise ZeroDivisionError("unforeseen")


def test_a_mistake_is_told_in_its_words_and_a_fault_in_ours(caplog: pytest.LogCaptureFixture) -> None:
    def mistaken(text: str) -> None:
        raise ModelError(text)

    told = asyncio.run(run_query(mistaken, "no values"))
    assert isinstance(told, ErrorText)
    assert told.endswith("no values")
    assert asyncio.run(run_query(len, "abc")) == 3
    assert not caplog.records
    assert asyncio.run(run_query(_fails)) == ErrorText(FAULT)
    assert "ZeroDivisionError" in caplog.text


def _story(folder: Path, then: Callable[[Story], Awaitable[None]]) -> Story:
    async def play() -> Story:
        story = Story(Projects(TeamStore(folder)).add(slots(3, 3)))
        story.add(RobotFails("Drone1"))
        over = asyncio.Event()
        story.on_change(lambda: None if story.running else over.set())
        await then(story)
        while story.running:
            over.clear()
            await asyncio.wait_for(over.wait(), HANG_S)
        return story

    try:
        return asyncio.run(play())
    finally:
        end_all(HANG_S)


@pytest.mark.parametrize("broken", ["_checked", "compare"])
def test_a_team_that_decides_again_comes_to_an_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    monkeypatch.setattr(stories, broken, _fails)
    if broken == "compare":
        monkeypatch.setattr(Story, "_comparison", _fails)
    story = _story(tmp_path, lambda story: story.decide())
    assert not story.running
    assert story.message == FAULT
    assert story.outcome is None


def test_the_second_run_that_cannot_begin_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Story, "_needs_second_run", _fails)
    story = _story(tmp_path, lambda story: story.decide())
    assert story.run
    assert story.run.state is RunState.ENDED
    assert story.message == FAULT
