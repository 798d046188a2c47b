"""The board: the map of a team, its robots, and its rules as links, drawn in the browser (`board.js`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Annotated

import msgspec
from nicegui.element import Element
from nicegui.events import GenericEventArguments

from robochoc.app.pages.model.picture import DrawnLink, DrawnRobot, robots_of
from robochoc.app.sketch.sketch import Area, Cell, Sketch
from robochoc.app.texts import say
from robochoc.system.lazy_dataclass import dataclass

SELECT = "select"
"""The tool for selecting and dragging. Other tools highlight the cell under the pointer."""

MOST_MOVES = 2**53


class RobotClicked(msgspec.Struct):
    """A click on a robot. `more`: whether the selection is extended."""

    name: str
    more: bool = False


class BoardAction(msgspec.Struct):
    """An action selected at a robot (`name`) or at a cell."""

    act: str
    name: str = ""
    x: int = 0
    y: int = 0


class RobotDragged(msgspec.Struct):
    """A robot dragged to a cell. `sent`: the number of moves sent by this tab."""

    name: str
    x: int
    y: int
    sent: Annotated[int, msgspec.Meta(ge=0, le=MOST_MOVES)] = 0


def _nothing(*_: object) -> None:
    pass


@dataclass
class BoardEvents:
    """The handlers for a board's events, which the page defines."""

    robot: Callable[[RobotClicked], object] = _nothing
    cell: Callable[[Cell], object] = _nothing
    moved: Callable[[RobotDragged], object] = _nothing
    removed: Callable[[str], object] = _nothing
    rule: Callable[[str], object] = _nothing
    cleared: Callable[[], object] = _nothing
    act: Callable[[BoardAction], object] = _nothing
    types: dict[str, type] = field(
        default_factory=lambda: {
            "robot": RobotClicked,
            "cell": Cell,
            "moved": RobotDragged,
            "removed": str,
            "rule": str,
            "act": BoardAction,
        }
    )


class Board(Element, component="board.js"):
    """The map of a team.

    Args:
        events: The handlers for clicks, drags and keys.
        movable: True if robots can be moved, by dragging or with the arrow keys.
    """

    def __init__(self, events: BoardEvents, *, movable: bool = True) -> None:
        super().__init__()
        self._events = events
        self._props |= {"columns": 1, "rows": 1, "blocked": [], "robots": [], "links": [], "selected": []}
        self._props |= {"lit": "", "tool": SELECT, "words": _words(), "movable": movable, "heard": 0}
        for name in events.types:
            self.on(name, lambda event, name=name: self._handle(name, event))
        self._props["acts"] = {}
        self.on("cleared", lambda _: events.cleared())

    def show(
        self, sketch: Sketch, *, robots: list[DrawnRobot] | None = None, links: list[DrawnLink] | None = None
    ) -> None:
        """Draw a sketch. Without `links`, the links are not changed."""
        self._set_area(sketch.area)
        self._set("robots", robots_of(sketch) if robots is None else robots)
        if links is not None:
            self._set("links", links)
        self.update()

    def set_menus(self, robot: dict[str, str], cell: dict[str, str]) -> None:
        """Set the actions in the menus of robots and cells: action names and their texts."""
        self._change("acts", {"robot": [*robot.items()], "cell": [*cell.items()]})

    def choose(self, names: list[str]) -> None:
        """Show these robots as selected."""
        self._change("selected", names)

    def light(self, rule: str | None) -> None:
        """Highlight one rule with its text, and dim all others."""
        self._change("lit", rule or "")

    def use(self, tool: str) -> None:
        """Show the current tool."""
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

    def _handle(self, name: str, event: GenericEventArguments) -> None:
        try:
            given: object = msgspec.convert(event.args, self._events.types[name])
        except msgspec.ValidationError:
            return  # not sent by our board
        if isinstance(given, RobotDragged):  # the board keeps moves that this does not confirm
            self._change("heard", given.sent)
        getattr(self._events, name)(given)


def _words() -> dict[str, str]:
    return {name: say(f"board.{name}") for name in ("map", "north", "cell", "hole", "past", "begin")}
