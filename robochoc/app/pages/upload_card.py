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
from robochoc.app.open_file import open_file_job
from robochoc.app.projects import Projects
from robochoc.app.sketch.opening import MAX_BYTES
from robochoc.app.texts import say
from robochoc.system.plain_text import on_one_line
from robochoc.system.temporary_files import PrivateFolder

_LONGEST_NAME = 100
_MOST_SHOWN = 3
"""The maximum number of errors of a file that are shown."""


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
    # In the browser, since it opens the file dialog only in response to a click.
    card.on("click", js_handler=f"() => getElement({upload.id}).$el.querySelector('input[type=file]').click()")


def _accept_only_files(url: str) -> None:
    """Reject forms without a file at the address of an upload, which NiceGUI does not handle."""
    route = next(route for route in app.routes if isinstance(route, Route) and route.path == url)
    app.remove_route(url)

    @app.post(url)
    async def upload(request: Request) -> dict[str, str]:
        async with request.form() as form:  # the form is cached: NiceGUI gets the same one
            if not form or not all(isinstance(value, UploadFile) for value in form.values()):
                raise HTTPException(400, say("gallery.no-file"))
            answer: dict[str, str] = await route.endpoint(request)
            return answer


def _first_errors(mistakes: str) -> str:
    """Return the first errors, one per line, and the number of the others."""
    lines = mistakes.splitlines() or [say("app.fault")]
    more = len(lines) - _MOST_SHOWN
    first = [on_one_line(line) for line in lines[:_MOST_SHOWN]]
    return "\n".join([*first, say("gallery.more-mistakes", count=f"{more:,}")] if more > 0 else first)
