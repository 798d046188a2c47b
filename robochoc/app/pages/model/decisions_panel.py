"""The panel "What does each decide?": a card for each decision, and buttons for adding decisions."""

from __future__ import annotations

from functools import partial

import msgspec
from nicegui import ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.model.values import first_values, free_decision_name, typed_values, written_values
from robochoc.app.pages.shell import edit_error_text
from robochoc.app.pages.widgets import (
    Cards,
    TroubleLines,
    everybody_button,
    icon_button,
    name_it,
    panel,
    put,
    refuse_last,
)
from robochoc.app.sketch.edits import EditError, with_decision, without_decision
from robochoc.app.sketch.sketch import NUMBERED, Decision, DecisionKind, Sketch
from robochoc.app.sketch.troubles import About
from robochoc.app.texts import say

ICONS = {
    DecisionKind.LEVEL: "height",
    DecisionKind.PLACE: "place",
    DecisionKind.SLOT: "schedule",
    DecisionKind.CHANNEL: "wifi",
    DecisionKind.TASK: "task_alt",
    DecisionKind.CHOICE: "tune",
}


class DecisionsPanel:
    """The decisions of the robots."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        with panel("model.decisions"):
            self._hint = ui.label(say("model.decisions-hint")).classes("soft")
            with ui.element("div").classes("stack") as box:
                self._cards = Cards(box, partial(_DecisionCard, desk))
            with ui.element("div").classes("adders").props(f'role=group aria-label="{say("model.add-decision")}"'):
                for kind in DecisionKind:
                    button = ui.button(say(f"kind.{kind}"), icon=ICONS[kind], on_click=partial(self._add, kind))
                    button.props("outline dense no-caps").classes("adder")
                    name_it(button, say("model.add-kind", kind=say(f"kind.{kind}")))

    def follow(self) -> None:
        """Update the panel to the current sketch."""
        decisions = self._desk.sketch.decisions
        self._hint.set_visibility(not decisions)
        self._cards.follow([(place, decision.kind) for place, decision in enumerate(decisions)])

    def _add(self, kind: DecisionKind) -> None:
        sketch = self._desk.sketch
        name = free_decision_name(sketch, kind.value)
        values = first_values(sketch, kind, say("model.first-names"))
        self._desk.try_edit(lambda sketch: with_decision(sketch, Decision(name, kind, values)))


class _DecisionCard:
    """A decision: its name, values and robots."""

    def __init__(self, desk: Desk, key: tuple[int, DecisionKind]) -> None:
        self._desk, (self._place, self._kind) = desk, key
        self._following = False
        with ui.element("article").classes("entry") as self.element:
            with ui.element("div").classes("entry-head"):
                ui.icon(ICONS[self._kind]).props("aria-hidden=true").classes("kind")
                self._title = ui.label().classes("grow strong")
                self._remove = icon_button("close", "", self._removed)
            with ui.element("div").classes("fields"):
                self._name = ui.input(say("model.decision-name"), validation=self._rename)
                self._name.props("dense outlined debounce=500 maxlength=60").classes("half")
                self._who = ui.select([], multiple=True, label=say("model.who"), with_input=True)
                self._who.props(f'dense outlined use-chips hint="{say("model.who-hint")}"').classes("half")
                self._who.on_value_change(lambda event: self._decided_by(tuple(event.value or ())))
                self._everybody = everybody_button(lambda: self._change(robots=()))
                self._values: ui.input | None = None
                self._cells: ui.switch | None = None
                if self._kind == DecisionKind.PLACE:
                    self._about_cells()
                else:
                    self._values = ui.input(say("model.values"), validation=self._given)
                    hint = say("model.values-numbers" if self._kind in NUMBERED else "model.values-names")
                    self._values.props(f'dense outlined debounce=500 hint="{hint}"').classes("wide")
            self._lines = TroubleLines()

    def follow(self) -> None:
        """Update the card to the current sketch."""
        decision = self._decision
        if decision is not None:
            self._following = True  # from here, changes in fields are not made by the user
            self._show(self._desk.sketch, decision)
            self._following = False

    def _show(self, sketch: Sketch, decision: Decision) -> None:
        self._title.set_text(say("model.decision-title", kind=say(f"kind.{self._kind}"), name=decision.name))
        name_it(self._remove, say("model.remove", name=decision.name))
        put(self._name, decision.name)
        names = [robot.name for robot in sketch.robots]
        chosen = [name for name in decision.robots if name in names]
        if self._who.options != names or self._who.value != chosen:
            self._who.set_options(names, value=chosen)
        self._everybody.set_visibility(bool(decision.robots))
        if self._values is not None and not self._values.error and not self._same(self._values.value, decision):
            self._values.set_value(written_values(decision.values))
        if self._cells is not None:
            self._cells.set_value(self._desk.cells_of == decision.name)
            self._all_cells.set_visibility(bool(decision.values))
            count, free = len(sketch.values(decision)), len(sketch.area.free)
            known = say("model.all-cells", count=free) if not decision.values else say("model.some-cells", count=count)
            self._known.set_text(known)
        self._lines.show(self._desk.troubles_at(About.DECISION, decision.name))

    @property
    def _decision(self) -> Decision | None:
        decisions = self._desk.sketch.decisions
        return decisions[self._place] if self._place < len(decisions) else None

    def _about_cells(self) -> None:
        with ui.element("div").classes("wide"):
            self._known = ui.label().classes("soft")
            self._cells = ui.switch(say("model.click-cells"), on_change=lambda event: self._click_cells(event.value))
            self._all_cells = ui.button(say("model.take-all-cells"), on_click=lambda: self._change(values=()))
            self._all_cells.props("flat dense no-caps")

    def _click_cells(self, on: bool) -> None:  # noqa: FBT001 - a switch's value
        decision = self._decision
        if decision is not None and (self._desk.cells_of == decision.name) is not on:
            self._desk.cells_of = decision.name if on else None
            self._desk.opened = None if on else self._desk.opened
            self._desk.notify_view_change()

    def _same(self, text: str | None, decision: Decision) -> bool:
        try:
            return typed_values(self._kind, text or "") == decision.values
        except EditError:
            return False

    def _rename(self, value: str | None) -> str | None:
        return self._change(name=(value or "").strip())

    def _given(self, value: str | None) -> str | None:
        try:
            values = typed_values(self._kind, value or "")
        except EditError as error:
            return edit_error_text(error)
        return self._change(values=values)

    def _decided_by(self, robots: tuple[str, ...]) -> None:
        decision = self._decision
        if not robots and decision is not None and decision.robots and not self._following:
            refuse_last(self._who, decision.robots, say("edit.last-decider"))
            return
        everybody = len(robots) == len(self._desk.sketch.robots)
        self._change(robots=() if everybody else robots)

    def _change(self, **changes: object) -> str | None:
        decision = self._decision
        if decision is None or self._following:
            return None
        made = msgspec.structs.replace(decision, **changes)
        if made == decision:
            return None
        clicked = self._desk.cells_of
        if clicked == decision.name:
            self._desk.cells_of = made.name  # the user continues selecting cells, under the new name
        wrong = self._desk.edit(lambda sketch: with_decision(sketch, made, instead_of=decision.name))
        if wrong is not None:
            self._desk.cells_of = clicked
        return wrong

    def _removed(self) -> None:
        decision = self._decision
        if decision is not None:
            self._desk.try_edit(lambda sketch: without_decision(sketch, decision.name))
