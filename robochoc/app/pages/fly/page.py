"""The page "Fly" of a team: its flight, its conversation, and files to share."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from functools import cache
from importlib.resources import files
from pathlib import Path

from nicegui import ui

from robochoc.app.flights.builder import MOST_MESSAGES, BuildStage, FlightBuilder, builder_of, flies
from robochoc.app.flights.flight_map import happened_in
from robochoc.app.flights.flight_result import flight_result_of, flight_words, flying_robots_words
from robochoc.app.flights.report import summary
from robochoc.app.pages.fly.frames import RunFrames
from robochoc.app.pages.fly.saved_files import relative_address
from robochoc.app.pages.fly.share_panel import build_share_panel
from robochoc.app.pages.shell import on_leave
from robochoc.app.projects import Project
from robochoc.app.runs.run import Checked, Run, RunState
from robochoc.app.runs.runs import MAX_RUNS, runs_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown

_TICK_S = 0.5
_LONGEST_ID = 20


def build_fly(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(_style())
    _Page(project)


class _Page:
    """The page for a run, which is kept up to date. Without `?run=`, it shows the last run."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._runs = runs_of(project)
        request = ui.context.client.request
        self._requested = request.query_params.get("run", "")[:_LONGEST_ID] if request else ""
        self._shown: tuple[str, RunState] | None = None
        self._leave: Callable[[], None] = _nothing
        self._body = ui.element("div").classes("fly")
        self._follow()
        on_leave(self._runs.on_start(self._follow))
        on_leave(self._left)

    def _left(self) -> None:
        self._leave()

    def _run(self) -> Run | None:
        asked = self._runs.find(self._requested) if self._requested else None
        return asked or self._runs.latest_for("decide") or self._runs.latest_for("whatif")

    def _follow(self) -> None:
        """Show the run again if it or its state has changed."""
        run = self._run()
        shown = (run.id, run.state) if run else None
        if shown == self._shown and shown is not None:
            return
        self._leave()
        self._leave = run.on_change(self._follow) if run and run.state == RunState.RUNNING else _nothing
        self._shown = shown
        self._body.clear()
        with self._body:
            self._build(run)

    def _build(self, run: Run | None) -> None:
        if self._requested and (run is None or run.id != self._requested):
            key = "fly.gone" if run else "fly.gone-nothing"
            ui.label(say(key, run=self._requested, most=MAX_RUNS)).classes("note").props("role=status")
        if run is None:
            _empty_page("fly.nothing", "fly.nothing-remedy", "fly.to-decide", f"/team/{self._project.id}/decide")
            return
        try:
            sketch = run.sketch
        except (OSError, ValueError) as damaged:
            _title()
            ui.label(say("fly.damaged", why=damaged)).classes("error")
            return
        if run.state == RunState.RUNNING:
            _title()
            with ui.row(align_items="center").props("role=status"):
                ui.spinner(size="1.4rem")
                ui.label(say("fly.running"))
        elif run.state == RunState.FAILED:
            why = say("fly.failed", why=run.message)
            _empty_page(why, "fly.nothing-remedy", "fly.to-decide", f"/team/{self._project.id}/decide")
        else:
            self._result(run, sketch)

    def _result(self, run: Run, sketch: Sketch) -> None:
        with ui.element("div").classes("fly-head"):
            with ui.element("div"):
                _title()
                if happened := happened_in(run):
                    ui.label(say("fly.happened-first", what=" ".join(happened)))
                ui.label(summary(sketch, run)).classes("soft")
                for words in flying_robots_words(run):
                    ui.label(words).classes("soft")
            self._choice(run)
        if sketch != self._project.sketch:
            ui.label(say("fly.old")).classes("note")
        builder = builder_of(run)
        if not flies(run):
            remedy = "fly.no-places-files" if self._project.import_folder else "fly.no-places-remedy"
            _note("fly.no-places", remedy, "fly.to-model", f"/team/{self._project.id}/model")
        elif not builder.has_answer:
            ui.label(say("fly.no-answer")).classes("note")
        elif run.result and run.result.ends_unsolved:
            ui.label(say("fly.unsolved")).classes("note")
        shown = _BuiltFrames(builder)
        build_share_panel(builder, shown.frames)
        self._leave = shown.leave

    def _choice(self, run: Run) -> None:
        """Add a selection of earlier runs, if there are any."""
        runs = [one for one in self._runs.all() if one.state in {RunState.ENDED, RunState.STOPPED}]
        if len(runs) < 2:  # noqa: PLR2004 - nothing to choose
            return
        options = {one.id: run_words(one) for one in runs}

        def choose(name: str) -> None:
            ui.navigate.to(f"/team/{self._project.id}/fly?run={name}")

        select = ui.select(options, value=run.id, on_change=lambda event: choose(event.value), label=say("fly.choose"))
        select.props("dense outlined").classes("fly-choice")


