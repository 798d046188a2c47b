"""The panel "Share": report, recording, the team's files, the saved state, and a link."""

from __future__ import annotations

import json
from collections.abc import Callable

from nicegui import ui

from robochoc.app.flights.builder import RECORDING, BuildError, FlightBuilder, can_record, flies
from robochoc.app.flights.saved_state import MAX_JOURNAL_BYTES, file_name, is_too_long
from robochoc.app.pages.fly.frames import RunFrames
from robochoc.app.pages.fly.saved_files import REPORT, STATE, TEAM, relative_address
from robochoc.app.texts import say


def build_share_panel(builder: FlightBuilder, stage: RunFrames | None) -> None:
    """Fill the current container."""
    run = builder.run
    name = run.sketch.name
    with ui.element("section").classes("tell").props("aria-labelledby=tell-title"):
        with ui.element("h2").props("id=tell-title"):
            ui.label(say("tell.title"))
        with ui.element("ul").classes("cards"):
            with _card("tell.report", "tell.report-hint"):
                _link(say("tell.get"), "tell.report", relative_address(run, REPORT), file_name(name, ".html"))
                _link(say("tell.report-open"), "tell.report", relative_address(run, REPORT))
            _recording(builder)
            with _card("tell.team", "tell.team-hint"):
                _link(say("tell.get"), "tell.team", relative_address(run, TEAM), file_name(name, ".zip"))
            with _card("tell.state", "tell.state-hint"):
                if is_too_long(run):
                    ui.label(say("tell.state-long", most=MAX_JOURNAL_BYTES >> 20)).classes("soft")
                _link(say("tell.get"), "tell.state", relative_address(run, STATE), file_name(name, ".robochoc.zip"))
            with _card("tell.link", "tell.link-hint"):
                _copy(run.id, stage)


def _recording(builder: FlightBuilder) -> None:
    with _card("tell.recording", "tell.recording-hint"):
        if not builder.has_answer or not flies(builder.run):
            ui.label(say("tell.recording-nothing")).classes("soft")
        elif not can_record():
            ui.label(say("tell.recording-missing")).classes("soft")
        else:
            button = _button("tell.get", "tell.recording")

            async def record() -> None:
                button.props("loading")
                try:
                    await builder.recording()
                except (BuildError, OSError, ValueError) as why:
                    ui.notify(say("tell.not-made", why=why), type="negative")
                else:
                    ui.run_javascript(f"location.assign({json.dumps(relative_address(builder.run, RECORDING))})")
                finally:
                    button.props(remove="loading")

            button.on_click(record)


def _copy(run: str, stage: RunFrames | None) -> None:
    address = json.dumps(f"fly?run={run}")
    there = f"getElement({stage.id}).link({address})" if stage else f"new URL({address}, location.href).href"
    button = _button("tell.copy", "tell.link", lambda: ui.notify(say("tell.copied")))
    button.on("click", js_handler=f"() => navigator.clipboard?.writeText({there})")


class _card:  # noqa: N801 - a context manager, as NiceGUI's are
    """A card with a title, a hint, and actions."""

    def __init__(self, title: str, hint: str) -> None:
        with ui.element("li").classes("card told"):
            with ui.element("h3"):
                ui.label(say(title))
            ui.label(say(hint)).classes("soft")
            self._does = ui.element("div").classes("does")

    def __enter__(self) -> None:
        self._does.__enter__()

    def __exit__(self, *_: object) -> None:
        self._does.__exit__()


def _link(text: str, what: str, address: str, saved_as: str | None = None) -> None:
    """Add a link that looks like a button. With `saved_as`, it saves the file; otherwise it opens the file in a tab."""
    link = ui.element("a").classes("button")
    link._props["href"] = address  # noqa: SLF001 - `props` would parse it
    link._props["aria-label"] = f"{say(what)}: {text}"  # noqa: SLF001
    if saved_as:
        link._props["download"] = saved_as  # noqa: SLF001
    else:
        link.props("target=_blank rel=noopener")
    with link:
        ui.label(text)


def _button(key: str, what: str, does: Callable[[], object] | None = None) -> ui.button:
    button = ui.button(say(key), on_click=does).props("flat no-caps dense").classes("button")
    button._props["aria-label"] = f"{say(what)}: {say(key)}"  # noqa: SLF001 - `props` would parse it
    return button
