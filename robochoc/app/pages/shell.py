"""The frame around all pages: the bar with links, the team's name, undo and redo, and the theme button."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files

from nicegui import ui
from nicegui.element import Element
from nicegui.events import KeyEventArguments

from robochoc.app.projects import Project
from robochoc.app.sketch.edits import EditError, renamed
from robochoc.app.texts import say

AREAS = ("model", "decide", "whatif", "fly", "compare", "play")
"""The pages of a team, in the usual order of use."""


class ThemeButton(Element, component="theme.js"):
    """The button that switches between light and dark. The browser stores the choice for all pages."""

    def __init__(self) -> None:
        super().__init__()
        self._props["says"] = say("app.dark")


def edit_error_text(error: EditError) -> str:
    """Return the error text for an invalid edit."""
    return say(error.key, **error.named)


@contextmanager
def shell(title: str, project: Project | None = None, area: str = "") -> Iterator[None]:
    """Build the bar of a page, and the container that the caller fills."""
    ui.add_css(_style())
    ui.page_title(f"{title} - {say('app.title')}" if title else say("app.title"))
    ui.colors(primary="var(--accent)")
    if around := ui.context.client.content.parent_slot:
        around.parent.props("role=none")  # NiceGUI's page is a <main> that contains our <main> and the bar
    ui.link(say("app.skip"), "#content").classes("skip")
    with ui.element("header").classes("bar"):
        _brand()
        if project is not None:
            _name(project)
            _areas(project, area)
        with ui.element("div").classes("tools"):
            if project is not None:
                _undo_and_redo(project)
            ThemeButton()
    with ui.element("main").classes("main").props("id=content tabindex=-1"):
        if project is not None:
            _project_error(project)
        yield


def on_leave(end: Callable[[], None]) -> None:
    """Call `end` when the browser leaves the current page."""
    ui.context.client.on_delete(end)


def _brand() -> None:
    with ui.link(target="/").classes("brand").props(f'aria-label="{say("app.home")}"'):
        ui.html(_icon(), sanitize=False).props("aria-hidden=true")
        ui.label(say("app.title"))


def _name(project: Project) -> None:
    def rename(value: str | None) -> str | None:
        try:
            project.edit(lambda sketch: renamed(sketch, str(value or "")))
        except EditError as error:
            return edit_error_text(error)
        return None

    field = ui.input(value=project.sketch.name, validation=rename).classes("name")
    field.props(f'dense outlined hide-bottom-space debounce=400 maxlength=60 aria-label="{say("app.name")}"')

    def follow() -> None:
        if field.value != project.sketch.name and not field.error:
            field.set_value(project.sketch.name)

    on_leave(project.on_change(follow))


def _project_error(project: Project) -> None:
    """Show an error if the team was removed in another window or cannot be saved."""
    label = ui.label().classes("error").props("role=alert")

    def follow() -> None:
        text = say("app.unsaved", why=project.unsaved) if project.unsaved else ""
        label.set_text(say("app.removed") if project.removed else text)
        label.set_visibility(bool(label.text))

    on_leave(project.on_change(follow))
    follow()


def _areas(project: Project, area: str) -> None:
    with ui.element("nav").classes("areas").props(f'aria-label="{say("app.areas")}"'):
        for name in AREAS:
            link = ui.link(say(f"area.{name}"), f"/team/{project.id}/{name}")
            if name == area:
                link.props("aria-current=page")


def _undo_and_redo(project: Project) -> None:
    undo = _button("undo", "app.undo", project.undo)
    redo = _button("redo", "app.redo", project.redo)

    def follow() -> None:
        undo.set_enabled(project.can_undo)
        redo.set_enabled(project.can_redo)

    def pressed(event: KeyEventArguments) -> None:
        if event.action.keydown and (event.modifiers.ctrl or event.modifiers.meta) and event.key.name.lower() == "z":
            (project.redo if event.modifiers.shift else project.undo)()

    ui.keyboard(pressed, ignore=["input", "select", "textarea"])  # in these elements, the browser undoes
    on_leave(project.on_change(follow))
    follow()


def _button(icon: str, key: str, does: Callable[[], object]) -> ui.button:
    button = ui.button(icon=icon, on_click=does).props(f'flat round dense aria-label="{say(key)}"')
    with button:
        ui.tooltip(say(key))
    return button


@cache
def _style() -> str:
    style = (files(__package__) / "style.css").read_text(encoding="utf-8")
    return f"{style}\n#popup::after {{ content: {json.dumps(say('app.away'))}; max-width: 24rem; }}"  # no connection


@cache
def _icon() -> str:
    return (files("robochoc.app") / "icon.svg").read_text(encoding="utf-8")
