"""The form for an open rule: its decision, robots, fields, cost and privacy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import msgspec
from nicegui import ui
from nicegui.element import Element
from nicegui.events import GenericEventArguments

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.widgets import everybody_button, number_field, put, refuse_last
from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.edits import with_rule
from robochoc.app.sketch.palette import Form, Links, PaletteRule, RuleField
from robochoc.app.sketch.rule_checks import why_no_cost, why_not_private
from robochoc.app.sketch.sentences import value_words
from robochoc.app.sketch.sketch import Decision, Setting, SketchRule, Value
from robochoc.app.sketch.troubles import Trouble
from robochoc.app.texts import say

_SLIDER = 20
"""The maximum of a slider, unless the current value is larger. Larger numbers are typed."""
_FIRST_COST = 1


class RuleForm:
    """The fields of a rule. Each change is an edit."""

    def __init__(self, desk: Desk, rule: str, entry: PaletteRule) -> None:
        self._desk, self._id, self._entry = desk, rule, entry
        self._following = False
        self._follow: list[Callable[[SketchRule, Decision], None]] = []
        with ui.element("div").classes("fields form"):
            self._about()
            self._robots()
            for opening in entry.openings:
                self._opening(opening)
            if not entry.graded:
                self._cost()
            self._private()
            with ui.element("div").classes("wide end"):
                ui.button(say("model.done"), icon="check", on_click=lambda: desk.open(None)).props("flat dense no-caps")

    def follow(self) -> None:
        """Update the form to the current sketch."""
        rule = self._desk.sketch.rule(self._id)
        decision = None if rule is None else self._desk.sketch.decision(rule.decision)
        if rule is not None and decision is not None:
            self._following = True  # from here, changes in fields are not made by the user
            for follow in self._follow:
                follow(rule, decision)
            self._following = False

    def _change(self, **changes: object) -> str | None:
        rule = self._desk.sketch.rule(self._id)
        if rule is None or self._following:
            return None
        made = msgspec.structs.replace(rule, **changes)
        if made == rule:
            return None
        return self._desk.edit(lambda sketch: with_rule(sketch, made))

    def _set(self, name: str, value: object) -> str | None:
        rule = self._desk.sketch.rule(self._id)
        return None if rule is None else self._change(settings={**rule.settings, name: value})

    def _about(self) -> None:
        def fitting() -> list[str]:
            return [one.name for one in self._desk.sketch.decisions if one.kind in self._entry.kinds]

        choice = ui.select([], label=say("model.about")).props("dense outlined").classes("wide")
        choice.on_value_change(lambda event: self._change(decision=event.value) if event.value else None)

        def follow(rule: SketchRule, _: Decision) -> None:
            names = fitting()
            choice.set_visibility(len(names) > 1)
            if rule.decision in names and (choice.options != names or choice.value != rule.decision):
                choice.set_options(names, value=rule.decision)

        self._follow.append(follow)

    def _robots(self) -> None:
        leads = self._entry.has_order and self._entry.links == Links.STAR
        key = "model.rule-robots-leader" if leads else "model.rule-robots"
        choice = ui.select([], multiple=True, label=say(key), with_input=True).classes("wide")
        choice.props(f'dense outlined use-chips hint="{say("model.rule-robots-hint")}"')
        everybody = everybody_button(lambda: self._change(robots=()))

        def changed(robots: tuple[str, ...]) -> None:
            rule = self._desk.sketch.rule(self._id)
            if rule is not None and rule.robots and not robots and not self._following:
                refuse_last(choice, rule.robots, say("edit.last-of-rule", robot=rule.robots[0]))
            else:
                self._change(robots=robots)

        choice.on_value_change(lambda event: changed(tuple(event.value or ())))

        def follow(rule: SketchRule, decision: Decision) -> None:
            everybody.set_visibility(bool(rule.robots))
            names = [*self._desk.sketch.deciders(decision)]
            chosen = [name for name in rule.robots if name in names]
            if choice.options != names or choice.value != chosen:
                choice.set_options(names, value=chosen)

        self._follow.append(follow)

    def _opening(self, opening: RuleField) -> None:
        match opening.form:
            case Form.NUMBER:
                self._number(opening)
            case Form.VALUE:
                self._values(opening, several=False)
            case Form.VALUES:
                self._values(opening, several=True)
            case Form.TABLE:
                self._table(opening)

    def _number(self, opening: RuleField) -> None:
        key = f"opening.{opening.name}"
        slider, field = _slider_and_field(key, opening.least, opening.most, partial(self._set, opening.name))

        def follow(rule: SketchRule, _: Decision) -> None:
            given = rule.settings.get(opening.name)
            if isinstance(given, int):
                _show_number(slider, field, given, opening.most)

        self._follow.append(follow)

    def _values(self, opening: RuleField, *, several: bool) -> None:
        label = say(f"opening.{opening.name}")
        choice = ui.select({}, label=label, multiple=several, with_input=True).classes("wide")
        choice.props("dense outlined use-chips" if several else "dense outlined")

        def changed(value: object) -> None:
            if value is not None:
                self._set(opening.name, [*value] if isinstance(value, list) else value)

        choice.on_value_change(lambda event: changed(event.value))

        def follow(rule: SketchRule, decision: Decision) -> None:
            sketch = self._desk.sketch
            options = {value: value_words(sketch, decision, value) for value in sketch.values(decision)}
            given: object = rule.settings.get(opening.name)
            if several:
                given = [one for one in given if one in options] if isinstance(given, list) else []
            elif not isinstance(given, (int, str)) or given not in options:
                given = None
            if choice.options != options or choice.value != given:
                choice.set_options(options, value=given)

        self._follow.append(follow)

    def _table(self, opening: RuleField) -> None:
        table = PairTable(lambda rows: self._set(opening.name, rows))

        def follow(rule: SketchRule, decision: Decision) -> None:
            sketch = self._desk.sketch
            words = [value_words(sketch, decision, value) for value in sketch.values(decision)]
            bound = (*sketch.bound(rule), "", "")[:2]
            table.show(sketch.values(decision), words, rule.settings.get(opening.name), bound)

        self._follow.append(follow)

    def _cost(self) -> None:
        with ui.element("div").classes("wide"):
            choice = ui.toggle({"must": say("model.must"), "cost": say("model.costs")}).props("no-caps unelevated")
            choice.classes("segments")
            why = ui.label().classes("soft small")
        choice.on_value_change(lambda event: self._costs_or_must(must=event.value == "must"))
        with ui.element("div").classes("wide fields") as box:
            slider, field = _slider_and_field("model.cost", 1, limits.MAX_COST, lambda value: self._change(cost=value))

        def follow(rule: SketchRule, _: Decision) -> None:
            choice.set_value("must" if rule.cost is None else "cost")
            off = why_no_cost(self._desk.sketch, rule) if rule.cost is None else None
            choice.set_enabled(off is None)
            _show_why(why, off)
            box.set_visibility(rule.cost is not None)
            if rule.cost is not None:
                _show_number(slider, field, rule.cost, limits.MAX_COST)

        self._follow.append(follow)

    def _costs_or_must(self, *, must: bool) -> None:
        rule = self._desk.sketch.rule(self._id)
        if rule is not None:
            self._change(cost=None if must else rule.cost or _FIRST_COST)

    def _private(self) -> None:
        with ui.element("div").classes("wide"):
            switch = ui.switch(say("model.private"), on_change=lambda event: self._change(private=bool(event.value)))
            ui.label(say("model.private-hint")).classes("soft small")
            why = ui.label().classes("small")

        def follow(rule: SketchRule, _: Decision) -> None:
            switch.set_value(rule.private)
            off = None if rule.private else why_not_private(self._desk.sketch, rule)
            switch.set_enabled(off is None)
            _show_why(why, off)

        self._follow.append(follow)


def _show_why(label: ui.label, off: Trouble | None) -> None:
    """Show why an option is unavailable, and the remedy. None: it is available."""
    label.set_text("" if off is None else f"{off.text} {off.remedy}")
    label.set_visibility(off is not None)


def _slider_and_field(
    key: str, least: int, most: int, changed: Callable[[int], str | None]
) -> tuple[ui.slider, ui.number]:
    """Add a slider, and a field in which larger numbers can be typed."""

    def released(value: object) -> None:
        if isinstance(value, int) and least <= value <= most:
            changed(value)

    slider = ui.slider(min=least, max=min(most, _SLIDER), step=1).props("label").classes("slide")
    slider.props["aria-label"] = say(key)
    slider.on("change", lambda event: released(event.args))  # sent when the slider is released: one edit
    field = number_field(key, least, most, changed)
    return slider, field


def _show_number(slider: ui.slider, field: ui.number, value: int, most: int) -> None:
    reach = min(most, max(_SLIDER, value))
    if slider.props.get("max") != reach:
        slider.props["max"] = reach
        slider.update()
    slider.set_value(value)
    put(field, value)


MOST_PAIRS = 20_000
"""The maximum number of pairs in a table."""
_PAIR = 2
_WORDS = ("caption", "many", "pair", "row", "column", "down", "across", "range", "back", "on")


class PairTable(Element, component="pair_table.js"):
    """A table of all pairs of values, in which each pair is a button.

    Args:
        changed: Called with the new rows after a click.
    """

    def __init__(self, changed: Callable[[list[list[Value]]], object]) -> None:
        super().__init__()
        self._values: tuple[Value, ...] = ()
        self._rows: list[list[Value]] = []
        self._changed = changed
        self.classes("wide")
        words = {name: say(f"pairs.{name}") for name in _WORDS}
        self._props |= {"labels": [], "on": [], "count": 0, "one": "", "other": "", "words": words, "wrong": ""}
        self.on("filled", self._filled)

    def show(self, values: tuple[Value, ...], labels: list[str], rows: Setting | None, bound: tuple[str, ...]) -> None:
        """Show the rows."""
        self._values = values
        self._rows = [[*row] for row in rows if isinstance(row, list)] if isinstance(rows, list) else []
        number = {value: index for index, value in enumerate(values)}
        fitting = [row for row in self._rows if len(row) == len(bound) and all(value in number for value in row)]
        shown = {
            "labels": labels,
            "on": [number[row[0]] * len(values) + number[row[1]] for row in fitting],
            "count": len(values),
            "one": bound[0],
            "other": bound[1],
            "wrong": "",
        }
        if any(self._props.get(name) != value for name, value in shown.items()):
            self._props |= shown
            self.update()

    def _filled(self, event: GenericEventArguments) -> None:
        try:
            top, left, bottom, right, on = msgspec.convert(event.args, tuple[int, int, int, int, bool])
        except msgspec.ValidationError:
            return  # not sent by our table
        count = len(self._values)
        if not (0 <= top <= bottom < count and 0 <= left <= right < count):
            return
        if (bottom - top + 1) * (right - left + 1) > MOST_PAIRS:
            self._refuse()
            return
        rows = filled(self._rows, self._values[top : bottom + 1], self._values[left : right + 1], on=on)
        if on and len(rows) > MOST_PAIRS:
            self._refuse()
        else:
            self._changed(rows)

    def _refuse(self) -> None:
        self._props["wrong"] = say("pairs.too-many", most=f"{MOST_PAIRS:,}")
        self.update()


def filled(
    rows: list[list[Value]], ones: tuple[Value, ...], others: tuple[Value, ...], *, on: bool
) -> list[list[Value]]:
    """Return the rows of a table after adding or removing all pairs of `ones` and `others`."""
    if not on:
        some, more = {*ones}, {*others}
        return [row for row in rows if not (len(row) == _PAIR and row[0] in some and row[1] in more)]
    there = {tuple(row) for row in rows}
    return rows + [[one, other] for one in ones for other in others if (one, other) not in there]
