"""The answer of an imported team: tables and epochs, or the panel for a team without a solution."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from html import escape

from nicegui import ui

from robochoc.app.conflicts.search import PATIENCE_S, Conflict, ConflictSearch, TeamOfFiles, found_by
from robochoc.app.imported.facts import ImportedFacts
from robochoc.app.pages.imported.model import style
from robochoc.app.pages.shell import on_leave
from robochoc.app.projects import Project
from robochoc.app.runs.result import RunResult
from robochoc.app.sketch.sketch import Value
from robochoc.app.texts import say

_MOST_CONSTRAINTS = 60


def show_imported_below(
    project: Project, facts: ImportedFacts, result: RunResult, decide: Callable[..., None]
) -> ImportedNoSolutionPanel | None:
    """Fill the current container. If there is no solution, return the panel for that case.

    Args:
        project: The team.
        facts: The facts about the team.
        result: The result of the team's run.
        decide: Starts a new run; with `withdraw`, robots may withdraw.
    """
    ui.add_css(style())
    if result.epochs:
        with ui.element("section").classes("panel"):
            with ui.element("h2"):
                ui.label(say("imported.epochs"))
            ui.html(epochs_html(facts, result), sanitize=False).classes("imported-table")
    if result.verdict == "no-solution":
        return ImportedNoSolutionPanel(project, facts, result, decide)
    return None


class ImportedNoSolutionPanel:
    """The options if a team has no solution, with reasons for unavailable ones. `decide`: starts a new run."""

    def __init__(self, project: Project, facts: ImportedFacts, result: RunResult, decide: Callable[..., None]) -> None:
        self._project = project
        self._events = max(0, len(result.epochs) - 1)
        self._search: ConflictSearch | None = None
        with ui.element("section").classes("panel doors"):
            with ui.element("h2"):
                ui.label(say("decide.doors"))
            if result.reason:
                ui.label(say("imported.reason", why=result.reason))
            if facts.events:
                ui.label(say("imported.no-aside-events")).classes("soft")
            with ui.element("div").classes("two"):
                if not facts.events:
                    _choice_card("decide.door-aside", "decide.door-aside-help", partial(decide, withdraw=True))
                _choice_card("imported.door-conflict", "imported.door-conflict-help", self._search_conflict)
            self._found = ui.element("div").classes("found").props("aria-live=polite")
            ui.link(say("imported.to-files"), f"/team/{project.id}/model")
        on_leave(self.end)

    def end(self) -> None:
        """End the search for conflicts."""
        if self._search:
            self._search.end()

    async def _search_conflict(self) -> None:
        folder = self._project.import_folder
        if self._search or folder is None:  # a search is already running
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
            self._set_text(f"{say('imported.conflict-late')} {found_by(conflict)}".strip())
        elif not conflict.rules:
            self._set_text(say("decide.conflict-none" if conflict.rules is None else "decide.conflict-empty"))
        else:
            self._set_text(say("imported.conflict", count=len(conflict.rules)))
            with self._found:
                with ui.element("ul").classes("imported-notes"):
                    for words in conflict.words[:_MOST_CONSTRAINTS]:
                        with ui.element("li"):
                            ui.label(words)
                    if (more := len(conflict.words) - _MOST_CONSTRAINTS) > 0:
                        with ui.element("li"):
                            ui.label(say("imported.more", count=f"{more:,}"))
                ui.label(found_by(conflict)).classes("soft")


def _choice_card(title: str, hint: str, does: Callable[[], object]) -> None:
    with ui.element("button").classes("card door").props("type=button").on("click", does):
        with ui.element("h3"):
            ui.label(say(title))
        ui.label(say(hint)).classes("soft")


MOST_ROWS = 300
"""The maximum number of rows in a table."""
MOST_EPOCHS = 40
_MOST_AT_ONE = 3
"""The maximum number of values shown at a robot in the picture."""
_LONGEST = 160


def values_in_short(facts: ImportedFacts, values: Mapping[str, Value]) -> dict[str, str]:
    """Return each robot's decisions in short form, by robot name."""
    said: dict[str, str] = {}
    for robot in facts.robots:
        own = [str(values[one.variable]) for one in robot.decides if one.variable in values]
        if own:
            said[robot.name] = " · ".join(own[:_MOST_AT_ONE]) + (" …" if len(own) > _MOST_AT_ONE else "")
    return said


def robots_of(facts: ImportedFacts, result: RunResult) -> int:
    """Return the number of robots in the last epoch."""
    return len(result.epochs[-1].robots) if result.epochs else len(facts.there)


def table_html(facts: ImportedFacts, result: RunResult) -> str:
    """Return each robot's decisions as a table. Names from files are escaped."""
    return _table(facts, result.values, frozenset(result.withdrawn))


def epochs_html(facts: ImportedFacts, result: RunResult) -> str:
    """Return a list of epochs with their events and verdicts. Names are escaped."""
    parts = []
    for number, epoch in enumerate(result.epochs[:MOST_EPOCHS]):
        known = say(f"imported.verdict.{epoch.verdict}")
        happened = facts.events[number - 1] if 0 < number <= len(facts.events) else ""
        title = happened or say("imported.epoch", opened=_cut(epoch.opened_by))
        messages = sum(epoch.metrics.messages.values())
        took = say("imported.epoch-took", robots=len(epoch.robots), messages=messages)
        table = _table(facts, result.values_of(epoch), frozenset()) if epoch.assignment else ""
        head = f"<b>{escape(title)}</b> {escape(known)} <span class='soft'>{escape(took)}</span>"
        parts.append(f"<li><details><summary>{head}</summary>{table}</details></li>" if table else f"<li>{head}</li>")
    if (more := len(result.epochs) - MOST_EPOCHS) > 0:
        parts.append(f"<li>{escape(say('imported.more', count=more))}</li>")
    return f"<ol>{''.join(parts)}</ol>"


def _table(facts: ImportedFacts, values: Mapping[str, Value], aside: frozenset[str]) -> str:
    rows = []
    for robot in facts.robots:
        if robot.name in aside:
            rows.append((robot.name, "", say("decide.steps-aside")))
        rows += [
            (robot.name, one.variable, str(values[one.variable])) for one in robot.decides if one.variable in values
        ]
    heads = say("decide.robot"), say("imported.decision"), say("imported.value")
    more = len(rows) - MOST_ROWS
    rest = f"<p class='soft'>{escape(say('imported.more', count=f'{more:,}'))}</p>" if more > 0 else ""
    return rows_html(say("decide.table"), heads, rows[:MOST_ROWS]) + rest


def rows_html(caption: str, heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in which each row begins with a heading. All texts are escaped."""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    body = "".join(_row(*row) for row in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _row(name: str, *cells: str) -> str:
    told = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
    return f'<tr><th scope="row">{escape(name)}</th>{told}</tr>'


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
