"""The page "What if" for an imported team: robots fail, and the others decide again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from html import escape

from nicegui import ui

from robochoc.app.flights.answer_check import claim_words
from robochoc.app.imported.facts import ImportedFacts
from robochoc.app.pages.imported.answer import MOST_ROWS
from robochoc.app.pages.imported.model import style
from robochoc.app.pages.shell import on_leave
from robochoc.app.projects import Project
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run, RunState
from robochoc.app.runs.runs import runs_of
from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.sketch import Value
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import RemoveAgent

PURPOSE = "whatif"
_TWICE = 2
_SOLVED = frozenset({Verdict.SOLUTION, Verdict.OPTIMAL})


def build_imported_whatif(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(style())
    with ui.element("div"):
        with ui.element("h1"):
            ui.label(say("whatif.title"))
        ui.label(say("imported.whatif-intro")).classes("soft")
    _Page(project, project.facts)


class _Page:
    """The page in one browser tab."""

    def __init__(self, project: Project, facts: ImportedFacts) -> None:
        self._project, self._facts, self._runs = project, facts, runs_of(project)
        self._run: Run | None = None
        self._end_following: Callable[[], None] | None = None
        with ui.element("section").classes("panel imported-part"):
            self._who = ui.select([*facts.last], multiple=True, with_input=True, label=say("imported.who-fails"))
            self._who.props("dense outlined use-chips").classes("imported-who")
            with ui.element("div").classes("imported-row"):
                self._go = ui.button(say("imported.again"), on_click=self._press, color=None)
                self._go.props("no-caps unelevated").classes("imported-go")
                self._says = ui.label().props("role=status")
            self._wrong = ui.label().classes("error").props("role=alert")
        self._box = ui.element("section").classes("imported-part").props("aria-live=polite")
        on_leave(self._runs.on_start(self._follow_latest))
        on_leave(self._end)
        self._follow_latest()

    def _press(self) -> None:
        if self._run is not None and self._run.state == RunState.RUNNING:
            self._run.stop()
            return
        chosen = self._who.value if isinstance(self._who.value, list) else []
        failing = [name for name in self._facts.last if name in chosen]
        files = self._project.files
        wrong = "imported.nobody-fails" if not failing else "whatif.nobody-left"
        if files is None or not 0 < len(failing) < len(self._facts.last):
            self._wrong.set_text(say(wrong))
            return
        self._wrong.set_text("")
        then = tuple(RemoveAgent(name) for name in failing)
        self._runs.start(RunOptions(), files=replace(files, then=then), purpose=PURPOSE)

    def _end(self) -> None:
        if self._end_following:
            self._end_following()

    def _follow_latest(self) -> None:
        self._end()
        self._run = self._runs.latest_for(PURPOSE)
        self._end_following = self._run.on_change(self._show) if self._run else None
        self._shown: object = None
        self._show()

    def _show(self) -> None:
        run = self._run
        running = run is not None and run.state == RunState.RUNNING
        self._go.set_text(say("whatif.stop" if running else "imported.again"))
        told = say("whatif.running-messages", messages=f"{run.live.messages:,}") if running and run else ""
        self._says.set_text(told)
        if self._shown == (run, run and run.state):
            return
        self._shown = run, run and run.state
        self._box.clear()
        if run is None or running:
            return
        with self._box, ui.element("div").classes("panel imported-part"):
            if run.result and len(run.result.epochs) >= _TWICE:
                self._show_change(run, run.result)
            elif run.state == RunState.STOPPED:
                ui.label(say("whatif.stopped"))
            else:
                reason = (run.result.reason or "") if run.result else ""
                ui.label(say("whatif.failed", message=run.message or say("whatif.unknown", reason=reason))).classes(
                    "error"
                )

    def _show_change(self, run: Run, result: RunResult) -> None:
        before, after = result.epochs[-_TWICE:]
        was, now = result.values_of(before), result.values_of(after)
        with ui.element("h2"):
            ui.label(claim_words(run, _headline(self._facts, result)))
        gone = [name for name in before.robots if name not in after.robots]
        ui.label(say("imported.failed", names=listed(gone)))
        counts = {"before": f"{_messages(before):,}", "after": f"{_messages(after):,}"}
        ui.label(say("imported.messages", protocol=result.protocol, **counts)).classes("soft")
        if before.cost is not None and after.cost is not None and self._facts.costs:
            key = "imported.worths" if self._facts.maximised else "whatif.costs"
            ui.label(say(key, before=cost_shown(before.cost), after=cost_shown(after.cost)))
        ui.html(changes_html(self._facts, was, now), sanitize=False).classes("imported-table")
        if self._facts.flies:
            ui.link(say("whatif.fly"), f"/team/{self._project.id}/fly?run={run.id}")


def moved(facts: ImportedFacts, was: Mapping[str, Value], now: Mapping[str, Value]) -> list[str]:
    """Return the robots whose decisions before and after an event differ."""
    return [
        robot.name
        for robot in facts.robots
        if any(one.variable in was and one.variable in now for one in robot.decides)
        and any(was.get(one.variable) != now.get(one.variable) for one in robot.decides)
    ]


def changes_html(facts: ImportedFacts, was: Mapping[str, Value], now: Mapping[str, Value]) -> str:
    """Return each robot's decisions before and after an event as a table. Names are escaped."""
    others = frozenset(moved(facts, was, now))
    heads = say("imported.decision"), say("whatif.before"), say("whatif.after")
    names = [say("decide.robot"), *heads]
    rows = []
    for robot in facts.robots:
        for one in robot.decides:
            if one.variable in was or one.variable in now:
                cells = (one.variable, *(str(values.get(one.variable, "")) for values in (was, now)))
                told = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
                kind = ' class="moved"' if robot.name in others else ""
                rows.append(f'<tr{kind}><th scope="row">{escape(robot.name)}</th>{told}</tr>')
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in names)
    more = len(rows) - MOST_ROWS
    rest = f"<p>{escape(say('imported.more', count=f'{more:,}'))}</p>" if more > 0 else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows[:MOST_ROWS])}</tbody></table>{rest}"


def _headline(facts: ImportedFacts, result: RunResult) -> str:
    before, after = result.epochs[-_TWICE:]
    if after.verdict not in _SOLVED:
        return say("whatif.unsolved" if after.verdict == Verdict.NO_SOLUTION else "whatif.unknown", reason="")
    if before.verdict not in _SOLVED:
        return say("whatif.unsolved-before")
    others = moved(facts, result.values_of(before), result.values_of(after))
    if not others:
        return say("whatif.changes-none")
    key = "whatif.changes-one" if len(others) == 1 else "whatif.changes"
    return say(key, changed=len(others), count=len(after.robots), names=listed(others))


def _messages(epoch: EpochOutcome) -> int:
    return sum(epoch.metrics.messages.values())
