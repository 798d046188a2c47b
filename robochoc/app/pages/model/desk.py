"""The state shared by the panels of the page "Model": the team, the selection, the open rule, and edits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

from robochoc.app.listeners import Listeners
from robochoc.app.pages.shell import edit_error_text
from robochoc.app.projects import Project
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import DecisionKind, Sketch
from robochoc.app.sketch.troubles import About, Trouble
from robochoc.system.lazy_dataclass import dataclass

Edit = Callable[[Sketch], Sketch]


def _quiet(_: str) -> None:
    pass


def _still() -> None:
    pass


@dataclass
class Desk:
    """The state of the page in one browser tab.

    Attributes:
        project: The team.
        selected: The selected robots, in the order of their selection.
        just_added: The robot that is selected only because it was just added, for naming. New rules ignore it.
        opened: The rule being edited. A click on a robot adds it to the rule or removes it.
        cells_of: The name of the decision whose cells the user selects on the map.
        pointed: The rule under the pointer in the list.
        troubles: The errors and hints found so far.
        show_error: Shows an error that belongs to no field.
        point: Called when the rule under the pointer in the list changes.
    """

    project: Project
    selected: list[str] = field(default_factory=list)
    just_added: str | None = None
    opened: str | None = None
    cells_of: str | None = None
    pointed: str | None = None
    troubles: list[Trouble] = field(default_factory=list)
    show_error: Callable[[str], None] = _quiet
    point: Callable[[], None] = _still
    _listeners: Listeners = field(default_factory=Listeners)

    @property
    def sketch(self) -> Sketch:
        """The current state of the team."""
        return self.project.sketch

    def on_view_change(self, callback: Callable[[], None]) -> None:
        """Call `callback` after a change in the selection or the open rule that does not change the team."""
        self._listeners.add(callback)

    def notify_view_change(self) -> None:
        """Update all panels after a change in the selection, the open rule, or the pointer."""
        self._listeners()

    def edit(self, change: Edit) -> str | None:
        """Change the team. Return the error text for the field if the edit is invalid, otherwise None."""
        try:
            self.project.edit(change)
        except EditError as error:
            return edit_error_text(error)
        return None

    def try_edit(self, change: Edit) -> bool:
        """Change the team, and show an error below the map. Return whether the edit was valid."""
        wrong = self.edit(change)
        self.show_error(wrong or "")
        return wrong is None

    def select(self, names: list[str]) -> None:
        """Select those of these robots that (still) exist."""
        known = {robot.name for robot in self.sketch.robots}
        self.selected = [name for name in dict.fromkeys(names) if name in known]
        self.just_added = None
        self.notify_view_change()

    def select_added(self, name: str) -> None:
        """Select a robot that was just added."""
        self.select([name])
        self.just_added = name

    @property
    def rule_robots(self) -> list[str]:
        """The robots in a new rule. Empty: all robots."""
        return [] if self.just_added else self.selected

    def open(self, rule: str | None) -> None:
        """Open a rule for editing, or close it if `rule` is None."""
        self.opened, self.cells_of = rule, None
        self.notify_view_change()

    def drop_removed(self) -> None:
        """Remove elements that no longer exist from the selection and the open rule."""
        known = {robot.name for robot in self.sketch.robots}
        self.selected = [name for name in self.selected if name in known]
        if self.opened is not None and self.sketch.rule(self.opened) is None:
            self.opened = None
        decision = None if self.cells_of is None else self.sketch.decision(self.cells_of)
        if decision is None or decision.kind != DecisionKind.PLACE:
            self.cells_of = None
        if self.just_added not in self.selected:
            self.just_added = None

    def troubles_at(self, about: About, element: str) -> list[Trouble]:
        """Return the errors and hints for an element."""
        return [trouble for trouble in self.troubles if trouble.about is about and trouble.element == element]
