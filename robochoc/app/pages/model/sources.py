"""The team's XML and Python sources, which are updated after edits, and the download of its files."""

from __future__ import annotations

from typing import NamedTuple

from nicegui import run, ui

from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.widgets import panel
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.files import xml_sources, zipped
from robochoc.app.sketch.python_program import python_source
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError

_QUIET_S = 0.5
"""The time in seconds between an edit and writing the sources again."""
MOST_AT_ONCE = 40
"""The maximum number of robots for which sources are updated automatically; for larger teams, on request."""
_COPY = """(event) => {
  const text = document.getElementById(%s).textContent;
  navigator.clipboard?.writeText(text);
}"""


class SourceTexts(NamedTuple):
    """The sources of a sketch, or the reason why there are none."""

    xml: dict[str, str]
    python: str
    wrong: str


class Sources:
    """The tabs with the sources."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._written: Sketch | None = None
        self._writing = False
        self._files: dict[str, str] = {}
        with ui.element("div").classes("sources"), panel("model.sources"):
            ui.label(say("model.sources-hint")).classes("soft")
            with ui.element("div").classes("source-bar"):
                self._tab = ui.toggle({"xml": "XML", "python": "Python"}, value="python", on_change=self._show_tab)
                self._tab.props("no-caps unelevated").classes("segments")
                self._file = ui.select([], label=say("model.file"), on_change=self._show_file).props("dense outlined")
                self._file.classes("file")
                copy = ui.button(say("model.copy"), icon="content_copy").props("flat dense no-caps")
                self._save = ui.button(say("model.save"), icon="download", on_click=self._download)
                self._save.props("flat dense no-caps")
            self._state = ui.label().classes("soft").props("role=status")
            self._ask = ui.button(say("model.write"), on_click=self._write_on_request).props("outline no-caps dense")
            with (
                ui.element("div").classes("scroll").props(f'tabindex=0 role=region aria-label="{say("model.sources")}"')
            ):
                self._text = ui.label().classes("source")
            copy.on_click(lambda: ui.notify(say("model.copied")))
            copy.on("click", js_handler=_COPY % f"'{self._text.html_id}'")
        self._timer = ui.timer(_QUIET_S, self._write, active=False)
        self._python = ""
        self._show_tab()

    def changed(self) -> None:
        """After a change in the team, update the sources or offer to update them."""
        large = len(self._desk.sketch.robots) > MOST_AT_ONCE
        self._ask.set_visibility(large and self._written is not self._desk.sketch)
        if not large:
            self._timer.activate()
        elif self._written is not self._desk.sketch:
            self._state.set_text(say("model.source-old"))

    async def _write_on_request(self) -> None:
        self._ask.set_visibility(False)
        await self._write()

    async def _write(self) -> None:
        """Write the sources in a thread, until they match the current team."""
        self._timer.deactivate()
        if self._writing:
            return
        self._writing = True
        try:
            while self._written is not self._desk.sketch:
                sketch = self._desk.sketch
                written = await run.io_bound(source_texts, sketch)
                if written is None:  # the application is shutting down
                    return
                self._written = sketch
                self._show(written)
        finally:
            self._writing = False

    def _show(self, written: SourceTexts) -> None:
        self._state.set_text(written.wrong)
        self._files, self._python = written.xml, written.python
        names = [*self._files]
        chosen = self._file.value if self._file.value in names else next(iter(names), None)
        self._file.set_options(names, value=chosen)
        self._show_tab()

    def _show_tab(self) -> None:
        is_xml = self._tab.value == "xml"
        self._file.set_visibility(is_xml and bool(self._files))
        self._show_file()

    def _show_file(self) -> None:
        text = self._files.get(self._file.value or "", "") if self._tab.value == "xml" else self._python
        self._text.set_text(text)

    async def _download(self) -> None:
        sketch = self._desk.sketch
        try:
            content = await run.io_bound(zipped, sketch)
        except InvalidInputError as error:
            self._desk.show_error(str(error))
            ui.notify(say("model.source-wrong"), type="negative")
            return
        if content is not None:
            ui.download.content(content, f"{sketch.name}.zip", "application/zip")


def source_texts(sketch: Sketch) -> SourceTexts:
    """Return the sources for a sketch."""
    if errors_of(sketch):
        return SourceTexts({}, "", say("model.source-wrong"))
    try:
        return SourceTexts(xml_sources(sketch), python_source(sketch), "")
    except InvalidInputError as error:
        return SourceTexts({}, "", str(error))
