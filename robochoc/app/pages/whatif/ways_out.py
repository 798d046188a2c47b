"""The panel for a changed team without a solution: withdraw robots, or find conflicting rules."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from nicegui import ui

from robochoc.app.pages.decide.answer import effort, headline, table_html
from robochoc.app.pages.decide.no_solution_panel import NoSolutionPanel
from robochoc.app.pages.shell import on_leave
from robochoc.app.pages.whatif.story import Story
from robochoc.app.projects import Project
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import Run, State
from robochoc.app.runs.runs import runs_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say

ASIDE = "whatif-aside"
"""The purpose of a run with withdrawals after a change."""


class WaysOut:
    """The panel of the page "Decide" for a team without a solution, here for the changed team."""

    def __init__(self, project: Project, story: Story, after: Sketch) -> None:
        self._project, self._story, self._after = project, story, after
        self._end_following: Callable[[], None] | None = None
        self._deciding: asyncio.Task[None] | None = None
        NoSolutionPanel(project, after, self._decide)
        self._box = ui.element("div").classes("whatif-aside").props("aria-live=polite")
        on_leave(self._end)
        last = runs_of(project).latest_for(ASIDE)
        if last is not None and _is_of(last, after):
            self._follow(last)

    def _decide(self, *, withdraw: bool = False) -> None:
        if withdraw:
            self._follow(runs_of(self._project).start(RunOptions(withdraw=True), sketch=self._after, purpose=ASIDE))
        else:  # a rule was changed: decide again before and after the changes
            self._deciding = asyncio.get_running_loop().create_task(self._story.decide())

    def _end(self) -> None:
        if self._end_following:
            self._end_following()

    def _follow(self, run: Run) -> None:
        self._end()
        self._end_following = run.on_change(lambda: self._show(run))
        self._show(run)

    def _show(self, run: Run) -> None:
        if self._box.is_deleted:
            self._end()
            return
        self._box.clear()
        with self._box, ui.element("section").classes("panel answer"):
            if run.state == State.RUNNING:
                ui.label(say("whatif.running"))
                return
            with ui.element("h2").classes("headline"):
                ui.label(headline(run))
            if run.result is not None:
                ui.label(effort(run)).classes("soft")
                if run.result.assignment:
                    ui.html(table_html(self._after, run.result), sanitize=False).classes("values")


def _is_of(run: Run, sketch: Sketch) -> bool:
    try:
        return run.sketch == sketch
    except (OSError, ValueError):  # its files are damaged
        return False
