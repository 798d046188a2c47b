"""The addresses of all pages."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import app, ui

from robochoc.app.jobs.job import end_all
from robochoc.app.lessons.progress import LessonProgress
from robochoc.app.log import error_text
from robochoc.app.pages.compare.page import build_compare, install_reports
from robochoc.app.pages.decide.page import build_decide
from robochoc.app.pages.fly.page import build_fly
from robochoc.app.pages.fly.saved_files import install_saved_files
from robochoc.app.pages.gallery import build_gallery
from robochoc.app.pages.imported.model import build_imported_model
from robochoc.app.pages.imported.whatif import build_imported_whatif
from robochoc.app.pages.lessons.page import build_lesson, build_lessons
from robochoc.app.pages.model.page import build_model
from robochoc.app.pages.seat.page import build_seat
from robochoc.app.pages.shell import AREAS, shell
from robochoc.app.pages.whatif.page import build_whatif
from robochoc.app.projects import Project, Projects
from robochoc.app.texts import say

_BUILD: dict[str, Callable[[Project], None]] = {
    "model": build_model,
    "decide": build_decide,
    "whatif": build_whatif,
    "fly": build_fly,
    "compare": build_compare,
    "play": build_seat,
}
_BUILD_FOREIGN: dict[str, Callable[[Project], None]] = {"model": build_imported_model, "whatif": build_imported_whatif}
"""The pages that are different for imported teams."""


def install(projects: Projects) -> None:
    """Install all pages."""
    app.on_shutdown(projects.save)
    install_saved_files(projects)
    app.on_shutdown(_end_jobs)
    install_reports(projects)

    app.on_page_exception(_fault)

    @ui.page("/")
    def gallery() -> None:
        with shell(""):
            build_gallery(projects)

    @ui.page("/team/{name}/{area}")
    def team(name: str, area: str) -> None:
        try:
            project = projects.open(name)
            build = {**_BUILD, **_BUILD_FOREIGN} if project.files else _BUILD  # this reads the facts
        except (KeyError, ValueError) as missing:
            _missing(damaged=isinstance(missing, ValueError))
            return
        chosen = area if area in AREAS else AREAS[0]
        with shell(project.sketch.name, project, chosen):
            build[chosen](project)

    progress = LessonProgress(projects.store.folder)

    @ui.page("/lessons")
    def lessons() -> None:
        with shell(say("lesson.title")):
            build_lessons(progress)

    @ui.page("/lessons/{number}")
    def one_lesson(number: str) -> None:
        with shell(say("lesson.title")):
            build_lesson(number, progress)

    @ui.page("/{_path:path}")
    def anything_else(_path: str) -> None:
        _missing(damaged=False)


def _end_jobs() -> None:  # NiceGUI would pass the application to a parameter
    end_all()


def _fault(error: Exception) -> None:
    with shell(""):
        with ui.element("h1"):
            ui.label(say("app.fault-page"))
        ui.label(error_text(error))
        ui.link(say("app.home"), "/")


def _missing(*, damaged: bool) -> None:
    with shell(""):
        with ui.element("h1"):
            ui.label(say("app.damaged" if damaged else "app.gone"))
        ui.label(say("app.gone-remedy"))
        ui.link(say("app.home"), "/")
