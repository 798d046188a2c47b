"""The page "Model": the board for drawing a team, and the panels for robots, decisions and rules."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec
from nicegui import run, ui

from robochoc.app.pages.model.board import SELECT, Board, BoardEvents, RobotClicked, RobotDragged
from robochoc.app.pages.model.decisions_panel import DecisionsPanel
from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.model.picture import LinksDrawn, links_of, robots_of
from robochoc.app.pages.model.robots_panel import RobotsPanel, without_robots
from robochoc.app.pages.model.rules_panel import RulesPanel
from robochoc.app.pages.model.sources import Sources
from robochoc.app.pages.model.values import with_cell
from robochoc.app.pages.shell import on_leave
from robochoc.app.pages.widgets import TroubleLines, number_field, put
from robochoc.app.projects import Project
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.edits import (
    EditError,
    check_cell,
    with_area,
    with_cell_blocked,
    with_decision,
    with_robot,
    with_robot_moved,
    with_rule,
)
from robochoc.app.sketch.palette import Form
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import MAX_SIDE, Cell, DecisionKind, Setting, Sketch, SketchRule
from robochoc.app.sketch.troubles import About, Trouble
from robochoc.app.texts import say

TOOLS = {SELECT: "near_me", "add": "add_circle_outline", "block": "block"}
"""The tools and their icons."""
_QUIET_S = 0.15
"""The time in seconds between an edit and the check of the sketch."""


def build_model(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(_style())
    ModelPage(project)


class ModelPage:
    """The page in one browser tab."""

    def __init__(self, project: Project) -> None:
        self._desk = desk = Desk(project)
        self._tool = SELECT
        self._checked: Sketch | None = None
        self._is_checking = False
        self._clicked: str | None = None
        with ui.element("div").classes("model"):
            with ui.element("section").classes("stage").props(f'aria-label="{say("board.map")}"'):
                self._build_stage()
            with ui.element("div").classes("side"):
                self._robots = RobotsPanel(desk)
                self._decisions = DecisionsPanel(desk)
                self._rules = RulesPanel(desk)
        self._sources = Sources(desk)
        desk.on_view_change(self._follow)
        desk.point = self._light
        on_leave(project.on_change(self._changed))
        self._timer = ui.timer(_QUIET_S, self._check, active=False)
        self._changed()

    def _build_stage(self) -> None:
        with ui.element("div").classes("toolbar panel"):
            tools = {name: say(f"tool.{name}") for name in TOOLS}
            self._tools = ui.toggle(tools, value=SELECT, on_change=lambda event: self._use(event.value))
            self._tools.props("no-caps unelevated").classes("segments")
            MapFields(self._desk)
        self._hint = ui.label().classes("guide").props("role=status")
        with ui.element("div").classes("panel map-box"):
            events = BoardEvents(
                robot=self._robot,
                cell=self._cell,
                moved=self._moved,
                removed=self._removed,
                rule=self._desk.open,
                cleared=self._cleared,
            )
            self._board = Board(events)
        self._wrong = ui.label().classes("error").props("role=alert")
        self._wrong.set_visibility(False)
        self._desk.show_error = self._show_error
        self._lines = TroubleLines()

    # Events of the board

    def _use(self, tool: str) -> None:
        self._tool = tool
        self._board.use(tool)
        if tool != SELECT and self._desk.cells_of is not None:
            self._desk.cells_of = None
            self._desk.notify_view_change()
        self._guide()

    def _robot(self, clicked: RobotClicked) -> None:
        desk = self._desk
        rule = None if desk.opened is None else desk.sketch.rule(desk.opened)
        if rule is not None:
            desk.try_edit(lambda sketch: with_robot_clicked(sketch, rule, clicked.name))
        elif clicked.more:
            others = [name for name in desk.selected if name != clicked.name]
            desk.select(others if clicked.name in desk.selected else [*others, clicked.name])
        else:
            desk.select([] if desk.selected == [clicked.name] else [clicked.name])

    def _cell(self, cell: Cell) -> None:
        desk = self._desk
        if self._tool == "add":
            if desk.try_edit(lambda sketch: with_robot(sketch, cell)):
                desk.select_added(desk.sketch.robots[-1].name)
        elif self._tool == "block":
            desk.try_edit(lambda sketch: with_cell_blocked(sketch, cell, blocked=cell not in sketch.area.blocked))
        elif desk.cells_of is not None or desk.opened is not None:
            desk.try_edit(lambda sketch: with_cell_clicked(sketch, cell, desk.cells_of, desk.opened))
        elif desk.sketch.robots:
            desk.select([])
        else:  # on an empty map, a click adds a robot
            self._tools.set_value("add")
            self._cell(cell)

    def _moved(self, moved: RobotDragged) -> None:
        self._desk.try_edit(lambda sketch: with_robot_moved(sketch, moved.name, Cell(moved.x, moved.y)))

    def _removed(self, name: str) -> None:
        selected = self._desk.selected
        names = tuple(selected) if name in selected else (name,)
        self._desk.try_edit(lambda sketch: without_robots(sketch, names))

    def _cleared(self) -> None:
        self._desk.selected = []
        self._desk.open(None)

    # Content

    def _changed(self) -> None:
        """Show the team. Errors and links are updated shortly afterwards."""
        self._desk.drop_removed()
        self._follow()
        self._board.show(self._desk.sketch, robots=robots_of(self._desk.sketch, self._desk.troubles))
        self._timer.activate()
        self._sources.changed()

    def _follow(self) -> None:
        self._robots.follow()
        self._decisions.follow()
        self._rules.follow()
        self._clicking_cells()
        self._board.choose(self._shown_as_chosen())
        self._light()
        self._guide()

    def _clicking_cells(self) -> None:
        """Switch to the select tool when the user starts to edit cells or a rule."""
        clicked = self._desk.cells_of or self._desk.opened
        if clicked is not None and clicked != self._clicked:
            self._tools.set_value(SELECT)
        self._clicked = clicked

    def _shown_as_chosen(self) -> list[str]:
        rule = None if self._desk.opened is None else self._desk.sketch.rule(self._desk.opened)
        return [*self._desk.sketch.bound(rule)] if rule is not None else self._desk.selected

    def _light(self) -> None:
        self._board.light(self._desk.pointed or self._desk.opened)

    def _guide(self) -> None:
        """Show the next step to the user."""
        desk = self._desk
        key = f"guide.{self._tool}"
        if not desk.sketch.robots:
            key = "guide.empty"
        elif desk.cells_of is not None:
            key = "guide.cells"
        elif desk.opened is not None:
            key = "guide.rule"
        elif self._tool == SELECT and not desk.sketch.decisions:
            key = "guide.decide"
        elif self._tool == SELECT and not desk.sketch.rules:
            key = "guide.rules"
        self._hint.set_text(say(key))

    def _show_error(self, wrong: str) -> None:
        self._wrong.set_text(wrong)
        self._wrong.set_visibility(bool(wrong))
        if wrong:  # the board may still show the invalid edit
            self._board.show(self._desk.sketch, robots=robots_of(self._desk.sketch, self._desk.troubles))

    async def _check(self) -> None:
        """Compute errors and links in a thread, since that is slow for large teams."""
        self._timer.deactivate()
        if self._is_checking:
            return
        self._is_checking = True
        try:
            while self._checked is not self._desk.sketch:
                sketch = self._desk.sketch
                found = await run.io_bound(_troubles_and_links, sketch)
                if found is None:  # the application is shutting down
                    return
                self._checked = sketch
                if sketch is self._desk.sketch:
                    self._show(*found)
        finally:
            self._is_checking = False

    def _show(self, wrong: list[Trouble], links: LinksDrawn) -> None:
        desk = self._desk
        desk.troubles = wrong
        self._rules.left_out = links.left_out
        self._board.show(desk.sketch, robots=robots_of(desk.sketch, wrong), links=links.drawn)
        self._lines.show([one for one in wrong if one.about in {About.MAP, About.TEAM} and desk.sketch.robots])
        self._follow()


def _troubles_and_links(sketch: Sketch) -> tuple[list[Trouble], LinksDrawn]:
    return troubles(sketch), links_of(sketch)


@cache
def _style() -> str:
    return (files(__package__) / "model.css").read_text(encoding="utf-8")


class MapFields:
    """The fields for the columns and rows of the map."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        with ui.element("div").classes("map-size").props(f'role=group aria-label="{say("model.map-size")}"'):
            self._columns = number_field("model.columns", 1, MAX_SIDE, lambda value: self._change(columns=value))
            ui.label("×").props("aria-hidden=true").classes("soft")  # noqa: RUF001 - the sign of multiplication
            self._rows = number_field("model.rows", 1, MAX_SIDE, lambda value: self._change(rows=value))
        self._follow()
        on_leave(desk.project.on_change(self._follow))

    def _follow(self) -> None:
        put(self._columns, self._desk.sketch.area.columns)
        put(self._rows, self._desk.sketch.area.rows)

    def _change(self, columns: int | None = None, rows: int | None = None) -> str | None:
        area = self._desk.sketch.area
        wanted = columns or area.columns, rows or area.rows
        if wanted == (area.columns, area.rows):
            return None
        return self._desk.edit(lambda sketch: with_area(sketch, *wanted))


