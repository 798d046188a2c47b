"""The part below the answer of an imported team: the epochs, and the panel for a team without a solution."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nicegui import ui

from robochoc.app.conflicts.found import PATIENCE_S, Conflict, ConflictSearch, Finder, TeamOfFiles
from robochoc.app.foreign.facts import Facts
from robochoc.app.pages.foreign.answer import epochs_html
from robochoc.app.pages.foreign.model import style
from robochoc.app.pages.shell import on_leave
from robochoc.app.projects import Project
from robochoc.app.runs.result import RunResult
from robochoc.app.texts import say

_MOST_CONSTRAINTS = 60


def show_foreign_below(
    project: Project, facts: Facts, result: RunResult, decide: Callable[..., None]
) -> ForeignNoSolutionPanel | None:
    """Fill the current container; return the panel for a team without a solution, if there is none.

    Args:
        project: The team.
        facts: The facts about the team.
        result: The result of its run.
        decide: Starts a new run; with `withdraw`, robots may withdraw.
    """
    ui.add_css(style())
    if result.epochs:
        with ui.element("section").classes("panel"):
            with ui.element("h2"):
                ui.label(say("foreign.epochs"))
            ui.html(epochs_html(facts, result), sanitize=False).classes("foreign-table")
    if result.verdict == "no-solution":
        return ForeignNoSolutionPanel(project, facts, result, decide)
    return None


class ForeignNoSolutionPanel:
    """The ways out for a team without a solution, with the reason if one is not available. `decide`: as above."""

    def __init__(self, project: Project, facts: Facts, result: RunResult, decide: Callable[..., None]) -> None:
        self._project = project
        self._events = max(0, len(result.epochs) - 1)
        self._search: ConflictSearch | None = None
        with ui.element("section").classes("panel doors"):
            with ui.element("h2"):
                ui.label(say("decide.doors"))
            if result.reason:
                ui.label(say("foreign.reason", why=result.reason))
            if facts.events:
                ui.label(say("foreign.no-aside-events")).classes("soft")
            with ui.element("div").classes("two"):
                if not facts.events:
                    _door("decide.door-aside", "decide.door-aside-help", partial(decide, withdraw=True))
                _door("foreign.door-conflict", "foreign.door-conflict-help", self._search_conflict)
            self._found = ui.element("div").classes("found").props("aria-live=polite")
            ui.link(say("foreign.to-files"), f"/team/{project.id}/model")
        on_leave(self.end)

    def end(self) -> None:
        """End the search."""
        if self._search:
            self._search.end()

    async def _search_conflict(self) -> None:
        folder = self._project.foreign
        if self._search or folder is None:  # a search is running
            return
        self._search = search = ConflictSearch(TeamOfFiles(folder, self._events), folder=self._project.folder)
        self._set_text(say("decide.searching", seconds=int(PATIENCE_S)))
        try:
            conflict = await search.found()
        finally:
            self._search = None
            search.end()
        if conflict is not None and not self._found.is_deleted:
            self._show(conflict)

    def _set_text(self, text: str) -> None:
        self._found.clear()
        with self._found:
            ui.label(text)

    def _show(self, conflict: Conflict) -> None:
        if conflict.why:
            self._set_text(say("decide.conflict-failed", why=conflict.why))
        elif conflict.late:
            self._set_text(say("foreign.conflict-late"))
        elif not conflict.rules:
            self._set_text(say("decide.conflict-none" if conflict.rules is None else "decide.conflict-empty"))
        else:
            self._set_text(say("foreign.conflict", count=len(conflict.rules)))
            with self._found:
                with ui.element("ul").classes("foreign-notes"):
                    for words in conflict.words[:_MOST_CONSTRAINTS]:
                        with ui.element("li"):
                            ui.label(words)
                    if (more := len(conflict.words) - _MOST_CONSTRAINTS) > 0:
                        with ui.element("li"):
                            ui.label(say("foreign.more", count=f"{more:,}"))
                ui.label(say("decide.by-cpmpy" if conflict.finder == Finder.CPMPY else "decide.by-own")).classes("soft")


def _door(title: str, hint: str, does: Callable[[], object]) -> None:
    with ui.element("button").classes("card door").props("type=button").on("click", does):
        with ui.element("h3"):
            ui.label(say(title))
        ui.label(say(hint)).classes("soft")
