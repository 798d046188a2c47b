"""The page "What if": the user changes the team, and it decides again."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib.resources import files

from nicegui import run, ui

from robochoc.app.pages.model.board import Board, BoardAction, BoardEvents, RobotClicked
from robochoc.app.pages.model.picture import LinksDrawn, links_of, robots_of
from robochoc.app.pages.shell import edit_error_text, on_leave
from robochoc.app.pages.whatif.answer import WhatIfAnswer
from robochoc.app.pages.whatif.story import story_of, why_not_continue
from robochoc.app.pages.widgets import bounded_integer
from robochoc.app.projects import Project
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import MAX_SIDE, Cell, DecisionKind, Sketch
from robochoc.app.sketch.team_changes import (
    FULL,
    LEAST_BATTERY,
    AnyTeamChange,
    CellBlocked,
    LowBattery,
    RobotFails,
    RobotJoins,
)
from robochoc.app.texts import say

_UPDATE_S = 0.25
_LINK_S = 0.05


def build_whatif(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(_style())
    with ui.element("div"):
        _heading("h1", "whatif.title")
        ui.label(say("whatif.intro")).classes("soft")
    sketch = project.sketch
    if not sketch.robots or not sketch.decisions:
        with ui.element("div").classes("panel"):
            ui.label(say("whatif.empty"))
            ui.link(say("whatif.empty-remedy"), f"/team/{project.id}/model")
        return
    WhatIfPage(project)


class WhatIfPage:
    """The page in one browser tab."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._story = story_of(project)
        self._linked: tuple[Sketch, Sketch] | None = None
        with ui.element("div").classes("whatif"):
            with ui.element("section").classes("panel map-box").props(f'aria-label="{say("whatif.map")}"'):
                self._board = Board(
                    BoardEvents(robot=self._robot_clicked, cell=self._cell_clicked, act=self._act), movable=False
                )
            with ui.element("div").classes("whatif-side"):
                self._build_happenings()
                self._build_list()
        with ui.element("section").classes("whatif-answer").props("aria-live=polite"):
            self._answer = WhatIfAnswer(project, self._story)
        self._linking = ui.timer(_LINK_S, self._link, active=False)
        ui.timer(_UPDATE_S, self._answer.update)
        on_leave(project.on_change(self._follow))
        on_leave(self._story.on_change(self._follow))
        self._follow()

    def _build_happenings(self) -> None:
        with ui.element("section").classes("panel whatif-part"):
            _heading("h2", "whatif.pick")
            ui.label(say("whatif.pick-hint")).classes("soft")
            with ui.element("div").classes("whatif-row"):
                self._robots = ui.select([], label=say("whatif.robot"), on_change=self._robot_chosen)
                self._robots.props("dense outlined options-dense").classes("grow")
                _act("whatif.fail", "heart_broken", lambda: self._happen(lambda: RobotFails(self._chosen())))
            with ui.element("div").classes("whatif-row"):
                self._slider = ui.slider(min=0, max=FULL, step=5, value=50).classes("grow")
                self._slider.props(f'label aria-label="{say("whatif.battery")}"')
                _button = _act("whatif.battery-set", "battery_3_bar", self._battery_set, percent=50)
            self._slider.on_value_change(lambda _: _button.set_text(say("whatif.battery-set", percent=self._percent())))
            ui.label(say("whatif.battery-hint", least=LEAST_BATTERY)).classes("soft small")
            with ui.element("div").classes("whatif-row"):
                self._column, self._row = (
                    ui.number(label=say(key), value=1, min=1, precision=0).props("dense outlined").classes("short")
                    for key in ("whatif.column", "whatif.row")
                )
                _act("whatif.block", "block", lambda: self._happen(lambda: CellBlocked(self._chosen_cell())))
                _act("whatif.join", "add_circle_outline", lambda: self._happen(lambda: RobotJoins(self._chosen_cell())))
            self._wrong = ui.label().classes("error").props("role=alert")

    def _build_list(self) -> None:
        with ui.element("section").classes("panel whatif-part"):
            _heading("h2", "whatif.list")
            self._list = ui.element("ol").classes("whatif-list")
            self._none = ui.label(say("whatif.none")).classes("soft")
            self._from_scratch = ui.label().classes("soft small")
            with ui.element("div").classes("whatif-row"):
                self._decide = ui.button(say("whatif.decide"), on_click=self._story.decide, color=None).props(
                    "no-caps unelevated"
                )
                self._decide.classes("go")
                self._clear = ui.button(say("whatif.clear"), on_click=self._story.clear).props("no-caps flat")

    # Events

    def _robot_clicked(self, clicked: RobotClicked) -> None:
        if clicked.name in (self._robots.options or []):
            self._robots.set_value(clicked.name)

    def _robot_chosen(self) -> None:
        self._board.choose([self._robots.value] if self._robots.value else [])

    def _cell_clicked(self, cell: Cell) -> None:
        self._column.set_value(cell.x + 1)
        self._row.set_value(cell.y + 1)

    def _act(self, chosen: BoardAction) -> None:
        """Add the event that the user selected at a robot or a cell of the map."""
        name, cell = chosen.name, Cell(chosen.x, chosen.y)
        changes: dict[str, AnyTeamChange] = {
            "fail": RobotFails(name),
            "half": LowBattery(name, FULL // 2),
            "quarter": LowBattery(name, FULL // 4),
            "block": CellBlocked(cell),
            "join": RobotJoins(cell),
        }
        if (change := changes.get(chosen.act)) is not None:
            self._happen(lambda: change)

    def _chosen(self) -> str:
        return str(self._robots.value or "")

    def _chosen_cell(self) -> Cell:
        column, row = (
            bounded_integer(field.value, 0, MAX_SIDE + 1, otherwise=0) for field in (self._column, self._row)
        )
        return Cell(column - 1, row - 1)

    def _percent(self) -> int:
        return bounded_integer(self._slider.value, 0, FULL, otherwise=FULL)

    def _battery_set(self) -> None:
        self._happen(lambda: LowBattery(self._chosen(), self._percent()))

    def _happen(self, change: Callable[[], AnyTeamChange]) -> None:
        self._wrong.set_text("")
        try:
            self._story.add(change())
        except EditError as error:
            self._wrong.set_text(edit_error_text(error))

    # Content

    def _follow(self) -> None:
        words = self._story.words()
        after = self._story.after()
        names = [robot.name for robot in after.robots]
        if names != self._robots.options:
            kept = self._robots.value if self._robots.value in names else next(iter(names), None)
            self._robots.set_options(names, value=kept)
        self._show_list(words)
        self._none.set_visibility(not words)
        self._clear.set_enabled(bool(words))
        self._decide.set_enabled(bool(words) and not self._story.running)
        self._board.show(after, robots=robots_of(after))
        self._board.set_menus(*_offered(after))
        self._from_scratch.set_visibility(bool(words))
        self._robot_chosen()
        self._answer.follow()
        self._linking.activate()

    def _show_list(self, words: list[str]) -> None:
        self._list.clear()
        self._list.set_visibility(bool(words))
        with self._list:
            for place, text in enumerate(words):
                with ui.element("li"), ui.element("div").classes("whatif-item"):
                    ui.label(text).classes("grow")
                    back = ui.button(icon="undo", on_click=partial(self._story.remove_change, place))
                    back.props("flat round dense").props["aria-label"] = say("whatif.back", what=text)

    async def _link(self) -> None:
        """Draw the rules and show errors. Both are computed in a thread, since that is slow for large teams."""
        self._linking.deactivate()
        after = self._story.after()
        pair = self._project.sketch, after
        if self._linked == pair:
            return
        self._linked = pair
        found = await run.io_bound(_links_and_errors, *pair)
        if found is not None and self._linked is pair:
            links, wrong, anew = found
            self._from_scratch.set_text(anew)
            self._board.show(after, robots=robots_of(after), links=links.drawn)
            self._wrong.set_text(say("whatif.wrong", text=wrong) if wrong else "")


def _links_and_errors(before: Sketch, after: Sketch) -> tuple[LinksDrawn, str, str]:
    wrong = next((error.text for error in errors_of(after)), "")
    return links_of(after), wrong, "" if wrong or before == after else why_not_continue(before, after)


def _offered(sketch: Sketch) -> tuple[dict[str, str], dict[str, str]]:
    """Return the possible events for a robot, and for a cell."""
    robot = {"fail": say("whatif.fail")}
    if any(decision.kind == DecisionKind.LEVEL for decision in sketch.decisions):
        shares = {"half": FULL // 2, "quarter": FULL // 4}
        robot |= {act: say("whatif.battery-set", percent=percent) for act, percent in shares.items()}
    return robot, {"block": say("whatif.block"), "join": say("whatif.join")}


def _heading(tag: str, key: str) -> None:
    with ui.element(tag):
        ui.label(say(key))


def _act(key: str, icon: str, does: Callable[[], object], **named: object) -> ui.button:
    return ui.button(say(key, **named), icon=icon, on_click=does).props("no-caps outline dense").classes("act")


@cache
def _style() -> str:
    return "\n".join((files("robochoc.app.pages") / path).read_text(encoding="utf-8") for path in _STYLES)


_STYLES = ("model/model.css", "decide/decide.css", "whatif/whatif.css")
