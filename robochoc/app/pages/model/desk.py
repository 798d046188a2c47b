"""What the parts of the page "Model" share: the team, who is selected, which rule is open, and how edits are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from robochoc.app.listeners import Listeners
from robochoc.app.pages.shell import edit_error_text
from robochoc.app.projects import Project
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import Kind, Sketch
from robochoc.app.sketch.troubles import About, Trouble

Edit = Callable[[Sketch], Sketch]


def _quiet(_: str) -> None:
    pass


def _still() -> None:
    pass


@dataclass
class Desk:
    """One page that shows a team: tabs of the same team have a desk each.

    Attributes:
        project: The team.
        selected: The robots that are selected, in the order in which they were.
        just_added: The robot that is selected since it was added, so that it can be named. Rules are not meant for it.
        opened: The rule whose parts are shown, to be changed. Robots that are clicked go into it, or out of it.
        cells_of: The decision about places whose cells are clicked together on the map, by its name.
        pointed: The rule that somebody points at in the list.
        troubles: What is wrong, as far as it was looked at.
        tell: Tells what could not be done, where no field is near it.
        point: Is called when somebody points at another rule in the list.
    """

    project: Project
    selected: list[str] = field(default_factory=list)
    just_added: str | None = None
    opened: str | None = None
    cells_of: str | None = None
    pointed: str | None = None
    troubles: list[Trouble] = field(default_factory=list)
    tell: Callable[[str], None] = _quiet
    point: Callable[[], None] = _still
    _listeners: Listeners = field(default_factory=Listeners)

    @property
    def sketch(self) -> Sketch:
        """The team as it stands."""
        return self.project.sketch

    def on_look(self, callback: Callable[[], None]) -> None:
        """Call `callback` when something is selected or opened: what is shown changes, the team does not."""
        self._listeners.add(callback)

    def looked(self) -> None:
        """Let all parts show what is selected, opened, or pointed at."""
        self._listeners()

    def edit(self, change: Edit) -> str | None:
        """Change the team. Return what is wrong with that, in words, for the field where it was asked for."""
        try:
            self.project.edit(change)
        except EditError as error:
            return edit_error_text(error)
        return None

    def do(self, change: Edit) -> bool:
        """Change the team, and tell below the map if that cannot be. Return whether it could."""
        wrong = self.edit(change)
        self.tell(wrong or "")
        return wrong is None

    def select(self, names: list[str]) -> None:
        """Select these robots: those of them that are (still) there."""
        known = {robot.name for robot in self.sketch.robots}
        self.selected = [name for name in dict.fromkeys(names) if name in known]
        self.just_added = None
        self.looked()

    def select_added(self, name: str) -> None:
        """Select a robot that was just added."""
        self.select([name])
        self.just_added = name

    @property
    def meant(self) -> list[str]:
        """The robots that a new rule is for. Empty: all of them."""
        return [] if self.just_added else self.selected

    def open(self, rule: str | None) -> None:
        """Show the parts of a rule, or of none."""
        self.opened, self.cells_of = rule, None
        self.looked()

    def forget_gone(self) -> None:
        """Let go of what is no longer there."""
        known = {robot.name for robot in self.sketch.robots}
        self.selected = [name for name in self.selected if name in known]
        if self.opened is not None and self.sketch.rule(self.opened) is None:
            self.opened = None
        decision = None if self.cells_of is None else self.sketch.decision(self.cells_of)
        if decision is None or decision.kind != Kind.PLACE:
            self.cells_of = None
        if self.just_added not in self.selected:
            self.just_added = None

    def troubles_at(self, about: About, element: str) -> list[Trouble]:
        """Return what is wrong with an element."""
        return [trouble for trouble in self.troubles if trouble.about is about and trouble.element == element]
