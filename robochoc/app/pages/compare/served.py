"""Serve the report of a study, a complete document with its own policy, for a frame of the page."""

from __future__ import annotations

from fastapi import Response
from fastapi.responses import FileResponse
from nicegui import app

from robochoc.app.projects import Projects
from robochoc.app.studies.study import study_on

REPORT = "study/report.html"
"""The address of the report, relative to the pages of its team."""


def install_reports(projects: Projects) -> None:
    """Install the address of reports."""

    @app.get("/team/{name}/" + REPORT)
    async def report(name: str) -> Response:  # in the event loop, as in all code that opens teams
        try:
            file = study_on(projects.open(name)).report
        except (KeyError, ValueError):
            file = None
        if file is None:
            return Response(status_code=404)
        policy = "sandbox allow-popups; frame-ancestors 'self'"
        return FileResponse(file, media_type="text/html", headers={"Content-Security-Policy": policy})
