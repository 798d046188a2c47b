"""Small pictures of teams."""

from __future__ import annotations

from nicegui import ui

from robochoc.app.sketch.picture import picture
from robochoc.app.sketch.sketch import Sketch


def thumbnail(sketch: Sketch) -> None:
    """Show a team as a picture. Its words are escaped where it is drawn."""
    with ui.element("span").classes("picture").props("aria-hidden=true"):
        ui.html(picture(sketch), sanitize=False).classes("drawn")
