"""Serves the files of a run: its pages, for frames in the application, and downloads.

/team/ID/kept/RUN/flight.html, conversation.html      complete documents with their own policies
/team/ID/kept/RUN/report.html, flight.mcap, team.zip, state.zip
"""

from __future__ import annotations

import asyncio
from pathlib import Path

from fastapi import Response
from fastapi.responses import FileResponse
from nicegui import app

from robochoc import __version__
from robochoc.app.flights.builder import CONVERSATION, FLIGHT, RECORDING
from robochoc.app.flights.report import Pages, report
from robochoc.app.flights.saved_state import file_name, packed, team_archive
from robochoc.app.projects import Projects
from robochoc.app.runs.run import Run
from robochoc.app.runs.runs import runs_of
from robochoc.formats import InvalidInputError

REPORT = "report.html"
TEAM = "team.zip"
STATE = "state.zip"
MOST_IN_REPORT = 24 << 20
"""The maximum size in bytes of a page included in a report, so that the report can be sent by mail."""
_HEADERS = {"Content-Security-Policy": "frame-ancestors 'self'"}
_APART = {"Content-Security-Policy": "sandbox allow-scripts allow-popups allow-downloads; frame-ancestors 'self'"}
"""The headers for the report, which is given a separate origin because no page needs to access it."""


def address(team: str, run: Run, file: str) -> str:
    """Return the address of a file of a run, relative to the application's address."""
    return f"/team/{team}/kept/{run.id}/{file}"


def relative_address(run: Run, file: str) -> str:
    """Return the address of a run's file relative to the pages of the team, for frames and links set by scripts."""
    return f"kept/{run.id}/{file}"


def install_saved_files(projects: Projects) -> None:
    """Install the addresses of the files."""

    @app.get("/team/{name}/kept/{number}/{file}")
    async def kept(name: str, number: str, file: str) -> Response:
        try:
            run = runs_of(projects.open(name)).find(number)
        except (KeyError, ValueError):
            run = None
        if run is None:
            return Response(status_code=404)
        if file in {FLIGHT, CONVERSATION}:
            return _page(run.artefact(file))
        try:
            return await asyncio.to_thread(_built, run, file)
        except InvalidInputError as mistakes:
            return Response(str(mistakes), status_code=409, media_type="text/plain")
        except (OSError, ValueError):
            return Response(status_code=404)


def _page(file: Path | None) -> Response:
    return Response(status_code=404) if file is None else FileResponse(file, media_type="text/html", headers=_HEADERS)


def _built(run: Run, file: str) -> Response:
    """Return a file that is built on request, or a recording. This function is slow."""
    sketch = run.sketch
    match file:
        case "report.html":
            content = report(sketch, run, Pages(_content(run, FLIGHT), _content(run, CONVERSATION)), __version__)
            return Response(content, media_type="text/html", headers=_APART)
        case "team.zip":
            return _saved(team_archive(run), "application/zip", file_name(sketch.name, ".zip"))
        case "state.zip":
            return _saved(packed(run), "application/zip", file_name(sketch.name, ".robochoc.zip"))
        case "flight.mcap" if recording := run.artefact(RECORDING):
            return FileResponse(
                recording, media_type="application/octet-stream", filename=file_name(sketch.name, ".mcap")
            )
        case _:
            return Response(status_code=404)


def _saved(content: bytes, kind: str, name: str) -> Response:
    return Response(content, media_type=kind, headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _content(run: Run, name: str) -> bytes | None:
    file = run.artefact(name)
    return file.read_bytes() if file and file.stat().st_size <= MOST_IN_REPORT else None
