"""Opening a file: the browser uploads the file, a separate process reads it, and the page shows the errors."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from fastapi import HTTPException, Request
from nicegui import app, ui
from nicegui.events import UploadEventArguments
from starlette.datastructures import UploadFile
from starlette.routing import Route

from robochoc.app.jobs.job import EndedError
from robochoc.app.opening import opening_of
from robochoc.app.projects import Projects
from robochoc.app.sketch.opening import MAX_BYTES
from robochoc.app.texts import say
from robochoc.system.plain_text import on_one_line
from robochoc.system.temporary_files import PrivateFolder

_LONGEST_NAME = 100
_MOST_TOLD = 3
"""Mistakes of a file that are told: where many files are wrong, the first ones say what is to be done."""


def build_opening(projects: Projects, show: Callable[[str], None]) -> None:
    """Add the card that opens a file; `show` is called with the id of the team that is made of it."""
    item = ui.element("li").classes("item")
    with item, ui.element("button").classes("card").props("type=button") as card:
        with ui.element("span").classes("picture").props("aria-hidden=true"):
            ui.icon("upload_file", size="2.5rem")
        with ui.element("h3"):
            ui.label(say("gallery.file"))
        ui.label(say("gallery.file-hint")).classes("soft")
        wrong = ui.label().classes("error mistakes").props("role=alert")

    async def take(event: UploadEventArguments) -> None:
        wrong.set_text("")
        upload.reset()
        with PrivateFolder() as folder:
            file = Path(folder) / (Path(event.file.name or "").name[-_LONGEST_NAME:] or "team")
            await event.file.save(file)
            try:
                found = await asyncio.wrap_future(opening_of(file, projects.store).future)
            except EndedError:  # the server ends
                return
            if found.mistakes:
                wrong.set_text(_told(found.mistakes.replace(f"{folder}/", "")))
            else:
                show(found.team)

    with item:
        upload = ui.upload(
            on_upload=take,
            on_rejected=lambda: wrong.set_text(say("gallery.too-large", most=MAX_BYTES >> 20)),
            auto_upload=True,
            max_file_size=MAX_BYTES,
        ).classes("hidden")
    _take_files_alone(str(upload.props["url"]))
    # In the browser: it opens the dialog for a click alone.
    card.on("click", js_handler=f"() => getElement({upload.id}).$el.querySelector('input[type=file]').click()")


def _take_files_alone(url: str) -> None:
    """Refuse forms without a file that are sent to the address of an upload: NiceGUI has no answer to text."""
    route = next(route for route in app.routes if isinstance(route, Route) and route.path == url)
    app.remove_route(url)

    @app.post(url)
    async def taken(request: Request) -> dict[str, str]:
        async with request.form() as form:  # it is read once: NiceGUI gets the same
            if not form or not all(isinstance(value, UploadFile) for value in form.values()):
                raise HTTPException(400, say("gallery.no-file"))
            answer: dict[str, str] = await route.endpoint(request)
            return answer


def _told(mistakes: str) -> str:
    """Return the first mistakes, each in its line, and how many others there are."""
    lines = mistakes.splitlines() or [say("app.fault")]
    more = len(lines) - _MOST_TOLD
    told = [on_one_line(line) for line in lines[:_MOST_TOLD]]
    return "\n".join([*told, say("gallery.more-mistakes", count=f"{more:,}")] if more > 0 else told)
