"""A table of allowed pairs of values of two robots, chosen by clicks and drawn in the browser."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
from nicegui.element import Element
from nicegui.events import GenericEventArguments

from robochoc.app.sketch.sketch import Setting, Value
from robochoc.app.texts import say

MOST_PAIRS = 20_000
"""The maximum number of pairs of a table."""
_PAIR = 2
_WORDS = ("caption", "many", "pair", "row", "column", "down", "across", "range", "back", "on")


class PairTable(Element, component="pair_table.js"):
    """Values by values, each a button.

    Args:
        changed: Called with the new rows.
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
            return  # not from our table
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
    """Return the rows of a table after adding, or removing, all pairs of `ones` and `others`."""
    if not on:
        some, more = {*ones}, {*others}
        return [row for row in rows if not (len(row) == _PAIR and row[0] in some and row[1] in more)]
    there = {tuple(row) for row in rows}
    return rows + [[one, other] for one in ones for other in others if (one, other) not in there]
