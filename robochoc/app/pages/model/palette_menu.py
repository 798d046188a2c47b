"""The palette: a menu of rules in plain words. A new rule has suitable initial settings, which the user can change."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.sketch.edits import with_rule
from robochoc.app.sketch.fits import why_no_cost
from robochoc.app.sketch.palette import Form, PaletteRule, RuleField
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Decision, Kind, Setting, Sketch, SketchRule
from robochoc.app.sketch.words import listed
from robochoc.app.texts import say

FIRST_COST = 1
_PREFERENCE, _NEAR = "prefers", "rather"


class PaletteMenu:
    """A dialog with all rules that fit a decision."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        with (
            ui.dialog() as self._dialog,
            ui.element("div").classes("palette").props("role=dialog aria-modal=true") as box,
        ):
            box.props["aria-label"] = say("model.palette")
            with ui.element("div").classes("entry-head"):
                with ui.element("h2").classes("grow"):
                    ui.label(say("model.palette"))
                ui.button(icon="close", on_click=self._dialog.close).props(
                    f'flat round dense aria-label="{say("model.close")}"'
                )
            self._about = ui.select([], label=say("model.about"), on_change=self._list)
            self._about.props("dense outlined").classes("wide")
            self._hint = ui.label().classes("soft")
            self._why = ui.label()
            self._rules = ui.element("ul").classes("palette-rules")

    def open(self) -> None:
        """Show the menu."""
        names = [decision.name for decision in self._desk.sketch.decisions]
        if names:
            chosen = self._about.value if self._about.value in names else names[0]
            self._about.set_options(names, value=chosen)
            self._about.set_visibility(len(names) > 1)
            self._list()
            self._dialog.open()

    def _list(self) -> None:
        decision = self._desk.sketch.decision(self._about.value or "")
        self._rules.clear()
        if decision is None:
            return
        meant = self._desk.rule_robots
        self._hint.set_text(say("model.palette-some", robots=listed(meant)) if meant else say("model.palette-all"))
        off = why_no_cost(self._desk.sketch)
        self._why.set_text("" if off is None else f"{off.text} {off.remedy}")
        self._why.set_visibility(off is not None)
        with self._rules:
            for entry in PALETTE.values():
                if decision.kind in entry.kinds:
                    with ui.element("li"), ui.element("button").props("type=button").classes("card") as button:
                        ui.label(say(f"rule.{entry.key}.name")).classes("strong")
                        ui.label(say(f"rule.{entry.key}.help")).classes("soft small")
                    if off is not None and costs_at_first(entry):
                        button.props("disabled")
                    else:
                        button.on("click", partial(self._pick, entry, decision))

    def _pick(self, entry: PaletteRule, decision: Decision) -> None:
        self._dialog.close()
        before = {rule.id for rule in self._desk.sketch.rules}
        rule = first_rule(self._desk.sketch, entry, decision, self._desk.rule_robots)
        if self._desk.do(lambda sketch: with_rule(sketch, rule)):
            self._desk.open(next(rule.id for rule in self._desk.sketch.rules if rule.id not in before))


def costs_at_first(entry: PaletteRule) -> bool:
    """Return whether a new rule of this kind has a cost."""
    return entry.graded or entry.key == _PREFERENCE


def first_rule(sketch: Sketch, entry: PaletteRule, decision: Decision, selected: list[str]) -> SketchRule:
    """Return a new rule for the selected robots, with valid settings."""
    deciders = sketch.deciders(decision)
    chosen = tuple(name for name in selected if name in deciders)
    if len(chosen) < entry.fewest:
        chosen = ()
    if entry.most is not None and not entry.fewest <= len(chosen or deciders) <= entry.most:
        chosen = (chosen or deciders)[: entry.most]
    values = sketch.values(decision)
    settings = {opening.name: _first(opening, values) for opening in entry.openings}
    if entry.key == _NEAR and decision.kind == Kind.PLACE and len(chosen) == 1:
        settings["value"] = _nearest(sketch, chosen[0], values)
    cost = FIRST_COST if entry.key == _PREFERENCE else None  # graded rules have their own costs
    return SketchRule("", entry.key, decision.name, chosen, settings, cost)


def _nearest(sketch: Sketch, robot: str, values: tuple[int | str, ...]) -> Setting:
    """Return the place that is nearest to a robot's position."""
    drawn = sketch.robot(robot)
    cells = [value for value in values if isinstance(value, int)]
    if drawn is None or not cells:
        return 0

    def steps(number: int) -> int:
        cell = sketch.area.cell(number)
        return abs(cell.x - drawn.at.x) + abs(cell.y - drawn.at.y)

    return min(cells, key=steps)


def _first(opening: RuleField, values: tuple[int | str, ...]) -> Setting:
    match opening.form:
        case Form.NUMBER:
            return opening.least if opening.default is None else opening.default
        case Form.VALUE:
            return values[0] if values else 0
        case Form.VALUES:
            return [*values[:1]]
        case Form.TABLE:
            return []
