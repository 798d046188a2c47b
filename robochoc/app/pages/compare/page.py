"""The page "Compare": a study of two or more protocols on this team or a similar family, with its report."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.resources import files

from fastapi import Response
from fastapi.responses import FileResponse
from nicegui import app, ui

from robochoc.app.pages.background_query import ErrorText, run_query
from robochoc.app.pages.shell import on_leave
from robochoc.app.pages.widgets import bounded_integer
from robochoc.app.projects import Project, Projects
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.studies.question import MOST_RUNS, MOST_SECONDS, PossibleQuestions, StudyQuestion, possible, study_of
from robochoc.app.studies.study import ENDED, Line, StudyStage, StudyState, study_on
from robochoc.app.texts import say

_DELAY_S = 0.2
_TEAM, _FAMILY = "team", "family"
_FEWEST = 2


def build_compare(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(_style())
    with ui.element("div"):
        _heading("h1", "compare.title")
        ui.label(say("compare.intro")).classes("soft")
    if not project.import_folder and (not project.sketch.robots or not project.sketch.decisions):
        with ui.element("div").classes("panel"):
            ui.label(say("compare.empty"))
            ui.link(say("compare.empty-remedy"), f"/team/{project.id}/model")
        return
    ComparePage(project)


class ComparePage:
    """The page in one browser tab."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._study = study_on(project)
        self._worth = project.import_folder is not None and project.facts.maximised
        self._sketch: Sketch | None = None
        self._possible: PossibleQuestions | None = None
        self._boxes: dict[str, ui.checkbox] = {}
        self._text: ui.label | None = None
        self._start: ui.button | None = None
        self._shown: object = None
        self._progress_of: StudyState | None = None
        with ui.element("div").classes("compare"):
            self._form = ui.element("section").classes("panel compare-part")
            self._results = ui.element("section").classes("compare-told").props("aria-live=polite")
        self._timer = ui.timer(_DELAY_S, self._show_form)
        on_leave(project.on_change(self._timer.activate))
        on_leave(self._study.on_change(self._follow))
        with self._form:
            ui.label(say("compare.looking")).classes("soft")
        self._follow()

    async def _show_form(self) -> None:
        """Find the suitable protocols, which is slow for large teams, and then show the form."""
        self._timer.deactivate()
        sketch = self._project.sketch
        if sketch == self._sketch:
            return
        self._sketch = sketch
        found = await run_query(possible, sketch, self._project.files)
        if found is None or self._sketch is not sketch:
            return
        self._form.clear()
        self._boxes, self._text, self._start = {}, None, None
        with self._form:
            if isinstance(found, ErrorText):
                ui.label(say("compare.not-yet", why=found)).classes("error")
                ui.link(say("compare.to-model"), f"/team/{self._project.id}/model")
            else:
                self._possible = found
                self._build_question(sketch, found)

    # The form

    def _build_question(self, sketch: Sketch, found: PossibleQuestions) -> None:
        last = self._study.facts.question if self._study.facts else None
        names = [name for name, _ in found.protocols]
        chosen = [name for name in last.protocols if name in names] if last else []
        self._build_protocols(found, chosen if len(chosen) >= _FEWEST else [*found.usual])
        self._build_problems(sketch, found, of_family=bool(last and last.family and found.family))
        with ui.element("div").classes("compare-row"):
            self._runs = _number("compare.runs", last.runs if last else 10, MOST_RUNS)
            self._timeout = _number("compare.timeout", last.timeout if last else 20, MOST_SECONDS)
        self._wrong = ui.label().classes("error").props("role=alert")
        with ui.element("div").classes("compare-row"):
            self._start = (
                ui.button(say("compare.start"), on_click=self._start_study, color=None)
                .props("no-caps unelevated")
                .classes("go")
            )
        self._build_study()
        self._follow_start()

    def _build_protocols(self, found: PossibleQuestions, chosen: list[str]) -> None:
        with ui.element("fieldset"):
            with ui.element("legend"):
                ui.label(say("compare.protocols"))
            ui.label(say("compare.protocols-hint")).classes("soft small")
            with ui.element("div").classes("compare-protocols"):
                complete = "compare.costs-complete" if found.costs else "compare.complete"
                for name, is_complete in found.protocols:
                    box = ui.checkbox(name, value=name in chosen, on_change=self._show_study)
                    box.props("dense").classes("protocol")
                    with box:
                        ui.tooltip(say(complete if is_complete else "compare.incomplete"))
                    self._boxes[name] = box

    def _build_problems(self, sketch: Sketch, found: PossibleQuestions, *, of_family: bool) -> None:
        family = found.family
        hint = "ranked" if sketch.is_ranked else "partial" if found.ordered else "drawn"
        with ui.element("fieldset"):
            with ui.element("legend"):
                ui.label(say("compare.problems"))
            kinds = {_TEAM: say("compare.team"), **({_FAMILY: say("compare.family")} if family else {})}
            self._kind = ui.radio(kinds, value=_FAMILY if of_family else _TEAM, on_change=self._kind_chosen)
            self._kind.props("dense inline")
            self._hints = {
                _TEAM: say(f"compare.team-hint.{hint}"),
                _FAMILY: say(family.key, **family.named) if family else "",
            }
            self._hint = ui.label(self._hints[self._kind.value]).classes("soft small")
            if family is None:
                none = "compare.family-files" if self._project.import_folder else "compare.family-none"
                ui.label(say(none)).classes("soft small")

    def _build_study(self) -> None:
        with ui.element("details").classes("compare-study"):
            with ui.element("summary"):
                ui.label(say("compare.study"))
            ui.label(say("compare.study-hint")).classes("soft small")
            with ui.element("pre"):
                self._text = ui.label()
            copy = ui.button(say("compare.copy"), icon="content_copy", on_click=self._copy)
            copy.props("no-caps flat dense")
        self._show_study()

    def _kind_chosen(self) -> None:
        self._hint.set_text(self._hints[self._kind.value])
        self._show_study()

    def _question(self) -> StudyQuestion:
        return StudyQuestion(
            tuple(name for name, box in self._boxes.items() if box.value),
            family=self._kind.value == _FAMILY,
            runs=bounded_integer(self._runs.value, 1, MOST_RUNS, otherwise=1),
            timeout=bounded_integer(self._timeout.value, 1, MOST_SECONDS, otherwise=1),
            ordered=self._possible is not None and self._possible.ordered,
        )

    def _show_study(self) -> None:
        if self._sketch is not None and self._possible is not None and self._text is not None:
            self._text.set_text(study_of(self._sketch, self._question(), self._possible.family))

    def _copy(self) -> None:
        ui.clipboard.write(self._text.text if self._text else "")
        ui.notify(say("compare.copied"))

    def _start_study(self) -> None:
        question = self._question()
        few = len(question.protocols) < _FEWEST
        self._wrong.set_text(say("compare.few") if few else "")
        if not few and self._sketch is not None:
            self._study.start(self._sketch, question, self._project.files)

    # The results

    def _follow(self) -> None:
        """Show the progress and the results."""
        self._follow_start()
        facts = self._study.facts
        state = facts and (facts.stage, facts.done, facts.message, id(facts))
        if state == self._shown:
            return
        self._shown = state
        if facts is not None and facts is self._progress_of and facts.stage not in ENDED:
            self._advance(facts)  # updated in place, since a rebuilt button could lose a click
            return
        self._progress_of = None
        self._results.clear()
        with self._results:
            if facts is not None:
                self._show(facts)

    def _follow_start(self) -> None:
        if self._start is not None:
            self._start.set_enabled(not self._study.running)
            self._start.set_text(say("compare.again" if self._study.facts else "compare.start"))

    def _show(self, facts: StudyState) -> None:
        match facts.stage:
            case StudyStage.PREPARING | StudyStage.RUNNING | StudyStage.REPORTING:
                self._show_progress(facts)
            case StudyStage.STOPPED:
                _message(say("compare.stopped", done=facts.done, total=facts.total))
            case StudyStage.FAILED:
                _message(say("compare.failed", message=facts.message), bad=True)
            case StudyStage.DONE if not facts.lines:
                _message(say("compare.nothing"), bad=True)
            case StudyStage.DONE if self._study.report is not None:
                show_lines(facts.lines, worth=self._worth)
                self._show_report()
            case StudyStage.DONE:
                show_lines(facts.lines, worth=self._worth)
                _message(say("compare.no-pictures", message=facts.message))

    def _show_progress(self, facts: StudyState) -> None:
        with ui.element("div").classes("panel compare-part"):
            self._words = ui.label()
            self._bar = ui.linear_progress(show_value=False)
            with ui.element("div").classes("compare-row"):
                stop = ui.button(say("compare.stop"), icon="stop", on_click=self._study.stop)
                stop.props("no-caps outline dense")
        self._progress_of = facts
        self._advance(facts)

    def _advance(self, facts: StudyState) -> None:
        words = {
            StudyStage.PREPARING: say("compare.preparing"),
            StudyStage.RUNNING: say("compare.progress", done=facts.done, total=facts.total),
            StudyStage.REPORTING: say("compare.reporting"),
        }[facts.stage]
        self._words.set_text(words)
        self._bar.props["aria-label"] = words
        self._bar.set_value(facts.done / max(facts.total, 1))

    def _show_report(self) -> None:
        with ui.element("div").classes("compare-head"):
            _heading("h2", "compare.report")
            link = ui.element("a").props(f"href={REPORT} target=_blank rel=noopener")
            with link:
                ui.label(say("compare.open"))
        frame = ui.element("iframe").classes("compare-report")
        frame.props(f"src={REPORT} sandbox=allow-same-origin").props["title"] = say("compare.report")


