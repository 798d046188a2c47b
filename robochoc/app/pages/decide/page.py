"""The page "Decide" of a team: a button that starts a run, the robots' conversation, and the answer in words."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache, partial
from importlib.resources import files

from nicegui import ui
from nicegui.events import GenericEventArguments

from robochoc.app.pages.decide.answer import effort, headline, show_costs, table_html
from robochoc.app.pages.decide.conversation_player import ConversationPlayer
from robochoc.app.pages.decide.front import show_front
from robochoc.app.pages.decide.no_solution_panel import NoSolutionPanel
from robochoc.app.pages.decide.picture import decides_places, falling_svg, targets_of, team_svg, values_of
from robochoc.app.pages.decide.run_options_panel import RunOptionsPanel
from robochoc.app.pages.imported.answer import ImportedNoSolutionPanel, show_imported_below, values_in_short
from robochoc.app.pages.imported.answer import table_html as answers_html
from robochoc.app.pages.shell import on_leave
from robochoc.app.projects import Project
from robochoc.app.runs.player import Frames
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run, RunState
from robochoc.app.runs.runs import runs_of
from robochoc.app.runs.tape import Tape
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.sketch import Sketch, Value
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown

PURPOSE = "decide"
MOST_LIVE = 300
"""The most robots whose picture is drawn live. Of larger teams, only the end and some playback moments are drawn."""
_SINGLE_CLICKS = (0, 1)
"""The numbers of successive clicks (`UIEvent.detail`) that count as a single click; for keys the number is 0."""
SHORT_S = 3.0
"""Searches shorter than this are replayed, since they ended before anyone could watch."""
FEW_MESSAGES = 100
"""Searches with at most this number of messages are also replayed, since they may be slower on a busy machine."""


def build_decide(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(_style())
    _Page(project)


class _Page:
    """The page in one browser tab."""

    def __init__(self, project: Project) -> None:
        self._project, self._runs = project, runs_of(project)
        self._imported = project.facts if project.import_folder else None
        """The facts about an imported team."""
        self._run: Run | None = None
        self._end_following: Callable[[], None] | None = None
        self._answered: tuple[object, ...] = ()
        self._shown_below: tuple[object, ...] = ()
        self._no_solution: NoSolutionPanel | ImportedNoSolutionPanel | None = None
        self._pressed: Run | None = None
        self._frames = Frames()
        with ui.element("h1"):
            ui.label(say("decide.title"))
        with ui.element("section").classes("decide-top"):
            with ui.element("div").classes("go"):
                self._go = ui.button(say("decide.button"), color=None)
                self._go.on("click", self._press, js_handler="(event) => emit(event.detail)")
                self._go.props("unelevated no-caps size=lg")
                self._status = ui.label("").classes("status").props("role=status")
                self._facts = ui.label("").classes("soft facts")
            self._not_ready = ui.element("div").classes("not-ready")
            self._options = RunOptionsPanel(project)
        with ui.element("div").classes("decide-body"):
            with ui.element("section").classes("panel team-picture"):
                self._picture = ui.html("", sanitize=False)
                self._legend = ui.label(say("decide.legend")).classes("soft small")
                self._falling = ui.html("", sanitize=False).classes("cost-line")
                self._player = ConversationPlayer(self._draw)
                self._reasons = ui.link(say("decide.talk-reasons"), f"/team/{project.id}/fly").classes("small")
            self._answer = ui.element("section").classes("panel answer")
        self._below = ui.element("div").classes("decide-below")
        on_leave(project.on_change(self._follow_team))
        on_leave(self._runs.on_start(self._follow_latest))
        on_leave(self._end)
        self._follow_latest()
        self._follow_team()

    # Events

    def _press(self, event: GenericEventArguments) -> None:
        """Start or stop a run. The second click of a double click must not stop the run started by the first click."""
        if event.args not in _SINGLE_CLICKS:
            return
        if self._run is not None and self._run.state == RunState.RUNNING:
            self._run.stop()
            self._go.set_text(say("decide.stopping"))
            self._go.disable()
        else:
            self._decide()

    def _decide(self, *, withdraw: bool = False) -> None:
        options = self._options.options(withdraw=withdraw)
        self._pressed = self._runs.start(options, files=self._project.files, purpose=PURPOSE)

    def _follow_latest(self) -> None:
        """Show the run that was started last, possibly in another tab."""
        self._end()
        self._run = self._runs.latest_for(PURPOSE)
        self._end_following = self._run.on_change(self._show) if self._run else None
        self._show()

    def _end(self) -> None:
        if self._end_following:
            self._end_following()

    def _follow_team(self) -> None:
        """Show errors in the team, or that it differs from the team in the shown run."""
        errors = [] if self._imported else errors_of(self._project.sketch)  # files are checked when they are opened
        self._not_ready.clear()
        if errors:
            with self._not_ready:
                ui.label(say("decide.not-ready")).classes("error")
                with ui.element("ul"):
                    for trouble in errors[:3]:
                        with ui.element("li"):
                            ui.label(f"{trouble.text} {trouble.remedy}")
                ui.link(say("decide.to-model"), f"/team/{self._project.id}/model")
        running = self._run is not None and self._run.state == RunState.RUNNING
        self._go.set_enabled(running or not errors)
        self._show()

    # Content

    def _show(self) -> None:
        shown, sketch = self._run, self._sketch()
        running = shown is not None and shown.state == RunState.RUNNING
        self._show_button(running=running)
        self._show_conversation(shown)  # first, since the playback may still show the previous run
        self._show_live(shown, sketch)
        changed = shown is not None and sketch != self._project.sketch
        now = (shown, shown and shown.state, shown and shown.result, changed)
        if now != self._answered:
            self._answered = now
            self._show_answer(shown, sketch, changed=changed)
        result = shown.result if shown else None
        if (shown, result) != self._shown_below:  # unchanged by a change of the state: the user may have clicked there
            self._shown_below = shown, result
            self._clear_below()
            if shown is not None and result is not None:
                with self._below:
                    self._show_below(shown, result, sketch)

    def _sketch(self) -> Sketch:
        try:
            return self._run.sketch if self._run else self._project.sketch
        except (OSError, ValueError):  # the run's files are damaged
            return self._project.sketch

    def _show_button(self, *, running: bool) -> None:
        if running and self._go.text != say("decide.stopping"):
            self._go.set_text(say("decide.stop"))
            self._go.enable()
        elif not running:
            self._go.set_text(say("decide.again" if self._run else "decide.button"))
            self._go.set_enabled(not any(self._not_ready))
        self._status.set_text(say("decide.running") if running else "")

    def _show_conversation(self, shown: Run | None) -> None:
        """Show the messages. In the tab where the run was started, a short conversation is played back."""
        self._reasons.set_visibility(shown is not None and shown.result is not None)
        if shown is not None and shown.state == RunState.RUNNING:
            self._player.show_live(shown.live.last_messages)
            return
        self._player.set_run(shown if shown and shown.result else None)
        if shown is not None and shown is self._pressed:
            self._pressed = None
            if shown.state == RunState.ENDED and shown.result and _is_short(shown.result):
                self._player.start()

    def _draw(self) -> None:
        """Draw the picture again after the moment of the playback has changed."""
        sketch = self._sketch()
        large = len(sketch.robots) > MOST_LIVE
        if self._frames.is_due(time.monotonic(), large=large, playing=self._player.playing):
            self._show_live(self._run, sketch)

    def _show_moment(self, sketch: Sketch, tape: Tape, number: int) -> None:
        values, unsettled = tape.values_at(number), tape.unsettled_at(number)
        says = values_in_short(self._imported, values) if self._imported else values_of(sketch, values)
        targets = targets_of(sketch, values)
        links = tape.moments[number].links
        self._picture.set_content(team_svg(sketch, says, unsettled=unsettled, spoken=links, targets=targets))

    def _show_live(self, shown: Run | None, sketch: Sketch) -> None:
        self._legend.set_visibility(decides_places(sketch))
        if shown is None:
            self._picture.set_content(team_svg(sketch, {}))
            return
        played = self._player.shown
        self._picture.classes(add="playing" if played else "", remove="" if played else "playing")
        if played:
            self._show_moment(sketch, *played)
            return
        live, result = shown.live, shown.result
        running = shown.state == RunState.RUNNING
        if running and len(sketch.robots) > MOST_LIVE and self._picture.content:
            self._show_facts(shown)
            return
        values: dict[str, Value] = {}
        for some in [*live.values.values()]:
            values |= some
        if result is not None:
            values = result.values
        unsettled = frozenset(robot.name for robot in sketch.robots if result is None and not live.settled(robot.name))
        aside = frozenset(result.withdrawn if result else ())
        spoken = dict(live.recent) if running else {}
        says = values_in_short(self._imported, values) if self._imported else values_of(sketch, values)
        targets = targets_of(sketch, values)
        picture = team_svg(sketch, says, unsettled=unsettled, aside=aside, spoken=spoken, targets=targets)
        self._picture.set_content(picture)
        falls = not (self._imported and self._imported.maximised)
        until = shown.seconds if running else 0.0
        self._falling.set_content(falling_svg([*live.costs], live.bound, until) if falls else "")
        self._show_facts(shown)

    def _show_facts(self, shown: Run) -> None:
        live, running = shown.live, shown.state == RunState.RUNNING
        facts = [say("decide.live", messages=f"{live.messages:,}", seconds=f"{shown.seconds:.0f}")] if running else []
        if running and live.costs:
            now = "imported.worth-now" if shown.record.maximised else "decide.best-now"
            facts.append(say(now, cost=cost_shown(live.costs[-1][1])))
        if running and live.bound is not None:
            most = "imported.worth-bound" if shown.record.maximised else "decide.bound"
            facts.append(say(most, bound=cost_shown(live.bound)))
        self._facts.set_text(" · ".join(facts))

    def _show_answer(self, shown: Run | None, sketch: Sketch, *, changed: bool) -> None:
        self._answer.clear()
        with self._answer:
            if shown is None:
                ui.label(say("decide.nothing")).classes("soft")
                return
            if shown.state == RunState.RUNNING and shown.result is None:
                ui.label(say("decide.running")).classes("soft")
                return
            with ui.element("h2").classes("headline").props("aria-live=polite"):
                ui.label(headline(shown, self._imported))
            if shown.result is None:
                return
            ui.label(effort(shown)).classes("soft")
            if shown.message and shown.state == RunState.ENDED:
                ui.label(say("decide.beside", why=shown.message)).classes("error")
            if why := shown.result.chosen.get("protocol"):
                ui.label(say("decide.why-chosen", protocol=shown.result.protocol, why=why)).classes("soft")
            if changed:
                ui.label(say("decide.changed")).classes("changed")
            if shown.result.front:
                show_front(shown, shown.result)
            if shown.result.assignment:
                table = (
                    answers_html(self._imported, shown.result) if self._imported else table_html(sketch, shown.result)
                )
                ui.html(table, sanitize=False).classes("values")

    def _show_below(self, shown: Run, result: RunResult, sketch: Sketch) -> None:
        if self._imported:
            self._no_solution = show_imported_below(self._project, self._imported, result, self._decide)
        elif result.verdict == "no-solution":
            self._no_solution = NoSolutionPanel(self._project, sketch, self._decide)
        if shown.live.is_cut:
            ui.label(say("decide.live-cut", messages=f"{shown.live.messages:,}")).classes("soft")
        if result.assignment and not self._imported:
            costs = ui.element("div")
            ui.timer(0, partial(show_costs, costs, sketch, result), once=True)
        _command(shown)

    def _clear_below(self) -> None:
        if self._no_solution:
            self._no_solution.end()
            self._no_solution = None
        self._below.clear()


def _command(shown: Run) -> None:
    command = shown.command
    if not command:
        return
    where = say("report.again-how") if shown.record.opened else say("decide.command-where", folder=str(shown.folder))
    with ui.element("section").classes("panel command"):
        with ui.element("h2"):
            ui.label(say("decide.command"))
        ui.label(where).classes("soft")
        with ui.element("div").classes("line"):
            with ui.element("pre").props("tabindex=0"):
                ui.label(command)
            copy = ui.button(icon="content_copy", on_click=lambda: _copy(command)).props("flat round dense")
            copy.props["aria-label"] = say("decide.copy")


def _copy(command: str) -> None:
    ui.clipboard.write(command)
    ui.notify(say("decide.copied"))


@cache
def _style() -> str:
    return (files(__package__) / "decide.css").read_text(encoding="utf-8")


def _is_short(result: RunResult) -> bool:
    """Return whether the conversation was too short to watch."""
    return result.metrics.wall_s < SHORT_S or result.messages <= FEW_MESSAGES
