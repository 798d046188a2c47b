"""The team's decision after a change: changed values, message counts, and a panel if there is no solution."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from nicegui import ui

from robochoc.app.flights.answer_check import claim_words
from robochoc.app.pages.decide.answer import effort, headline, table_html
from robochoc.app.pages.decide.no_solution_panel import NoSolutionPanel
from robochoc.app.pages.shell import on_leave
from robochoc.app.pages.whatif.outcome import ComparisonRow, DecisionComparison, Fate
from robochoc.app.pages.whatif.story import SavedChange, Story
from robochoc.app.projects import Project
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import Run, RunState
from robochoc.app.runs.runs import runs_of
from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown


class WhatIfAnswer:
    """The part of the page below the map, which is rebuilt after each change in the outcome."""

    def __init__(self, project: Project, story: Story) -> None:
        self._project, self._story = project, story
        self._shown: object = None
        self._box = ui.element("div").classes("whatif-result")

    def update(self) -> None:
        """Show the progress during a run."""
        if self._story.running:
            self.follow()

    def follow(self) -> None:
        """Show the current state."""
        story = self._story
        state = story.running, story.outcome, story.message, story.run, story.run and story.run.state
        messages = _messages(story) if story.running else 0
        if (state, messages) == self._shown:
            return
        self._shown = state, messages
        self._box.clear()
        with self._box:
            if story.running:
                self._running(messages)
            elif story.outcome is not None and story.saved_change is not None and story.run is not None:
                self._show_outcome(story.outcome, story.saved_change, story.run)
            elif why := _failure(story):
                with ui.element("div").classes("panel"):
                    ui.label(why).classes("error")

    def _running(self, messages: int) -> None:
        with ui.element("div").classes("panel whatif-row"):
            ui.spinner(size="1.4rem").props("aria-hidden=true")
            text = say("whatif.running-messages", messages=f"{messages:,}") if messages else say("whatif.running")
            ui.label(text).classes("grow")
            ui.button(say("whatif.stop"), icon="stop", on_click=self._story.stop).props("no-caps outline dense")

    def _show_outcome(self, found: DecisionComparison, saved_change: SavedChange, run: Run) -> None:
        with ui.element("div").classes("panel whatif-part"):
            with ui.element("h2"):
                ui.label(claim_words(run, _headline(found)))
            ui.label(" ".join(saved_change.happened)).classes("soft")
            if saved_change.anew:
                ui.label(say("whatif.all-anew", why=saved_change.anew)).classes("soft")
            if costs := _costs(found):
                ui.label(costs)
            with ui.element("div").classes("whatif-columns"):
                _table(found)
                self._figures(found, saved_change)
            with ui.element("div").classes("whatif-row"):
                if self._can_keep(saved_change):
                    keep = ui.button(say("whatif.keep"), icon="check", on_click=self._keep_changes, color=None)
                    keep.props("no-caps unelevated").classes("go")
                if saved_change.after.flies:
                    ui.link(say("whatif.fly"), f"/team/{self._project.id}/fly?run={run.id}").classes("flight")
                    ui.label(say("whatif.flight-hint")).classes("soft small grow")
                else:
                    ui.label(say("whatif.no-flight")).classes("soft small grow")
            if found.after.verdict == "no-solution":
                WaysOut(self._project, self._story, saved_change.after)
            if command := run.command:
                with ui.element("details").classes("whatif-command"):
                    with ui.element("summary"):
                        ui.label(say("whatif.command"))
                    with ui.element("pre"):
                        ui.label(command)

    def _can_keep(self, saved_change: SavedChange) -> bool:
        return bool(self._story.changes) and self._story.after() == saved_change.after

    def _keep_changes(self) -> None:
        self._story.apply_changes()
        ui.notify(say("whatif.kept"))

    def _figures(self, found: DecisionComparison, saved_change: SavedChange) -> None:
        second = self._story.second_run.result if self._story.second_run else None
        anew = None if second is None or saved_change.anew else second.messages
        again = found.after.messages
        with ui.element("div").classes("whatif-figures"):
            with ui.element("h3"):
                ui.label(say("whatif.messages"))
            most = max(again, anew or 0, 1)
            if anew is None:
                _bar(say("whatif.deciding-anew"), again, most)
                if not saved_change.anew:
                    ui.label(say("whatif.compared-anew", again=f"{again:,}", protocol=found.protocol)).classes("soft")
                return
            _bar(say("whatif.going-on"), again, most)
            _bar(say("whatif.deciding-anew"), anew, most)
            key = "zero" if not again else "less" if again < anew else "more"
            text = say(f"whatif.compared-{key}", again=f"{again:,}", anew=f"{anew:,}", protocol=found.protocol)
            ui.label(text).classes("soft")


def _headline(found: DecisionComparison) -> str:
    if found.after.verdict == "no-solution":
        return say("whatif.unsolved")
    if not found.after.solved:
        return say("whatif.unknown")
    if not found.before.solved:
        return say("whatif.unsolved-before")
    if not found.moved:
        return say("whatif.changes-none")
    key = "whatif.changes-one" if len(found.moved) == 1 else "whatif.changes"
    return say(key, changed=len(found.moved), count=found.stayed, names=listed(found.moved))


def _costs(found: DecisionComparison) -> str:
    before, after = found.before, found.after
    if not (before.solved and after.solved) or not (before.cost or after.cost):
        return ""
    return say("whatif.costs", before=cost_shown(before.cost or 0), after=cost_shown(after.cost or 0))


def _table(found: DecisionComparison) -> None:
    several = len({row.decision for row in found.rows}) > 1
    heads = ["who", *(["what"] if several else []), "before", "after"]
    with ui.element("div").classes("whatif-table"), ui.element("table"):
        with ui.element("thead"), ui.element("tr"):
            for head in heads:
                with ui.element("th").props("scope=col"):
                    ui.label(say(f"whatif.{head}"))
            with ui.element("th").props(f'scope=col aria-label="{say("whatif.moved")}"'):
                pass
        with ui.element("tbody"):
            for row in found.rows:
                _line(row, several=several)


def _line(row: ComparisonRow, *, several: bool) -> None:
    with ui.element("tr").classes(f"fate-{row.fate}"):
        with ui.element("th").props("scope=row"):
            ui.label(row.robot)
        cells = [*([row.decision] if several else []), row.before or say("whatif.nobody")]
        cells += [row.after or say("whatif.nobody"), "" if row.fate == Fate.OPEN else say(f"whatif.{row.fate}")]
        for text in cells:
            with ui.element("td"):
                ui.label(text)


def _bar(name: str, count: int, most: int) -> None:
    with ui.element("div").classes("whatif-bar"):
        ui.label(name)
        with ui.element("div").classes("track").props("aria-hidden=true"):
            ui.element("div").classes("fill").style(f"width: {100 * count / most:.1f}%")
        ui.label(f"{count:,}").classes("number")


def _messages(story: Story) -> int:
    return sum(run.live.messages for run in (story.run, story.second_run) if run)


def _failure(story: Story) -> str:
    """Return the reason why there is no outcome; empty if no run was started."""
    if story.message:
        return say("whatif.failed", message=story.message)
    for run in (story.run, story.second_run):
        if run is not None and run.state == RunState.FAILED:
            return say("whatif.failed", message=run.message)
        if run is not None and run.state == RunState.STOPPED:
            return say("whatif.stopped")
    return say("whatif.unknown") if story.run else ""


ASIDE = "whatif-aside"
"""The purpose of a run after a change in which robots may withdraw."""


class WaysOut:
    """The panel for a team without a solution, as on the page "Decide", but for the changed team."""

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
        else:  # a rule was changed, so decide again before and after the changes
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
            if run.state == RunState.RUNNING:
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
    except (OSError, ValueError):  # the run's files are damaged
        return False
