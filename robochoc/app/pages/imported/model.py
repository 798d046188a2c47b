"""The page "Model" of an imported team, which shows its files."""

from __future__ import annotations

import shlex
from functools import cache
from importlib.resources import files
from pathlib import Path

from nicegui import run, ui

from robochoc.app.flights.saved_state import file_name, files_archive
from robochoc.app.imported.facts import ImportedFacts, RobotFacts
from robochoc.app.imported.robot_file import ShownRobotFile, read_robot_file
from robochoc.app.projects import Project
from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.thumbnail import MAX_LINES, thumbnail
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError

_MOST_NAMED = 8
_MOST_DECISIONS = 40
_PYTHON = """import robochoc

model = robochoc.Model.load({folder!r})
solution = model.solve()
print(solution)"""


def build_imported_model(project: Project) -> None:
    """Fill the current container with the page."""
    folder = project.import_folder
    assert folder is not None, "the team has files"  # noqa: S101
    ui.add_css(style())
    facts = project.facts
    with ui.element("h1"):
        ui.label(project.sketch.name)
    with ui.element("div").classes("imported"):
        with ui.element("div").classes("imported-part"):
            _why(project, facts, folder)
            if facts.events:
                _events(facts)
            with ui.element("section").classes("panel imported-part"):
                _elsewhere(folder)
        with ui.element("section").classes("panel imported-part"):
            _heading("imported.team")
            ui.label(counts(facts))
            links = facts.links if facts.linked <= MAX_LINES else ()  # too many links are not readable
            ui.html(thumbnail(project.sketch, links), sanitize=False).classes("imported-picture")
        with ui.element("section").classes("panel imported-part"):
            _RobotViewer(project, facts, folder)


def counts(facts: ImportedFacts) -> str:
    """Return the size and objective of a team in a few sentences."""
    told = [
        say(
            "imported.counts",
            robots=f"{len(facts.there):,}",
            variables=f"{facts.variables:,}",
            constraints=f"{facts.constraints:,}",
            links=f"{facts.linked:,}",
        )
    ]
    if facts.objectives:
        each = "imported.sum-each-most" if facts.maximised else "imported.sum-each"
        told.append(say(each, names=listed(facts.objectives)))
    elif facts.costs:
        told.append(say("imported.sum-most" if facts.maximised else "imported.sum-least"))
    else:
        told.append(say("imported.all-hold"))
    if facts.private:
        told.append(say("imported.alone", count=f"{facts.private:,}"))
    if facts.partial:
        told.append(say("imported.partial", count=f"{facts.partial:,}"))
    return " ".join(told)


def _why(project: Project, facts: ImportedFacts, folder: Path) -> None:
    with ui.element("section").classes("panel imported-part"):
        _heading("imported.why")
        if facts.files:
            ui.label(say("imported.changed", files=listed(facts.files, _MOST_NAMED)))
        else:
            ui.label(say("imported.from", origin=facts.origin) if facts.origin else say("imported.from-files"))
        if facts.notes:
            ui.label(say("imported.notes"))
            with ui.element("ul").classes("imported-notes"):
                for note in facts.notes:
                    with ui.element("li"):
                        ui.label(note)
        ui.label(say("imported.can")).classes("soft")
        with ui.element("div").classes("imported-row"):
            ui.link(say("imported.to-decide"), f"/team/{project.id}/decide").classes("imported-go")
            name = file_name(project.sketch.name, ".zip")

            async def hand_on() -> None:
                content = await run.io_bound(files_archive, folder, project.sketch.name)
                if content is not None:
                    ui.download.content(content, name, "application/zip")

            ui.button(say("imported.save"), icon="download", on_click=hand_on).props("flat dense no-caps")


def _events(facts: ImportedFacts) -> None:
    with ui.element("section").classes("panel imported-part"):
        _heading("imported.events")
        ui.label(say("imported.events-hint")).classes("soft")
        with ui.element("ol").classes("imported-notes"):
            for event in facts.events:
                with ui.element("li"):
                    ui.label(event)


