"""The panel "Which rules?": each rule as a sentence with its form, and the palette for new rules."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.model.palette_menu import PaletteMenu
from robochoc.app.pages.model.parts import Cards, TroubleLines, icon_button, line, name_it, panel
from robochoc.app.pages.model.picture import colour_of
from robochoc.app.pages.model.rule_form import RuleForm
from robochoc.app.sketch.edits import with_rule_switched, without_rule
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.troubles import About
from robochoc.app.sketch.words import sentence, weight_of
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
        """Show the sketch as it stands."""
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
    """A rule: its sentence, and its form when it is open."""

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
        """Show the sketch as it stands."""
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
        self._desk.do(lambda sketch: with_rule_switched(sketch, self._id, on=on))

    def _removed(self) -> None:
        self._desk.do(lambda sketch: without_rule(sketch, self._id))

    def _point(self, rule: str | None) -> None:
        if self._desk.pointed != rule:
            self._desk.pointed = rule
            self._desk.point()