def _message(text: str, *, bad: bool = False) -> None:
    with ui.element("div").classes("panel"):
        ui.label(text).classes("error" if bad else "")


def _number(key: str, value: int, most: int) -> ui.number:
    return ui.number(label=say(key), value=value, min=1, max=most, precision=0).props("dense outlined").classes("count")


def _heading(tag: str, key: str) -> None:
    with ui.element(tag):
        ui.label(say(key))


@cache
def _style() -> str:
    return (files(__package__) / "compare.css").read_text(encoding="utf-8")


REPORT = "study/report.html"
"""The address of the report, relative to the team's pages."""


def install_reports(projects: Projects) -> None:
    """Install the address for reports."""

    @app.get("/team/{name}/" + REPORT)
    async def report(name: str) -> Response:  # runs in the event loop, as all code that opens teams
        try:
            file = study_on(projects.open(name)).report
        except (KeyError, ValueError):
            file = None
        if file is None:
            return Response(status_code=404)
        policy = "sandbox allow-popups; frame-ancestors 'self'"
        return FileResponse(file, media_type="text/html", headers={"Content-Security-Policy": policy})


def show_lines(lines: Sequence[Line], *, worth: bool = False) -> None:
    """Show the medians of each protocol. `worth`: whether costs are utilities."""
    if not lines:
        return
    costs = any(line.cost for line in lines)
    most = max(1.0, *(line.messages for line in lines))
    heads = ["protocol", "messages", "ncccs", "bytes", *([("worth" if worth else "cost")] if costs else []), "finished"]
    with ui.element("div").classes("panel compare-lines"), ui.element("table"):
        with ui.element("caption"):
            ui.label(say("compare.medians"))
        with ui.element("thead"), ui.element("tr"):
            for head in heads:
                with ui.element("th").props("scope=col"):
                    ui.label(say(f"compare.head.{head}"))
        with ui.element("tbody"):
            for line in lines:
                _row(line, most, costs=costs)


def _row(line: Line, most: float, *, costs: bool) -> None:
    with ui.element("tr"):
        with ui.element("th").props("scope=row"):
            ui.label(line.protocol)
        with ui.element("td").classes("measured"):
            ui.label(_count(line.messages))
            with ui.element("div").classes("track").props("aria-hidden=true"):
                ui.element("div").classes("fill").style(f"width: {100 * line.messages / most:.1f}%")
        cells = [_count(line.ncccs), _count(line.bytes)]
        cells += [("-" if line.cost is None else _count(line.cost))] if costs else []
        for text in [*cells, say("compare.finished", finished=line.finished, runs=line.runs)]:
            with ui.element("td"):
                ui.label(text)


def _count(number: float) -> str:
    return f"{number:,.0f}" if number == int(number) else f"{number:,.1f}"
