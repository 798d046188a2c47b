"""The fields for the size of the map."""

from __future__ import annotations

from nicegui import ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.model.parts import number_field, put
from robochoc.app.pages.shell import on_leave
from robochoc.app.sketch.edits import with_area
from robochoc.app.sketch.sketch import MAX_SIDE
from robochoc.app.texts import say


class MapFields:
    """The columns and rows of the map."""

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