class _BuiltFrames:
    """The frames of a run, which appear once they are built. Until then, the progress is shown."""

    def __init__(self, builder: FlightBuilder) -> None:
        self._builder = builder
        self._line = ui.element("div").classes("fly-line").props("role=status")
        with self._line:
            self._spinner = ui.spinner(size="1.4rem")
            self._says = ui.label("")
            self._cancel = ui.button(say("fly.cancel"), on_click=self._stop).props("flat no-caps dense")
            self._again = ui.button(say("fly.again"), on_click=self._request_files).props("flat no-caps dense")
        self._troubles = ui.element("div").classes("fly-troubles").props("role=status")
        self.frames = RunFrames(flies=builder.has_flight, talks=builder.has_conversation)
        self._timer = ui.timer(_TICK_S, self._show_time)
        self._release: Callable[[], None] = _nothing
        self._request_files()

    def leave(self) -> None:
        """End the request for the files, since the page was closed."""
        self._release()

    def _request_files(self) -> None:
        self._release()
        self._release = self._builder.request(self._update)
        self._update()

    def _stop(self) -> None:
        self._builder.cancel()
        self._update()

    def _update(self) -> None:
        builder, stage = self._builder, self._builder.stage
        works = stage in {BuildStage.FLIGHT, BuildStage.CONVERSATION}
        self._line.set_visibility(stage != BuildStage.DONE)
        self._spinner.set_visibility(works)
        self._cancel.set_visibility(works)
        self._again.set_visibility(stage == BuildStage.WAITING)
        self._timer.active = works
        self._show_time()
        flight, talk = _framed(builder, builder.flight), _framed(builder, builder.conversation)
        self.frames.show(flight, talk, flies=builder.has_flight, talks=builder.has_conversation)
        self.frames.set_visibility(builder.has_flight or builder.has_conversation)
        self._troubles.clear()
        with self._troubles:
            self._show_troubles()
            if builder.is_cut and talk:
                ui.label(say("fly.cut", most=f"{MOST_MESSAGES:,}")).classes("soft")

    def _show_troubles(self) -> None:
        builder = self._builder
        for place, why in builder.troubles.items():
            ui.label(say(f"fly.trouble.{place}", why=why)).classes("error")
        flown = flight_result_of(builder.run) if builder.flight else None
        words = flight_words(flown) if flown else []
        for sentence in words:
            ui.label(sentence).classes("error" if flown and flown.refused else "note")
        failed = builder.troubles or (flown and flown.refused)
        if builder.stage == BuildStage.DONE and failed:
            ui.button(say("fly.try-again"), icon="refresh", on_click=self._try_again).props("flat no-caps dense")

    def _try_again(self) -> None:
        try:
            self._builder.retry()
        except OSError as why:
            ui.notify(say("fly.trouble.flight", why=why), type="negative")
        self._update()

    def _show_time(self) -> None:
        stage = self._builder.stage
        if stage == BuildStage.WAITING:
            self._says.set_text(say("fly.cancelled"))
        elif stage != BuildStage.DONE:
            self._says.set_text(say(f"fly.making.{stage}", seconds=int(self._builder.seconds)))


def _framed(builder: FlightBuilder, page: Path | None) -> str | None:
    """Return the address of a page for a frame. It contains the page's modification time to prevent caching."""
    with suppress(OSError):
        return f"{relative_address(builder.run, page.name)}?driven&made={page.stat().st_mtime_ns}" if page else None
    return None


def _nothing() -> None:
    pass


def _title() -> None:
    with ui.element("h1"):
        ui.label(say("fly.title"))


def _empty_page(what: str, remedy: str, link: str, address: str) -> None:
    """Show the reason for an empty page, with a remedy and a link."""
    _title()
    ui.label(say(what) if what.startswith("fly.") else what)
    _remedy(remedy, link, address)


def _note(what: str, remedy: str, link: str, address: str) -> None:
    with ui.element("div").classes("note"):
        ui.label(say(what))
        _remedy(remedy, link, address)


def _remedy(remedy: str, link: str, address: str) -> None:
    with ui.element("p"):
        ui.label(say(remedy)).classes("soft")
    ui.link(say(link), address)


@cache
def _style() -> str:
    return (files(__package__) / "fly.css").read_text(encoding="utf-8")


_PURPOSES = {"decide": "decide", "whatif": "whatif", "whatif-anew": "anew"}
_VERDICTS = frozenset({"solution", "optimal", "no-solution"})


def run_words(run: Run, now: datetime | None = None) -> str:
    """Return the description of a run on one line.

    Args:
        run: The run.
        now: The local time, by default the current time. Runs on other days are shown with their date.
    """
    began = datetime.fromtimestamp(run.record.started).astimezone()
    when = (
        f"{began:%H:%M}" if began.date() == (now or datetime.now().astimezone()).date() else f"{began:%Y-%m-%d %H:%M}"
    )
    return say("fly.run.line", when=when, purpose=purpose_words(run), verdict=_verdict(run))


def purpose_words(run: Run) -> str:
    """Return the purpose of a run in words."""
    key = "opened" if run.record.opened else _PURPOSES.get(run.record.purpose, "other")
    return say(f"fly.run.{key}")


def _verdict(run: Run) -> str:
    result = run.result
    if result is None:
        return say("fly.verdict.nothing")
    key = result.verdict if result.verdict in _VERDICTS else "stopped" if run.state == RunState.STOPPED else "limit"
    if key in {"stopped", "limit"} and not result.assignment:
        return say("fly.verdict.nothing")
    if result.front:
        return say("fly.verdict.point", number=result.point + 1, points=f"{len(result.front):,}")
    words = [say(f"fly.verdict.{key}")]
    if result.withdrawn:
        words.append(say("fly.verdict.aside", count=len(result.withdrawn)))
    if result.cost:
        words.append(
            say("fly.verdict.worth" if run.record.maximised else "fly.verdict.cost", cost=cost_shown(result.cost))
        )
    if run.record.checked in {Checked.BROKEN, Checked.COST}:
        words.append(say("fly.verdict.wrong"))
    return ", ".join(words)
