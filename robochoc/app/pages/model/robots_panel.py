"""The panel for robots: the selection, and the names, weights and ranks of the selected robots."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.widgets import Cards, TroubleLines, number_field, panel, put
from robochoc.app.sketch.edits import with_importance, with_robot_renamed, without_robot
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.troubles import About
from robochoc.app.texts import say
from robochoc.formats.names import MAX_WEIGHT


class RobotsPanel:
    """The list in which robots are selected, and the fields of the selected robots."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        with panel("model.robots"):
            self._choice = ui.select([], multiple=True, label=say("model.selected"), with_input=True)
            self._choice.props("dense outlined use-chips").classes("wide")
            self._choice.on_value_change(lambda event: self._selected([*(event.value or [])]))
            self._hint = ui.label(say("model.selected-hint")).classes("soft")
            with ui.element("div") as box:
                self._cards = Cards(box, partial(_SelectedCard, desk))

    def follow(self) -> None:
        """Update the panel to the current sketch."""
        sketch, selected = self._desk.sketch, self._desk.selected
        names = [robot.name for robot in sketch.robots]
        if self._choice.options != names or self._choice.value != selected:
            self._choice.set_options(names, value=[*selected])
        self._choice.set_visibility(bool(names))
        self._hint.set_text(say("model.selected-hint" if names else "model.no-robots-hint"))
        self._hint.set_visibility(not selected)
        # Keys are indices, so that a robot that is being renamed keeps its card.
        self._cards.follow([tuple(map(names.index, selected))] if selected else [])

    def _selected(self, names: list[str]) -> None:
        if names != self._desk.selected:
            self._desk.select(names)


class _SelectedCard:
    """The fields of the selected robots."""

    def __init__(self, desk: Desk, places: tuple[int, ...]) -> None:
        self._desk = desk
        with ui.element("div").classes("fields") as self.element:
            self._name = self._name_field() if len(places) == 1 else None
            self._weight = number_field("model.weight", 1, MAX_WEIGHT, partial(self._set, "weight"))
            self._weight.props(f'hint="{say("model.weight-hint")}"').classes("half")
            self._rank = number_field("model.rank", -MAX_WEIGHT, MAX_WEIGHT, partial(self._set, "rank"))
            self._rank.props(f'hint="{say("model.rank-hint")}"').classes("half")
            self._lines = TroubleLines()
            with ui.element("div").classes("wide end"):
                remove = ui.button(say("model.remove-robots"), icon="delete_outline", on_click=self._remove)
                remove.props("flat dense no-caps").classes("quiet")

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(self._desk.selected)

    def follow(self) -> None:
        """Update the card to the current sketch."""
        robots = [robot for robot in self._desk.sketch.robots if robot.name in self._names]
        if not robots:
            return
        if self._name is not None:
            put(self._name, robots[0].name)
        for field, values in (
            (self._weight, {robot.weight for robot in robots}),
            (self._rank, {robot.rank for robot in robots}),
        ):
            if len(values) == 1:
                put(field, values.pop())
        self._lines.show([one for name in self._names for one in self._desk.troubles_at(About.ROBOT, name)][:3])

    def _name_field(self) -> ui.input:
        field = ui.input(say("model.robot-name"), validation=self._rename)
        return field.props("dense outlined debounce=700 maxlength=60").classes("wide")

    def _rename(self, value: str | None) -> str | None:
        (old,), new = self._names, (value or "").strip()
        if new == old:
            return None
        added = self._desk.just_added
        self._desk.selected = [new]  # before the edit, so that the robot remains selected and keeps its card
        self._desk.just_added = None if added is None else new
        wrong = self._desk.edit(lambda sketch: with_robot_renamed(sketch, old, new))
        if wrong is not None:
            self._desk.selected, self._desk.just_added = [old], added
        return wrong

    def _set(self, what: str, value: int) -> str | None:
        def change(sketch: Sketch) -> Sketch:
            for name in self._names:
                sketch = with_importance(sketch, name, **{what: value})
            return sketch

        return self._desk.edit(change)

    def _remove(self) -> None:
        names = self._names
        self._desk.try_edit(lambda sketch: without_robots(sketch, names))


def without_robots(sketch: Sketch, names: tuple[str, ...]) -> Sketch:
    """Remove several robots in one edit."""
    for name in names:
        sketch = without_robot(sketch, name)
    return sketch
