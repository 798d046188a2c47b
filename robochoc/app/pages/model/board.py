"""The board: the map of a team, its robots, and its rules as links. It is drawn in the browser (`board.js`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

import msgspec
from nicegui.element import Element
from nicegui.events import GenericEventArguments

from robochoc.app.pages.model.picture import DrawnLink, DrawnRobot, robots_of
from robochoc.app.sketch.sketch import Area, Cell, Sketch
from robochoc.app.texts import say

SELECT = "select"
"""The tool of a board that only looks, picks and drags. With others, the cell under the pointer is shown."""

MOST_MOVES = 2**53


class Clicked(msgspec.Struct):
    """A robot that was clicked; `more`: together with those that are selected."""

    name: str
    more: bool = False


class Act(msgspec.Struct):
    """Something that was chosen at a robot (`name`), or at a cell."""

    act: str
    name: str = ""
    x: int = 0
    y: int = 0


class Moved(msgspec.Struct):
    """A robot that was dragged to a cell. `sent`: how many moves of this tab there were by then."""

    name: str
    x: int
    y: int
    sent: Annotated[int, msgspec.Meta(ge=0, le=MOST_MOVES)] = 0


def _nothing(*_: object) -> None:
    pass


@dataclass
class Told:
    """What a board tells: who was clicked, which cell, what was dragged where. The page decides what that means."""

    robot: Callable[[Clicked], object] = _nothing
    cell: Callable[[Cell], object] = _nothing
    moved: Callable[[Moved], object] = _nothing
    removed: Callable[[str], object] = _nothing
    rule: Callable[[str], object] = _nothing
    cleared: Callable[[], object] = _nothing
    act: Callable[[Act], object] = _nothing
    types: dict[str, type] = field(
        default_factory=lambda: {
            "robot": Clicked,
            "cell": Cell,
            "moved": Moved,
            "removed": str,
            "rule": str,
            "act": Act,
        }
    )


class Board(Element, component="board.js"):
    """The map of a team.

    Args:
        told: What is called when something is clicked, dragged, or typed.
        movable: Whether robots can be dragged, and moved by the arrow keys.
    """

    def __init__(self, told: Told, *, movable: bool = True) -> None:
        super().__init__()
        self._told = told
        self._props |= {"columns": 1, "rows": 1, "blocked": [], "robots": [], "links": [], "selected": []}
        self._props |= {"lit": "", "tool": SELECT, "words": _words(), "movable": movable, "heard": 0}
        for name in told.types:
            self.on(name, lambda event, name=name: self._hear(name, event))
        self._props["acts"] = {}
        self.on("cleared", lambda _: told.cleared())

    def show(
        self, sketch: Sketch, *, robots: list[DrawnRobot] | None = None, links: list[DrawnLink] | None = None
    ) -> None:
        """Draw a sketch. Links that are not given stay as they are."""
        self._set_area(sketch.area)
        self._set("robots", robots_of(sketch) if robots is None else robots)
        if links is not None:
            self._set("links", links)
        self.update()

    def offer(self, robot: dict[str, str], cell: dict[str, str]) -> None:
        """Offer what can happen to a robot, or to a cell, that is clicked: names of acts, and their words."""
        self._change("acts", {"robot": [*robot.items()], "cell": [*cell.items()]})

    def choose(self, names: list[str]) -> None:
        """Show these robots as selected."""
        self._change("selected", names)

    def light(self, rule: str | None) -> None:
        """Show one rule with its words; others step back."""
        self._change("lit", rule or "")

    def use(self, tool: str) -> None:
        """Show which tool is used."""
        self._change("tool", tool)

    def _set_area(self, area: Area) -> None:
        self._set("columns", area.columns)
        self._set("rows", area.rows)
        self._set("blocked", [[cell.x, cell.y] for cell in sorted(area.blocked)])

    def _change(self, name: str, value: object) -> None:
        if self._props.get(name) != value:
            self._set(name, value)
            self.update()

    def _set(self, name: str, value: object) -> None:
        self._props[name] = value

    def _hear(self, name: str, event: GenericEventArguments) -> None:
        try:
            given: object = msgspec.convert(event.args, self._told.types[name])
        except msgspec.ValidationError:
            return  # not from our board
        if isinstance(given, Moved):  # the board keeps moves that it has not been told of so
            self._change("heard", given.sent)
        getattr(self._told, name)(given)


def _words() -> dict[str, str]:
    return {name: say(f"board.{name}") for name in ("map", "north", "cell", "hole", "past", "begin")}
