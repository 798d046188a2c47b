"""A table that is clicked together: which values of one robot go with which of another. Drawn in the browser."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
from nicegui.element import Element
from nicegui.events import GenericEventArguments

from robochoc.app.sketch.sketch import Setting, Value
from robochoc.app.texts import say

MOST = 40
"""Values of a table that can be clicked."""


class PairTable(Element, component="pair_table.js"):
    """Values by values, each a button.

    Args:
        changed: Is called with the rows that fit then.
    """

    def __init__(self, changed: Callable[[list[list[Value]]], object]) -> None:
        super().__init__()
        self._values: tuple[Value, ...] = ()
        self._rows: list[list[Value]] = []
        self._changed = changed
        self.classes("wide")
        self._props |= {"labels": [], "on": [], "one": "", "other": "", "words": _words(), "large": ""}
        self.on("toggled", self._toggled)

    def show(self, values: tuple[Value, ...], labels: list[str], rows: Setting | None, bound: tuple[str, ...]) -> None:
        """Show the table as it stands."""
        self._values = values
        self._rows = [[*row] for row in rows if isinstance(row, list)] if isinstance(rows, list) else []
        number = {value: index for index, value in enumerate(values)}
        fitting = [row for row in self._rows if len(row) == len(bound) and all(value in number for value in row)]
        shown = {
            "labels": labels[:MOST],
            "on": [number[row[0]] * len(values) + number[row[1]] for row in fitting],
            "count": len(values),
            "one": bound[0],
            "other": bound[1],
            "large": say("model.table-large", most=MOST) if len(values) > MOST else "",
        }
        if any(self._props.get(name) != value for name, value in shown.items()):
            self._props |= shown
            self.update()

    def _toggled(self, event: GenericEventArguments) -> None:
        try:
            one, other = msgspec.convert(event.args, tuple[int, int])
            pair = [self._values[one], self._values[other]]
        except (msgspec.ValidationError, IndexError):
            return  # not from our table
        kept = [row for row in self._rows if row != pair]
        self._changed(kept if len(kept) < len(self._rows) else [*self._rows, pair])


def _words() -> dict[str, str]:
    return {name: say(f"pairs.{name}") for name in ("caption", "pair")}
