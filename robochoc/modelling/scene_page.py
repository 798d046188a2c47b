"""The scene of a solution, as a separate page or in a notebook."""

from __future__ import annotations

from pathlib import Path

from robochoc.flight.mission import mission_of
from robochoc.flight.preview import preview_of
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.modelling.solution_html import framed
from robochoc.view.page import scene_page
from robochoc.view.scene import scene_of


class ScenePage:
    """A scene in which the drones fly to the positions that the team decided. Notebooks display it.

    Attributes:
        html: The self-contained page.
        height: The height of the scene in a notebook, in pixels.
    """

    def __init__(self, outcome: Outcome, team: Team | None, *, height: int = 520) -> None:
        """Simulate the flight of an outcome in calm air, and draw it.

        Args:
            outcome: The outcome.
            team: The team before its scenario.
            height: The height in a notebook, in pixels.
        """
        preview = preview_of(mission_of(outcome, team))
        weighted = None if team is None else any(robot.weight != 1 for robot in team.robots)
        scene = scene_of(
            outcome,
            mission_of(outcome, team),
            preview.flown,
            flown_mission=preview.mission,
            why_not=preview.why_not,
            weighted=weighted,
        )
        self.html = scene_page(scene).decode()
        self.height = height
        self._title = scene.title

    def save(self, path: Path | str) -> None:
        """Write the page to a file."""
        Path(path).write_text(self.html, encoding="utf-8")

    def __repr__(self) -> str:
        return f"<scene of {self._title}>"

    def _repr_html_(self) -> str:
        return framed(self.html, self.height)
