"""The page "Fly" of the application, for tests of it: teams that have decided, and the page in a browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from robochoc.app.jobs.job import end_all
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import Run, State
from robochoc.app.runs.runs import Runs
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import Store
from tests.support.browser_pages import WatchedPage, connected, watched_page
from tests.support.limits import wait_until

READY = ".stage[data-ready=true]"
LINE = ".stage-line input"
FLIGHT = "document.querySelector('.stage-views iframe').contentWindow.Playback.player"
TALK = "document.querySelector('.stage-views figure:last-child iframe').contentWindow.Sniffer.page"
QUIET = ("GL Driver Message", "Blocked autofocusing")
"""Chromium's own remarks, on photographs and on frames."""


class DecidedTeam:
    """A team in the store, as `Runs` wants it."""

    def __init__(self, teams: Store, sketch: Sketch) -> None:
        self.sketch = sketch
        self.id = teams.add(sketch)
        self.folder = teams.path(self.id)


def decided(teams: Store, sketch: Sketch) -> tuple[DecidedTeam, Run]:
    """Return a team that has decided."""
    team = DecidedTeam(teams, sketch)
    run = Runs(team).start(RunOptions(protocol="syncbb"))
    wait_until(lambda: run.state is not State.RUNNING, lambda: run.message)
    end_all()
    assert run.state is State.ENDED, run.message
    return team, run


@contextmanager
def fly_opened(browser: Any, url: str, width: int = 1280, **media: str) -> Iterator[WatchedPage]:  # noqa: ANN401 - Playwright's
    """Open a page; in the end it has not complained of anything."""
    with watched_page(browser, {"width": width, "height": 800}, **media) as tab:
        if url.startswith("file:"):
            tab.page.goto(url)
        else:
            connected(tab.page, url)
        yield tab
        assert [one for one in tab.complaints if not any(quiet in one for quiet in QUIET)] == []
