"""The panel "Which rules?": each rule as a sentence with its form, and the palette for adding rules."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.model.picture import colour_of
from robochoc.app.pages.model.rule_form import RuleForm
from robochoc.app.pages.widgets import Cards, TroubleLines, icon_button, line, name_it, panel
from robochoc.app.sketch.edits import with_rule, with_rule_switched, without_rule
from robochoc.app.sketch.palette import Form, PaletteRule, RuleField
from robochoc.app.sketch.rule_checks import why_no_cost
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sentences import listed, sentence, weight_of
from robochoc.app.sketch.sketch import Decision, DecisionKind, Setting, Sketch, SketchRule
from robochoc.app.sketch.troubles import About
from robochoc.app.texts import say

MOST_SHOWN = 40
"""The number of rules that are listed at first."""


class RulesPanel:
    """The rules of the robots."""

    def __init__(self, desk: Desk) -> None:
        self._desk, self._most = desk, MOST_SHOWN
        self.left_out: frozenset[str] = frozenset()
        with panel("model.rules"):
            self._hint = ui.label().classes("soft")
            with ui.element("div").classes("stack") as box:
                self._cards = Cards(box, partial(_RuleCard, desk, self))
            self._more = ui.button(on_click=self._show_more).props("flat dense no-caps")
            menu = PaletteMenu(desk)
            self._add = ui.button(say("model.add-rule"), icon="add", on_click=menu.open).props("no-caps unelevated")

    def follow(self) -> None:
        """Update the panel to the current sketch."""
        sketch = self._desk.sketch
        self._add.set_enabled(bool(sketch.decisions))
        self._hint.set_text(say("model.rules-hint" if sketch.decisions else "model.rules-wait"))
        self._hint.set_visibility(not sketch.rules)
        opened = next((place for place, rule in enumerate(sketch.rules) if rule.id == self._desk.opened), 0)
        self._most = max(self._most, opened + 1)
        shown = sketch.rules[: self._most]
        self._cards.follow([(rule.id, rule.kind) for rule in shown])
        left = len(sketch.rules) - len(shown)
        self._more.set_visibility(left > 0)
        self._more.set_text(say("model.more-rules", count=left))

    def _show_more(self) -> None:
        self._most += MOST_SHOWN
        self.follow()


class _RuleCard:
    """The card of a rule: its sentence, and its form if it is open."""

    def __init__(self, desk: Desk, rules: RulesPanel, key: tuple[str, str]) -> None:
        self._desk, self._rules, (self._id, self._kind) = desk, rules, key
        self._form: RuleForm | None = None
        with ui.element("article").classes("entry rule") as self.element:
            with ui.element("div").classes("entry-head"):
                ui.element("span").classes("swatch").props("aria-hidden=true").style(
                    f"--line: var(--rule-{self._colour()})"
                )
                ui.label(self._id).classes("rule-id")
                with ui.element("button").classes("sentence grow").props("type=button") as self._open:
                    self._open.props["aria-expanded"] = "false"
                    self._sentence = line("")
                    self._weight = line("", "soft")
                self._open.on("click", self._opened)
                self._switch = ui.switch(on_change=lambda event: self._switched(on=bool(event.value))).props("dense")
                self._remove = icon_button("close", "", self._removed)
            self._lines = TroubleLines()
            self._note = ui.label(say("model.not-drawn")).classes("soft small")
            self._body = ui.element("div")
        self.element.on("mouseenter", lambda: self._point(self._id))
        self.element.on("mouseleave", lambda: self._point(None))

    def follow(self) -> None:
        """Update the card to the current sketch."""
        sketch, rule = self._desk.sketch, self._desk.sketch.rule(self._id)
        if rule is None:
            return
        text = sentence(sketch, rule)
        self._sentence.set_text(f"{text} ")
        self._weight.set_text(weight_of(rule))
        self._switch.set_value(rule.on)
        name_it(self._switch, say("model.rule-on", rule=text))
        name_it(self._remove, say("model.remove", name=text))
        self._note.set_visibility(rule.id in self._rules.left_out)
        self._lines.show(self._desk.troubles_at(About.RULE, rule.id))
        is_open = self._desk.opened == self._id
        if self._open.props.get("aria-expanded") != str(is_open).lower():
            self._open.props["aria-expanded"] = str(is_open).lower()
            self._open.update()
            self.element.classes(toggle="opened")
            if is_open:  # the rule may have been opened on the map
                ui.run_javascript(
                    f"document.getElementById('{self.element.html_id}')?.scrollIntoView({{block: 'nearest'}})"
                )
        self.element.classes(**{"remove" if rule.on else "add": "off"})
        self._fill(is_open=is_open and self._kind in PALETTE)

    def _fill(self, *, is_open: bool) -> None:
        if is_open and self._form is None:
            with self._body:
                self._form = RuleForm(self._desk, self._id, PALETTE[self._kind])
        elif not is_open and self._form is not None:
            self._body.clear()
            self._form = None
        if self._form is not None:
            self._form.follow()

    def _colour(self) -> int:
        rule = self._desk.sketch.rule(self._id)
        return 0 if rule is None else colour_of(rule)

    def _opened(self) -> None:
        self._desk.open(None if self._desk.opened == self._id else self._id)

    def _switched(self, *, on: bool) -> None:
        self._desk.try_edit(lambda sketch: with_rule_switched(sketch, self._id, on=on))

    def _removed(self) -> None:
        self._desk.try_edit(lambda sketch: without_rule(sketch, self._id))

    def _point(self, rule: str | None) -> None:
        if self._desk.pointed != rule:
            self._desk.pointed = rule
            self._desk.point()


FIRST_COST = 1
_PREFERENCE, _NEAR = "prefers", "rather"


class PaletteMenu:
    """A dialog with all rules that can apply to a decision."""

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
        if self._desk.try_edit(lambda sketch: with_rule(sketch, rule)):
            self._desk.open(next(rule.id for rule in self._desk.sketch.rules if rule.id not in before))


def costs_at_first(entry: PaletteRule) -> bool:
    """Return whether a new rule of this kind has a cost by default."""
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
    if entry.key == _NEAR and decision.kind == DecisionKind.PLACE and len(chosen) == 1:
        settings["value"] = _nearest(sketch, chosen[0], values)
    cost = FIRST_COST if entry.key == _PREFERENCE else None  # graded rules have their own costs
    return SketchRule("", entry.key, decision.name, chosen, settings, cost)


def _nearest(sketch: Sketch, robot: str, values: tuple[int | str, ...]) -> Setting:
    """Return the place nearest to a robot's position."""
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
