"""The first page: examples, opening a file, an empty map, and the user's own teams."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from fastapi import HTTPException, Request
from nicegui import app, ui
from nicegui.events import UploadEventArguments
from starlette.datastructures import UploadFile
from starlette.routing import Route

from robochoc.app.jobs.job import EndedError
from robochoc.app.open_file import open_file_job
from robochoc.app.projects import Projects
from robochoc.app.sketch.example_sketches import examples, shows, title_of
from robochoc.app.sketch.open_from_disk import MAX_BYTES
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.thumbnail import thumbnail
from robochoc.app.texts import say
from robochoc.system.plain_text import on_one_line
from robochoc.system.temporary_files import PrivateFolder

_MOST_SHOWN = 60


def build_gallery(projects: Projects) -> None:
    """Fill the page."""
    with ui.element("div"):
        with ui.element("h1"):
            ui.label(say("gallery.title"))
        ui.label(say("gallery.intro")).classes("soft")
    with ui.element("ul").classes("cards"):
        _card(say("gallery.new"), say("gallery.new-hint"), lambda: _create_team(projects, Sketch()), icon="add")
        build_upload_card(projects, show_team)
        _card(say("lesson.title"), say("lesson.title-hint"), lambda: ui.navigate.to("/lessons"), icon="school")
    _heading("gallery.examples")
    with ui.element("ul").classes("cards"):
        for key, sketch in examples().items():
            _card(
                title_of(key),
                sketch.story,
                partial(_create_team, projects, sketch),
                sketch=sketch,
                note=_shown_by(key, sketch),
            )
    _heading("gallery.yours")
    _own(projects)


def _shown_by(key: str, sketch: Sketch) -> str:
    return say("gallery.shows-flying" if sketch.flies else "gallery.shows", what=shows(key))


def show_team(name: str) -> None:
    """Show the page for modelling a team."""
    ui.navigate.to(f"/team/{name}/model")


def _create_team(projects: Projects, sketch: Sketch) -> None:
    show_team(projects.add(sketch).id)


@ui.refreshable
def _own(projects: Projects) -> None:
    names = projects.store.ids()[:_MOST_SHOWN]
    if not names:
        ui.label(say("gallery.none")).classes("soft")
    with ui.element("ul").classes("cards"):
        for name in names:
            _own_card(projects, name)


def _own_card(projects: Projects, name: str) -> None:
    sketch: Sketch | None
    try:
        sketch = projects.store.now(name)
    except (KeyError, ValueError):
        sketch = None
    title = name if sketch is None else sketch.name
    says = say("app.damaged") if sketch is None else counted(len(sketch.robots))
    with _card(title, says, partial(show_team, name), sketch=sketch):
        button = ui.button(icon="close", on_click=partial(_confirm_removal, projects, name, title)).classes("remove")
        button.props("flat round dense size=sm")
        button.props["aria-label"] = say("gallery.remove", name=title)  # `props` would parse the name


def _confirm_removal(projects: Projects, name: str, title: str) -> None:
    def remove() -> None:
        dialog.close()
        with suppress(KeyError):  # the team was already removed
            projects.remove(name)
        _own.refresh()

    with ui.dialog(value=True) as dialog, ui.card():
        ui.label(say("gallery.remove-question", name=title))
        with ui.row():
            ui.button(say("gallery.remove-yes"), on_click=remove).props("no-caps color=negative")
            ui.button(say("gallery.remove-no"), on_click=dialog.close).props("no-caps flat autofocus")


def counted(robots: int) -> str:
    """Return the number of robots in words."""
    return say("gallery.robot") if robots == 1 else say("gallery.robots", count=robots)


def _heading(key: str) -> None:
    with ui.element("h2"):
        ui.label(say(key))


def _card(
    title: str, says: str, does: Callable[[], object], *, sketch: Sketch | None = None, icon: str = "", note: str = ""
) -> ui.element:
    item = ui.element("li").classes("item")
    with item, ui.element("button").classes("card").props("type=button").on("click", does):
        if sketch is not None:
            _thumbnail(sketch)
        elif icon:
            with ui.element("span").classes("picture").props("aria-hidden=true"):
                ui.icon(icon, size="2.5rem")
        with ui.element("h3"):
            ui.label(title)
        ui.label(says).classes("soft")
        if note:
            ui.label(note).classes("small")
    return item


def _thumbnail(sketch: Sketch) -> None:
    with ui.element("span").classes("picture").props("aria-hidden=true"):
        ui.html(thumbnail(sketch), sanitize=False).classes("drawn")  # texts in the picture are escaped


_LONGEST_NAME = 100
_MOST_ERRORS = 3
"""The maximum number of errors shown for a file."""


def build_upload_card(projects: Projects, show: Callable[[str], None]) -> None:
    """Add the card that opens a file; `show` is called with the id of the new team."""
    item = ui.element("li").classes("item")
    with item, ui.element("button").classes("card").props("type=button") as card:
        with ui.element("span").classes("picture").props("aria-hidden=true"):
            ui.icon("upload_file", size="2.5rem")
        with ui.element("h3"):
            ui.label(say("gallery.file"))
        ui.label(say("gallery.file-hint")).classes("soft")
        wrong = ui.label().classes("error mistakes").props("role=alert")

    async def open_upload(event: UploadEventArguments) -> None:
        wrong.set_text("")
        upload.reset()
        with PrivateFolder() as folder:
            file = Path(folder) / (Path(event.file.name or "").name[-_LONGEST_NAME:] or "team")
            await event.file.save(file)
            try:
                found = await asyncio.wrap_future(open_file_job(file, projects.store).future)
            except EndedError:  # the server is shutting down
                return
            if found.mistakes:
                wrong.set_text(_first_errors(found.mistakes.replace(f"{folder}/", "")))
            else:
                show(found.team)

    with item:
        upload = ui.upload(
            on_upload=open_upload,
            on_rejected=lambda: wrong.set_text(say("gallery.too-large", most=MAX_BYTES >> 20)),
            auto_upload=True,
            max_file_size=MAX_BYTES,
        ).classes("hidden")
    _accept_only_files(str(upload.props["url"]))
    # In the browser, which opens the file dialog only in response to a click.
    card.on("click", js_handler=f"() => getElement({upload.id}).$el.querySelector('input[type=file]').click()")


def _accept_only_files(url: str) -> None:
    """Reject forms without a file at the upload address, which NiceGUI would not handle."""
    route = next(route for route in app.routes if isinstance(route, Route) and route.path == url)
    app.remove_route(url)

    @app.post(url)
    async def upload(request: Request) -> dict[str, str]:
        async with request.form() as form:  # the form is cached, so NiceGUI receives the same one
            if not form or not all(isinstance(value, UploadFile) for value in form.values()):
                raise HTTPException(400, say("gallery.no-file"))
            answer: dict[str, str] = await route.endpoint(request)
            return answer


def _first_errors(mistakes: str) -> str:
    """Return the first errors, one per line, and the number of further errors."""
    lines = mistakes.splitlines() or [say("app.fault")]
    more = len(lines) - _MOST_ERRORS
    first = [on_one_line(line) for line in lines[:_MOST_ERRORS]]
    return "\n".join([*first, say("gallery.more-mistakes", count=f"{more:,}")] if more > 0 else first)