def with_robot_clicked(sketch: Sketch, rule: SketchRule, name: str) -> Sketch:
    """Add a robot to a rule, or remove it. A rule for all robots becomes a rule for this robot.

    Raises:
        EditError: if it is the last robot in the rule, since a rule without robots applies to all robots.
    """
    if sketch.robot(name) is None:
        return sketch  # the robot has been removed in the meantime
    robots = rule.robots
    if robots == (name,):
        raise EditError("edit.last-of-rule", rule.id, robot=name)
    kept = tuple(one for one in robots if one != name) if name in robots else (*robots, name)
    return with_rule(sketch, msgspec.structs.replace(rule, robots=kept))


def with_cell_clicked(sketch: Sketch, cell: Cell, cells_of: str | None, opened: str | None) -> Sketch:
    """Add a cell to the decision `cells_of` or to the open rule, or remove it.

    Raises:
        EditError: if the cell is not on the map (any more), or is the last one.
    """
    check_cell(sketch, cell)
    decision = None if cells_of is None else sketch.decision(cells_of)
    if decision is not None and decision.kind == DecisionKind.PLACE:
        values = with_cell(sketch, decision, sketch.area.number(cell))
        made = msgspec.structs.replace(decision, values=values)
        return with_decision(sketch, made, instead_of=decision.name)
    rule = None if opened is None else sketch.rule(opened)
    return sketch if rule is None else _with_cell_in_rule(sketch, rule, sketch.area.number(cell))


def _with_cell_in_rule(sketch: Sketch, rule: SketchRule, number: int) -> Sketch:
    decision = sketch.decision(rule.decision)
    if decision is None or decision.kind != DecisionKind.PLACE or number not in sketch.values(decision):
        return sketch
    for opening in PALETTE[rule.kind].openings:
        if opening.form == Form.VALUE:
            return _filled(sketch, rule, opening.name, number)
        if opening.form == Form.VALUES:
            given = rule.settings.get(opening.name)
            cells = [one for one in given if isinstance(one, int)] if isinstance(given, list) else []
            kept = [one for one in cells if one != number] if number in cells else [*cells, number]
            return _filled(sketch, rule, opening.name, [*kept])
    return sketch


def _filled(sketch: Sketch, rule: SketchRule, name: str, value: Setting) -> Sketch:
    return with_rule(sketch, msgspec.structs.replace(rule, settings={**rule.settings, name: value}))