class _RobotViewer:
    """Shows one robot at a time: its decisions, its constraints in words, and its file."""

    def __init__(self, project: Project, facts: ImportedFacts, folder: Path) -> None:
        self._project, self._folder = project, folder
        self._robots = {robot.name: robot for robot in facts.robots}
        self._chosen = ""
        _heading("imported.robot")
        if not self._robots:
            return
        select = ui.select([*self._robots], with_input=True, label=say("imported.choose"))
        select.props("dense outlined").classes("imported-choice")
        select.on_value_change(lambda event: self._choose(event.value))
        self._box = ui.element("div").classes("imported-part").props("aria-live=polite")
        last = (facts.there or facts.robots)[-1].name  # its file contains the constraints with earlier robots
        ui.timer(0, lambda: select.set_value(last), once=True)

    async def _choose(self, name: object) -> None:
        robot = self._robots.get(name) if isinstance(name, str) else None
        if robot is None:
            return
        self._chosen = robot.name
        found: ShownRobotFile | str | None
        try:
            found = await run.io_bound(read_robot_file, self._folder, robot.name)
        except (InvalidInputError, OSError) as damaged:
            found = str(damaged)
        if (
            found is None or self._chosen != robot.name or self._box.is_deleted
        ):  # the server is shutting down, or the user selected another robot
            return
        self._box.clear()
        with self._box:
            self._show(robot, found)

    def _show(self, robot: RobotFacts, found: ShownRobotFile | str) -> None:
        if robot.joins:
            ui.label(say("imported.joins", robot=robot.name)).classes("soft")
        with ui.element("h3"):
            ui.label(say("imported.decides"))
        with ui.element("ul").classes("imported-notes"):
            for one in robot.decides[:_MOST_DECISIONS]:
                with ui.element("li"):
                    ui.label(say("imported.one-of", variable=one.variable, size=f"{one.size:,}", values=one.values))
            if (more := len(robot.decides) - _MOST_DECISIONS) > 0:
                with ui.element("li"):
                    ui.label(say("imported.more", count=f"{more:,}"))
        if isinstance(found, str):
            ui.label(found).classes("error")
            return
        self._constraints(found)
        with ui.element("h3"):
            ui.label(found.name)
        if found.is_cut:
            ui.label(say("imported.cut", most=f"{len(found.text):,}")).classes("soft")
        with ui.element("pre").classes("imported-file").props(f'tabindex=0 role=region aria-label="{found.name}"'):
            ui.label(found.text)

    def _constraints(self, found: ShownRobotFile) -> None:
        with ui.element("h3"):
            ui.label(say("imported.keeps"))
        if found.neighbours:
            ui.label(say("imported.neighbours", names=listed(found.neighbours, _MOST_NAMED))).classes("soft")
        if not found.count:
            ui.label(say("imported.keeps-none")).classes("soft")
        with ui.element("ul").classes("imported-notes"):
            for text in found.sentences:
                with ui.element("li"):
                    ui.label(text)
            if (more := found.count - len(found.sentences)) > 0:
                with ui.element("li"):
                    ui.label(say("imported.more", count=f"{more:,}"))


def _elsewhere(folder: Path) -> None:
    """Show the command and the Python code for using the team's files."""
    _heading("imported.elsewhere")
    ui.label(say("imported.command")).classes("soft")
    with ui.element("pre").classes("imported-file command-text").props("tabindex=0"):
        ui.label(shlex.join(["robochoc", "solve", str(folder)]))
    ui.label(say("imported.python")).classes("soft")
    with ui.element("pre").classes("imported-file").props("tabindex=0"):
        ui.label(_PYTHON.format(folder=str(folder)))


def _heading(key: str) -> None:
    with ui.element("h2"):
        ui.label(say(key))


@cache
def style() -> str:
    """Return the style for the pages of imported teams."""
    return (files(__package__) / "imported.css").read_text(encoding="utf-8")
